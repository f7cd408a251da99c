"""Score a network on labelled pictures while it is being trained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from landtool.detect.nms import suppress
from landtool.detect.preprocess import InputSpec, Preprocessor
from landtool.evaluate.detection import DetectionScore, score_detections
from landtool.io.labels import LabelledImage
from landtool.train.model import TinyYolo, found_in
from landtool.train.samples import Example
from landtool.types import Detection, Image

_LEAST_SCORE = 0.001  # of a box that counts in the average precision
_MOST_CANDIDATES = 300
_NMS_IOU = 0.45


@dataclass(frozen=True, eq=False)
class Validation:
    """How a network did. found: the boxes of each picture, best first, in OpenCV pixels."""

    score: DetectionScore
    found: tuple[tuple[Detection, ...], ...]


class Validator:
    """Runs networks over the same pictures again and again. names: of the classes."""

    def __init__(self, images: Sequence[LabelledImage], examples: Sequence[Example], names: tuple[str, ...]) -> None:
        self.images, self.names = tuple(images), names
        self.pictures: tuple[Image, ...] = tuple(example.image for example in examples)

    def validate(self, model: TinyYolo, *, bf16: bool) -> Validation:
        """Return how the network does on all pictures, one after the other, whole, as a detector sees them."""
        network = model.network
        spec = InputSpec(preprocess="letterbox" if network.letterbox else "stretch")
        prepare = Preprocessor(spec, np.dtype(np.float32))
        model.eval()
        found = []
        for picture in self.pictures:
            values, placement = prepare.prepare(picture, (network.width, network.height))
            with torch.inference_mode(), torch.autocast("cpu", dtype=torch.bfloat16, enabled=bf16):
                given = torch.from_numpy(values).contiguous(memory_format=torch.channels_last)
                rows = found_in(model, given)[0].T.numpy()
            centre, half, scores = rows[:, :2], rows[:, 2:4] / 2.0, rows[:, 4:]
            boxes = np.hstack([centre - half, centre + half])
            found.append(self._detections(placement.to_picture(boxes), scores))
        return Validation(score_detections(self.images, found, self.names), tuple(found))

    def _detections(self, boxes: np.ndarray, scores: np.ndarray) -> tuple[Detection, ...]:
        row, label = np.nonzero(scores > _LEAST_SCORE)
        best = np.argsort(-scores[row, label], kind="stable")[: 4 * _MOST_CANDIDATES]
        row, label = row[best], label[best]
        kept = suppress(boxes[row], scores[row, label], label, iou=_NMS_IOU, most=_MOST_CANDIDATES)
        return tuple(
            Detection(self.names[label[k]], float(scores[row[k], label[k]]), *map(float, boxes[row[k]])) for k in kept
        )
