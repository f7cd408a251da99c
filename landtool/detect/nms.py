"""Non-maximum suppression: of boxes of one class that overlap, the best stays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array

_BLOCK = 256  # boxes tried at a time: once enough stay, the worse ones are never looked at


def suppress(
    boxes: Array, scores: NDArray[np.floating[Any]], classes: NDArray[np.int64], *, iou: float, most: int
) -> NDArray[np.int64]:
    """Return the indices of the boxes that stay, best first, at most `most`.

    Greedy and class by class: the best box stays, those of its class that overlap it by an intersection over union
    above `iou` go, and so on. Of equal scores the first counts as better.
    boxes: (N, 4) x_min, y_min, x_max, y_max. scores, classes: (N,).
    """
    order = np.argsort(-scores, kind="stable")
    kept = np.empty(0, dtype=np.int64)
    for start in range(0, len(order), _BLOCK):
        block = order[start : start + _BLOCK]
        if len(kept) > 0:
            goes = _goes(boxes[kept, None], boxes[None, block], classes[kept, None], classes[None, block], iou)
            block = block[~goes.any(axis=0)]
        kept = np.concatenate([kept, _greedy(boxes, classes, block, iou)])
        if len(kept) >= most:
            break
    return kept[:most]


def _greedy(boxes: Array, classes: NDArray[np.int64], block: NDArray[np.int64], iou: float) -> NDArray[np.int64]:
    """Return those of the indices in `block`, best first, that no better one of them suppresses."""
    goes = _goes(boxes[block, None], boxes[None, block], classes[block, None], classes[None, block], iou)
    there = np.ones(len(block), dtype=np.bool_)
    for index in range(len(block)):
        if there[index]:
            there[index + 1 :] &= ~goes[index, index + 1 :]
    return block[there]


def _goes(
    better: Array, worse: Array, better_class: NDArray[np.int64], worse_class: NDArray[np.int64], iou: float
) -> NDArray[np.bool_]:
    """Return which of the boxes (1, M, 4) each of the better ones (N, 1, 4) suppresses, (N, M)."""
    width = np.minimum(better[..., 2], worse[..., 2]) - np.maximum(better[..., 0], worse[..., 0])
    height = np.minimum(better[..., 3], worse[..., 3]) - np.maximum(better[..., 1], worse[..., 1])
    shared = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    # iou = shared / (area + area - shared); two empty boxes have none
    union = _area(better) + _area(worse) - shared
    overlap = np.divide(shared, union, out=np.zeros_like(shared), where=union > 0.0)
    return np.asarray((overlap > iou) & (better_class == worse_class))


def _area(boxes: Array) -> Array:
    return np.asarray((boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1]))
