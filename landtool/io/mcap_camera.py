"""Which calibration topic belongs to an image topic, and its message as a Camera."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from landtool.camera import COEFFICIENTS, Camera, DistortionModel
from landtool.errors import InputError
from landtool.io.mcap_messages import Calibration

MODELS: dict[str, DistortionModel] = {
    "plumb_bob": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
    # drivers without a lens model leave the name empty; the coefficients are then all there is
    "": "plumb_bob",
}


def camera_topic(image_topic: str, ros: Iterable[str], foxglove: Iterable[str], image_topics: int) -> str | None:
    """Return the calibration topic of an image topic, None when none is its own.

    ros: topics of CameraInfo, of which `camera_info` beside the image is meant, as image_transport has it (beside
    `image_raw` for `image_raw/compressed`). foxglove: topics of CameraCalibration, of which the one that shares most
    leading names is meant; one that shares none only when it and the image topic are the only ones.
    """
    names = image_topic.split("/")
    parents = ["/".join(names[:-cut]) for cut in (1, 2) if cut < len(names)]
    known = set(ros)
    for parent in parents:
        if f"{parent}/camera_info" in known:
            return f"{parent}/camera_info"
    candidates = sorted(foxglove)
    if not candidates:
        return None
    shared = {topic: _shared(names, topic.split("/")) for topic in candidates}
    best = max(candidates, key=lambda topic: shared[topic])
    lonely = len(candidates) == 1 and image_topics == 1
    return best if shared[best] or lonely else None


def _shared(names: Sequence[str], others: Sequence[str]) -> int:
    """Count the leading names two topics share, the empty one before the first slash not counted."""
    count = 0
    for name, other in zip(names, others, strict=False):
        if name != other:
            break
        count += bool(name)
    return count


def is_rectified(image_topic: str) -> bool:
    """Whether image_proc made the topic's pictures: then P describes them, without distortion, and not K."""
    return any(name.startswith("image_rect") for name in image_topic.split("/"))


def camera_from(calibration: Calibration, *, rectified: bool) -> Camera:
    """Return the camera of the pictures a calibration message comes with; binning and region of interest applied.

    Raises InputError saying why for an uncalibrated camera (K[0] = 0) or one that cannot be used.
    """
    matrix = (calibration.p[:3], calibration.p[4:7]) if rectified else (calibration.k[:3], calibration.k[3:6])
    if not matrix[0] or not matrix[1] or matrix[0][0] == 0.0:
        raise InputError("the camera is uncalibrated (K[0] is 0)", hint="calibrate it or pass --camera")
    (fx, skew, cx), (_, fy, cy) = matrix
    if skew:
        raise InputError(f"the camera matrix has a skew of {skew:g}", hint="calibrate the camera without skew")
    model: DistortionModel = "plumb_bob"
    distortion: tuple[float, ...] = (0.0,) * COEFFICIENTS[model]
    if not rectified:
        model, distortion = _lens(calibration.model, calibration.d)
    camera = Camera(calibration.width, calibration.height, fx, fy, cx, cy, model, distortion)
    if roi := calibration.roi:
        camera = camera.cropped(roi.x, roi.y, roi.width, roi.height)
    if calibration.binning != (1, 1):
        camera = camera.scaled(camera.width // calibration.binning[0], camera.height // calibration.binning[1])
    return camera


def _lens(name: str, d: tuple[float, ...]) -> tuple[DistortionModel, tuple[float, ...]]:
    """Return the lens model and its coefficients; trailing zeros may be missing or be too many."""
    model = MODELS.get(name.strip().lower())
    if model is None:
        raise InputError(
            f"the distortion model '{name}' is not known", hint=f"known: {', '.join(filter(None, MODELS))}"
        )
    count = COEFFICIENTS[model]
    if any(d[count:]) or (d and len(d) < count and not (model == "plumb_bob" and len(d) == 4)):
        raise InputError(f"{len(d)} coefficients do not fit the distortion model '{name}'", hint="pass --camera")
    return model, (*d[:count], *(0.0,) * (count - len(d)))
