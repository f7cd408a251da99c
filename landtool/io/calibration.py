"""Camera calibration files: ROS camera_info YAML, Kalibr camchains and OpenCV FileStorage, told apart by content."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import cv2
import yaml

from landtool.camera import Camera, DistortionModel
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.io.atomic import atomic_path
from landtool.io.camera_check import refuse_impossible

_MAX_BYTES = 1_000_000  # a calibration is a page of text; a video given by mistake must not be read whole
_HINT = "give a ROS camera_info YAML, a Kalibr camchain or an OpenCV calibration"
_RECALIBRATE = "calibrate the camera again"

# Every name a value goes by: ROS first, then OpenCV's samples and tools
_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "k")
_DISTORTION = ("distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs", "D", "d")
_WIDTH = ("image_width", "image_Width", "width")
_HEIGHT = ("image_height", "image_Height", "height")
_SIZE = ("imageSize", "image_size", "cameraResolution", "resolution")

_MODELS: dict[str, DistortionModel] = {
    "plumb_bob": "plumb_bob",
    "radtan": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "equidistant",
    "kannala_brandt": "equidistant",
    "fisheye": "equidistant",
}


def read_camera(path: Path, name: str | None = None) -> Camera:
    """Read a camera from a calibration file.

    name: which camera of a Kalibr camchain, such as "cam0"; needed only when there are several.

    Raises UsageError when the file cannot be opened or the name does not choose one camera, InputError when the
    content is no calibration, or one landtool cannot use.
    """
    try:
        data = _parse(_read_text(path))
        chain = _camchain(data)
        if chain:
            return _from_kalibr(*_choose(chain, name))
        if name is not None:
            raise UsageError(f"holds one camera and no '{name}'", hint="leave the camera's name out")
        return _from_matrix(data)
    except LandtoolError as error:
        raise type(error)(error.reason, file=path, hint=error.hint) from error


def read_cameras(path: Path) -> tuple[str, dict[str, Camera]]:
    """Return a calibration file's format and all its cameras by name, the one of a ROS or OpenCV file without a name.

    Raises as `read_camera` does.
    """
    try:
        text = _read_text(path)
        data = _parse(text)
        if chain := _camchain(data):
            return "Kalibr camchain", {name: _from_kalibr(name, cam) for name, cam in chain.items()}
        opencv = _is_file_storage(text) or text.lstrip().startswith("{")
        return "OpenCV FileStorage" if opencv else "ROS camera_info", {"": _from_matrix(data)}
    except LandtoolError as error:
        raise type(error)(error.reason, file=path, hint=error.hint) from error


def match_camera(camera: Camera, width: int, height: int, *, scale: bool) -> Camera:
    """Return the camera for images of width x height pixels.

    With `scale` a camera of another size is scaled, when the shapes agree within 1 %.

    Raises InputError when the sizes differ and scaling was not asked for, the shapes differ, or no lens can be as the
    calibration says.
    """
    refuse_impossible(camera)
    if (camera.width, camera.height) == (width, height):
        return camera
    sizes = f"the calibration is for {camera.width}x{camera.height}, the images are {width}x{height}"
    stretch = (width * camera.height) / (height * camera.width)
    if abs(stretch - 1.0) > 0.01:
        raise InputError(
            f"{sizes}, a different shape",
            hint="calibrate at the images' own size, --scale-intrinsics needs the same shape",
        )
    if not scale:
        hint = "pass --scale-intrinsics if the images are the camera's whole picture resized"
        raise InputError(sizes, hint=hint)
    return camera.scaled(width, height)


def camera_yaml(camera: Camera, name: str = "camera") -> str:
    """Return the camera as ROS camera_info YAML, from which `read_camera` makes an equal camera."""
    k = camera.matrix.tolist()
    data = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": _ros_matrix(k),
        "distortion_model": camera.model,
        "distortion_coefficients": _ros_matrix([list(camera.distortion)]),
        "rectification_matrix": _ros_matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        "projection_matrix": _ros_matrix([[*row, 0.0] for row in k]),
    }
    if camera.assumed:
        data["assumed"] = camera.assumed  # no key of ROS's, which ignores it
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)


def write_camera(camera: Camera, path: Path, *, overwrite: bool = False) -> None:
    """Write the camera as ROS camera_info YAML, whole or not at all. Raises as `atomic_path` does."""
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text(camera_yaml(camera), encoding="utf-8")


def _read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", hint=_HINT) from error
    if not content.strip():
        raise InputError("is empty", hint=_HINT)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if len(content) > _MAX_BYTES or "\0" in text:
        raise InputError("is no calibration but a large or binary file", hint=_HINT)
    return text


def _parse(text: str) -> Mapping[str, Any]:
    """Turn the text into nested mappings, lists and plain values, whichever format it is in."""
    try:
        data = _parse_file_storage(text) if _is_file_storage(text) else _parse_json_or_yaml(text)
    # a parser meets anything here: PyYAML also raises ValueError (an impossible date) and RecursionError
    except (yaml.YAMLError, cv2.error, SystemError, ValueError, RecursionError) as error:
        raise InputError(f"is no valid YAML, XML or JSON{_place(error)}", hint=_HINT) from error
    if not isinstance(data, Mapping):
        raise InputError("holds no calibration", hint=_HINT)
    return data


def _is_file_storage(text: str) -> bool:
    """Tell OpenCV's own YAML and XML, which nothing else reads, from plain YAML and JSON."""
    return text.startswith("%YAML:") or "!!opencv-" in text or text.lstrip().startswith("<")


def _place(error: Exception) -> str:
    mark = getattr(error, "problem_mark", None)
    return f" (line {mark.line + 1})" if mark else ""


def _parse_json_or_yaml(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return yaml.safe_load(text)  # JSON as OpenCV 4 writes it, with numbers like `1.`, is still YAML


def _parse_file_storage(text: str) -> Any:
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    try:
        return _plain(storage.root())
    finally:
        storage.release()


def _plain(node: cv2.FileNode) -> Any:
    if node.isMap():
        return {key: _plain(node.getNode(key)) for key in node.keys()}  # noqa: SIM118 - a FileNode is no mapping
    if node.isSeq():
        return [_plain(node.at(i)) for i in range(node.size())]
    if node.isNone():
        return None
    return node.string() if node.isString() else node.real()


def _camchain(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the cameras of a Kalibr camchain by name; none when the file is no camchain."""
    if "intrinsics" in data:
        return {"": data}
    return {str(key): cam for key, cam in data.items() if isinstance(cam, Mapping) and "intrinsics" in cam}


def _choose(chain: dict[str, Mapping[str, Any]], name: str | None) -> tuple[str, Mapping[str, Any]]:
    if name is None and len(chain) == 1:
        return next(iter(chain.items()))
    names = ", ".join(chain)
    if name is None:
        raise UsageError(f"holds {len(chain)} cameras: {names}", hint="name one of them")
    if name not in chain:
        raise UsageError(f"holds no camera '{name}'", hint=f"it holds {names}" if names else "leave the name out")
    return name, chain[name]


def _from_kalibr(name: str, cam: Mapping[str, Any]) -> Camera:
    kind = cam.get("camera_model", "pinhole")
    if kind != "pinhole":
        hint = "calibrate again with pinhole-radtan or pinhole-equi"
        raise InputError(f"{name} has the camera model '{kind}', landtool knows pinhole", hint=hint)
    fx, fy, cx, cy = _numbers(cam["intrinsics"], f"{name} intrinsics", 4)
    width, height = _size(cam)
    model, distortion = _distortion(cam.get("distortion_model"), cam.get("distortion_coeffs", []))
    return Camera(width, height, fx, fy, cx, cy, model, distortion)


def _from_matrix(data: Mapping[str, Any]) -> Camera:
    """Build the camera of a ROS or OpenCV file."""
    k = _numbers(_first(data, _MATRIX, "camera matrix"), "the camera matrix", 9)
    fx, skew, cx, zero, fy, cy, *last = k
    if all(map(math.isfinite, k)) and (zero, *last) != (0.0, 0.0, 0.0, 1.0):
        raise InputError("the camera matrix is not of the form fx 0 cx, 0 fy cy, 0 0 1", hint=_RECALIBRATE)
    if abs(skew) > 1e-6 * abs(fx):
        raise InputError(f"the camera matrix has a skew of {skew:g}", hint="calibrate the camera without skew")
    width, height = _size(data)
    said = "equidistant" if data.get("fisheye_model") in (1, True) else data.get("distortion_model")
    model, distortion = _distortion(said, _first(data, _DISTORTION, "distortion coefficients"))
    return Camera(width, height, fx, fy, cx, cy, model, distortion, assumed=str(data.get("assumed", "")))


def _distortion(said: Any, coefficients: Any) -> tuple[DistortionModel, tuple[float, ...]]:
    """Return the lens model and its full coefficients; a file that names no model means OpenCV's own, by count."""
    values = tuple(_numbers(coefficients, "the distortion coefficients"))
    if len(values) in (12, 14):
        hint = "calibrate without them" if any(values[8:]) else "all of them are 0: keep the first 8 coefficients"
        raise InputError(f"{len(values)} distortion coefficients: thin prisms and tilts are not supported", hint=hint)
    if said in (None, "", "none"):
        model: DistortionModel = "rational_polynomial" if len(values) == 8 else "plumb_bob"
    elif str(said) in _MODELS:
        model = _MODELS[str(said)]
    else:
        raise InputError(f"unknown distortion model '{said}'", hint=f"known: {', '.join(_MODELS)}")
    if model == "plumb_bob" and len(values) in (0, 4):
        values = (*values, *(0.0,) * (5 - len(values)))  # without k3, or without any: the same lens with zeros
    return model, values


def _size(data: Mapping[str, Any]) -> tuple[int, int]:
    pair = next((data[key] for key in _SIZE if key in data), None)
    if pair is None:
        pair = [_first(data, keys, "image size") for keys in (_WIDTH, _HEIGHT)]
    width, height = _numbers(pair, "the image size", 2)
    if not (width.is_integer() and height.is_integer()):
        raise InputError(f"the image size {width:g}x{height:g} is not whole", hint=_RECALIBRATE)
    return int(width), int(height)


def _first(data: Mapping[str, Any], keys: tuple[str, ...], what: str) -> Any:
    for key in keys:
        if key in data:
            return data[key]
    raise InputError(f"holds no {what} ('{keys[0]}')", hint=_HINT)


def _numbers(value: Any, what: str, count: int | None = None) -> list[float]:
    """Return the numbers in a list, in nested lists or in a mapping with `data`; `count` of them if that is given."""
    flat = list(_flatten(value.get("data") if isinstance(value, Mapping) else value))
    try:
        # YAML 1.1 reads 1e-05, without a point, as a text
        numbers = [float(v) for v in flat if not isinstance(v, bool)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != len(flat):
        raise InputError(f"{what} holds something that is no number", hint=_RECALIBRATE)
    if count not in (None, len(numbers)):
        raise InputError(f"{what} has {len(numbers)} values where {count} are needed", hint=_RECALIBRATE)
    return numbers


def _flatten(value: Any) -> Iterable[Any]:
    """Yield what is in a list of rows or of values; deeper lists stay what they are, YAML's can hold themselves."""
    for row in value if isinstance(value, list) else [value]:
        yield from row if isinstance(row, list) else [row]


def _ros_matrix(rows: list[list[float]]) -> dict[str, Any]:
    return {"rows": len(rows), "cols": len(rows[0]), "data": [v for row in rows for v in row]}
