"""Random pictures with everything in them, and what pycocotools says of them."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pycocotools.coco import COCO  # type: ignore[import-untyped]
from pycocotools.cocoeval import COCOeval  # type: ignore[import-untyped]

from landtool.geometry import Array
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.types import Detection

NAMES = ("pad", "sign", "car")


@dataclass(frozen=True)
class RandomSet:
    """What random pictures are like. boxes: up to so many detections anywhere. tied: scores of few values."""

    seed: int
    pictures: int
    targets: int
    boxes: int
    classes: int
    crowds: float
    tied: bool
    whole: bool

    def draw(self) -> tuple[list[LabelledImage], list[tuple[Detection, ...]]]:
        """Return the pictures and the detections of each."""
        rng = np.random.default_rng(self.seed)
        truth, found = [], []
        for i in range(self.pictures):
            labels = tuple(self._label(rng) for _ in range(rng.integers(0, self.targets + 1)))
            near = [self._near(rng, label) for label in labels for _ in range(rng.integers(0, 4))]
            anywhere = [self._near(rng, self._label(rng)) for _ in range(rng.integers(0, self.boxes + 1))]
            truth.append(LabelledImage(Path(f"{i}.png"), 640, 480, labels))
            found.append(tuple(near + anywhere))
        return truth, found

    def _label(self, rng: np.random.Generator) -> LabelledBox:
        low, size = rng.uniform(0.0, 200.0, 2), rng.uniform(4.0, 120.0, 2)
        if self.whole:  # whole numbers, so that many overlaps are equal, and some equal to a limit
            low, size = 10.0 * np.round(low / 40.0), 10.0 * np.ceil(size / 30.0)
        crowd = bool(rng.random() < self.crowds)
        (x0, y0), (x1, y1) = low.tolist(), (low + size).tolist()
        return LabelledBox(int(rng.integers(self.classes)), x0, y0, x1, y1, crowd)

    def _near(self, rng: np.random.Generator, label: LabelledBox) -> Detection:
        edges = np.array([label.x_min_px, label.y_min_px, label.x_max_px, label.y_max_px])
        shift = rng.normal(0.0, 0.08 * (edges[2:] - edges[:2]).mean(), 4)
        edges = edges + (10.0 * np.round(shift / 5.0) if self.whole else shift)
        score = float(rng.random()) ** 2
        other = int(rng.integers(self.classes)) if rng.random() < 0.1 else label.class_id
        return Detection(NAMES[other], round(score, 1) if self.tied else score, *edges.tolist())


def pycocotools(truth: Sequence[LabelledImage], found: Sequence[Sequence[Detection]], classes: int) -> COCOeval:
    """Return the accumulated evaluation, 100 detections of a class in a picture, targets of every size."""
    with contextlib.redirect_stdout(io.StringIO()):
        evaluation = COCOeval(
            _coco(_labels(truth), len(truth), classes), _coco(_found(found), len(truth), classes), "bbox"
        )
        evaluation.params.maxDets = [100]
        evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0.0, 1e10]], ["all"]
        evaluation.evaluate()
        evaluation.accumulate()
    return evaluation


def coco_ap(evaluation: COCOeval) -> Array:
    """Return the average precision (10, K), NaN for a class without a target."""
    precision = evaluation.eval["precision"][:, :, :, 0, 0]
    return np.where(precision[:, 0] < 0.0, np.nan, precision.mean(axis=1))


def coco_recall(evaluation: COCOeval) -> Array:
    """Return the recall (10, K) if every detection counts, NaN for a class without a target."""
    recall = evaluation.eval["recall"][:, :, 0, 0]
    return np.where(recall < 0.0, np.nan, recall)


def _labels(truth: Sequence[LabelledImage]) -> list[dict[str, Any]]:
    return [
        _row(i, box.class_id, (box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px)) | {"iscrowd": int(box.crowd)}
        for i, image in enumerate(truth, start=1)
        for box in image.boxes
    ]


def _found(found: Sequence[Sequence[Detection]]) -> list[dict[str, Any]]:
    return [
        _row(i, NAMES.index(d.label), (d.x_min_px, d.y_min_px, d.x_max_px, d.y_max_px))
        | {"iscrowd": 0, "score": d.score}
        for i, boxes in enumerate(found, start=1)
        for d in boxes
    ]


def _row(image_id: int, class_id: int, edges: tuple[float, float, float, float]) -> dict[str, Any]:
    x0, y0, x1, y1 = edges
    w, h = max(x1 - x0, 0.0), max(y1 - y0, 0.0)
    return {"image_id": image_id, "category_id": class_id + 1, "bbox": [x0, y0, w, h], "area": w * h}


def _coco(rows: list[dict[str, Any]], pictures: int, classes: int) -> COCO:
    coco = COCO()
    coco.dataset = {
        "images": [{"id": i + 1} for i in range(pictures)],
        "annotations": [{**row, "id": i} for i, row in enumerate(rows, start=1)],
        "categories": [{"id": i + 1, "name": name} for i, name in enumerate(NAMES[:classes])],
    }
    coco.createIndex()
    return coco
