"""Anchors found in the labels: k-means by overlap of shapes (Redmon & Farhadi 2017, YOLO9000)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landtool.errors import InputError
from landtool.geometry import Array

Anchors = tuple[tuple[float, float], ...]
_MOST_ROUNDS = 300
_STARTS = 5  # k-means ends in whichever local best is near; the best of a few starts is taken


def kmeans_anchors(sizes: Array, count: int, rng: np.random.Generator) -> tuple[Anchors, float]:
    """Return `count` anchors for sizes (N, 2), by area, in whole pixels, and their mean best IoU.

    The distance is 1 - IoU of two shapes on one centre. Raises InputError when the sizes differ too little for so many.
    """
    different = len(np.unique(sizes, axis=0))
    if different >= count:
        tried = [_rounded(_kmeans(sizes, count, rng)) for _ in range(_STARTS)]
        fit = [float(shape_iou(sizes, anchors).max(axis=1).mean()) for anchors in tried]
        best = int(np.argmax(fit))
        different = len(np.unique(tried[best], axis=0))
    if different < count:
        reason = f"the labels' sizes differ too little: {different} anchors can be told apart, not {count}"
        raise InputError(reason, hint="use the cfg's anchors, or label more targets")
    return tuple((float(w), float(h)) for w, h in tried[best]), fit[best]


def shape_iou(sizes: Array, anchors: Array) -> Array:
    """Return the intersection over union (N, M) of shapes (N, 2) and (M, 2) that share their centre."""
    both = np.minimum(sizes[:, None], anchors[None]).prod(axis=2)
    union: Array = sizes.prod(axis=1)[:, None] + anchors.prod(axis=1)[None] - both
    return np.asarray(both / union, np.float64)


def _kmeans(sizes: Array, count: int, rng: np.random.Generator) -> Array:
    centres = _start(sizes, count, rng)
    nearest = np.full(len(sizes), -1)
    for _ in range(_MOST_ROUNDS):
        overlap = shape_iou(sizes, centres)
        before, nearest = nearest, overlap.argmax(axis=1)
        if (nearest == before).all():
            break
        for index in range(count):
            mine = nearest == index
            # an anchor nobody is nearest to moves to the target that is served worst
            centres[index] = sizes[mine].mean(axis=0) if mine.any() else sizes[overlap.max(axis=1).argmin()]
    return centres


def _start(sizes: Array, count: int, rng: np.random.Generator) -> Array:
    """Draw the first centres among the sizes, each with a chance of its squared distance to those drawn (k-means++)."""
    chosen = [int(rng.integers(len(sizes)))]
    for _ in range(count - 1):
        distance = 1.0 - shape_iou(sizes, sizes[chosen]).max(axis=1)
        chances: NDArray[np.float64] = np.square(np.maximum(distance, 0.0))
        chosen.append(int(rng.choice(len(sizes), p=chances / chances.sum())))
    return sizes[chosen].copy()


def _rounded(centres: Array) -> Array:
    """Return the centres in whole pixels, by area."""
    whole: Array = np.maximum(np.rint(centres), 1.0)
    return whole[np.lexsort((whole[:, 0], whole.prod(axis=1)))]
