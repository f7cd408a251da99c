"""Non-maximum suppression: of boxes of one class that overlap, the best stays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array


def suppress(
    boxes: Array, scores: NDArray[np.floating[Any]], classes: NDArray[np.int64], *, iou: float, most: int
) -> NDArray[np.int64]:
    """Return the indices of the boxes that stay, best first, at most `most`.

    Greedy and class by class: the best box stays, those of its class that overlap it by an intersection over union
    above `iou` go, and so on. Of equal scores the first counts as better.
    boxes: (N, 4) x_min, y_min, x_max, y_max. scores, classes: (N,).
    """
    order = np.argsort(-scores, kind="stable")
    sides = np.ascontiguousarray(boxes[order].T, dtype=np.float64)
    areas = (sides[2] - sides[0]) * (sides[3] - sides[1])
    kinds = classes[order]
    kept: list[int] = []
    while len(order) > 0 and len(kept) < most:
        kept.append(int(order[0]))
        overlap = _overlaps(sides[:, :1], areas[0], sides[:, 1:], areas[1:])
        stays = np.flatnonzero(~((kinds[1:] == kinds[0]) & (overlap > iou))) + 1
        order, sides, areas, kinds = order[stays], sides[:, stays], areas[stays], kinds[stays]
    return np.array(kept, dtype=np.int64)


def _overlaps(box: Array, area: float, others: Array, areas: Array) -> Array:
    """Return the intersection over union of one box (4, 1) with others (4, N); 0 where both are empty."""
    width = np.minimum(box[2], others[2]) - np.maximum(box[0], others[0])
    height = np.minimum(box[3], others[3]) - np.maximum(box[1], others[1])
    shared = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    union = area + areas - shared
    return np.asarray(np.divide(shared, union, out=np.zeros_like(shared), where=union > 0.0))
