"""Targets and detections of a picture as arrays, and how much boxes overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landtool.errors import InputError, UsageError
from landtool.geometry import Array
from landtool.io.labels import LabelledImage
from landtool.types import Detection

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST_BOXES = 100  # of a class in a picture that count, those of the highest score: COCO's maxDets
NOBODY = -1


@dataclass(frozen=True, eq=False)
class PictureBoxes:
    """Truth and detections of one picture as arrays.

    truth, found: (M, 4) and (N, 4) x_min, y_min, x_max, y_max in pixels. truth_class, found_class: (M,) and (N,)
    class ids. crowd: (M,). score: (N,), descending. order: (N,) where each was among the detections given.
    """

    truth: Array
    truth_class: Ints
    crowd: Flags
    found: Array
    found_class: Ints
    score: Array
    order: Ints


def picture_boxes(
    truth: Sequence[LabelledImage], found: Sequence[Sequence[Detection]], names: Sequence[str]
) -> list[PictureBoxes]:
    """Return the boxes of each picture; names: of the classes by their ids. Detections beyond MOST_BOXES are left out.

    Raises ValueError unless there is one sequence of detections a picture, UsageError for a detection of another class,
    InputError for one that is not finite.
    """
    if len(truth) != len(found):
        raise ValueError(f"{len(truth)} pictures, but detections of {len(found)}")
    ids = {name: class_id for class_id, name in enumerate(names)}
    return [_boxes_of(image, boxes, ids) for image, boxes in zip(truth, found, strict=True)]


def iou(found: Array, truth: Array, crowd: Flags) -> Array:
    """Return the intersection over union (N, M) of boxes (N, 4) and (M, 4), 0 where both are empty.

    Over a crowd's box (crowd (M,)) the union is the detection alone: it may show any part of the crowd.
    """
    return paired_iou(found[:, None], truth[None], crowd[None])


def paired_iou(found: Array, truth: Array, crowd: Flags) -> Array:
    """Return the same of boxes (..., 4) and (..., 4) that stand at the same place, crowd (...); shapes broadcast."""
    low = np.maximum(found[..., :2], truth[..., :2])
    high = np.minimum(found[..., 2:], truth[..., 2:])
    shared = np.maximum(high - low, 0.0).prod(axis=-1)
    area = _area(found)
    union = np.where(crowd, area, area + _area(truth) - shared)
    share: Array = np.divide(shared, union, out=np.zeros_like(shared), where=union > 0.0)
    return share


def _boxes_of(image: LabelledImage, found: Sequence[Detection], ids: dict[str, int]) -> PictureBoxes:
    truth = np.array([(b.x_min_px, b.y_min_px, b.x_max_px, b.y_max_px) for b in image.boxes], np.float64)
    values = np.array([(d.x_min_px, d.y_min_px, d.x_max_px, d.y_max_px, d.score) for d in found], np.float64)
    values = values.reshape(-1, 5)
    if not np.isfinite(values).all():
        raise InputError("has a detection that is not finite", file=image.path, hint="the network is broken")
    try:
        classes = np.array([ids[d.label] for d in found], np.int64)
    except KeyError as error:
        hint = f"known: {', '.join(ids)}"
        raise UsageError(f"the detections' class '{error.args[0]}' is none of the dataset's", hint=hint) from None
    order = np.argsort(-values[:, 4], kind="stable")
    order = order[_rank_in_class(classes[order]) < MOST_BOXES]
    return PictureBoxes(
        truth.reshape(-1, 4),
        np.array([box.class_id for box in image.boxes], np.int64),
        np.array([box.crowd for box in image.boxes], np.bool_),
        values[order, :4],
        classes[order],
        values[order, 4],
        order,
    )


def _rank_in_class(classes: Ints) -> Ints:
    """Return how many of the same class stand before each, (N,)."""
    rank = np.zeros(len(classes), np.int64)
    for class_id in np.unique(classes):
        rank[classes == class_id] = np.arange(np.count_nonzero(classes == class_id))
    return rank


def _area(boxes: Array) -> Array:
    area: Array = np.maximum(boxes[..., 2:] - boxes[..., :2], 0.0).prod(axis=-1)
    return area
