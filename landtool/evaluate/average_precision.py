"""Average precision as COCO defines it, by faster-coco-eval: in memory, and quiet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from faster_coco_eval import COCO, COCOeval_faster

from landtool.evaluate.matching import MOST_BOXES, PictureBoxes
from landtool.geometry import Array

IOUS = tuple(float(v) for v in np.linspace(0.5, 0.95, 10))  # 0.50, 0.55 ... 0.95, to the bit as COCO has them


def average_precision(pictures: Sequence[PictureBoxes], classes: int) -> Array:
    """Return the average precision (10, K) at each IoU of IOUS of each of K classes; NaN for one without a target.

    COCO's rules: precision at 101 recalls, up to 100 detections of a class in a picture, targets of every size.
    """
    if not any((~boxes.crowd).any() for boxes in pictures):
        return np.full((len(IOUS), classes), np.nan)
    evaluation = COCOeval_faster(*_as_coco(pictures, classes), "bbox", print_function=_quiet)
    evaluation.params.maxDets = [MOST_BOXES]
    evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0.0, 1e10]], ["all"]
    evaluation.evaluate()
    evaluation.accumulate()
    # (IoU, recall, class, area, most detections); -1 where a class has no target
    precision = np.asarray(evaluation.eval["precision"], np.float64)[:, :, :, 0, 0]
    return np.where(precision[:, 0] < 0.0, np.nan, precision.mean(axis=1))


def _as_coco(pictures: Sequence[PictureBoxes], classes: int) -> tuple[COCO, COCO]:
    """Return truth and detections as the library takes them; its ids count from 1, as 0 means nothing there."""
    truth: list[dict[str, Any]] = []
    found: list[dict[str, Any]] = []
    for image_id, boxes in enumerate(pictures, start=1):
        for k, box in enumerate(_widths(boxes.truth)):
            row = _row(len(truth) + 1, image_id, boxes.truth_class[k], box)
            truth.append({**row, "iscrowd": int(boxes.crowd[k])})
        for k, box in enumerate(_widths(boxes.found)):
            row = _row(len(found) + 1, image_id, boxes.found_class[k], box)
            found.append({**row, "iscrowd": 0, "score": float(boxes.score[k])})
    return _indexed(truth, len(pictures), classes), _indexed(found, len(pictures), classes)


def _widths(edges: Array) -> Array:
    """Return boxes (N, 4) as x, y, width, height."""
    return np.concatenate([edges[:, :2], np.maximum(edges[:, 2:] - edges[:, :2], 0.0)], axis=1)


def _row(row_id: int, image_id: int, class_id: int, box: Array) -> dict[str, Any]:
    area = float(box[2] * box[3])
    return {"id": row_id, "image_id": image_id, "category_id": int(class_id) + 1, "bbox": box.tolist(), "area": area}


def _indexed(annotations: list[dict[str, Any]], pictures: int, classes: int) -> COCO:
    coco = COCO(print_function=_quiet)
    coco.dataset = {
        "images": [{"id": i + 1} for i in range(pictures)],
        "annotations": annotations,
        "categories": [{"id": i + 1, "name": str(i)} for i in range(classes)],
    }
    coco.createIndex()
    return coco


def _quiet(*_: object) -> None:
    """Take the place of the library's print."""
