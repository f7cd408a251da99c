"""What rounding costs: a model's mean average precision beside that of the float32 model it was made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import onnx

from landtool.detect.detector import Detector, DetectorConfig
from landtool.errors import InputError
from landtool.evaluate.detection import score_detections
from landtool.export.parity import ParityError
from landtool.io.images import PictureError, read_picture
from landtool.io.labels import LabelledImage
from landtool.types import Detection

MOST_LOSS = 0.005  # of mAP50, half a point
_CONF = 0.001  # average precision counts boxes of every score


@dataclass(frozen=True)
class Accuracy:
    """mAP50 and mAP50-95 over labelled pictures, of the float32 model and of the rounded one."""

    pictures: int
    exact_map50: float
    rounded_map50: float
    exact_map50_95: float
    rounded_map50_95: float


def compare_accuracy(
    exact: onnx.ModelProto, rounded: onnx.ModelProto, truth: Iterable[LabelledImage], names: Sequence[str]
) -> Accuracy:
    """Compare two described models on labelled pictures.

    Raises InputError when a picture cannot be read or nothing is labelled; ParityError when rounding costs more than
    `MOST_LOSS` of mAP50.
    """
    labelled = list(truth)
    scores = []
    for model in (exact, rounded):
        score = score_detections(labelled, _found(model, labelled), names, conf=0.25)
        if score.map50 is None or score.map50_95 is None:
            raise InputError("nothing is labelled in the validation pictures", hint="give others with --val")
        scores.append((score.map50, score.map50_95))
    (exact50, exact95), (rounded50, rounded95) = scores
    if exact50 - rounded50 > MOST_LOSS:
        reason = f"rounding costs {100 * (exact50 - rounded50):.2f} points of mAP50 ({exact50:.4f} to {rounded50:.4f})"
        hint = f"at most {100 * MOST_LOSS:g} are allowed; give more pictures like those it will see with --calibration"
        raise ParityError(reason, hint=hint)
    return Accuracy(len(labelled), exact50, rounded50, exact95, rounded95)


def _found(model: onnx.ModelProto, pictures: Sequence[LabelledImage]) -> list[tuple[Detection, ...]]:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "model.onnx"
        file.write_bytes(model.SerializeToString())
        try:
            detector = Detector(DetectorConfig(model=file, conf=_CONF))
        except InputError as error:  # nobody knows the temporary file
            raise InputError(error.reason, hint=error.hint) from error
    return [_detect(detector, picture.path) for picture in pictures]


def _detect(detector: Detector, path: Path) -> tuple[Detection, ...]:
    try:
        return detector.detect(read_picture(path).image)
    except PictureError as error:
        raise InputError(str(error), file=path, hint="replace or remove it") from error
