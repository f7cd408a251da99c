"""COCO's average precision under weights of the pictures, so that its interval needs one matching pass alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from landtool.evaluate.matching import NOBODY, Ints
from landtool.evaluate.set_matching import SetMatches
from landtool.geometry import Array

RECALLS = np.linspace(0.0, 1.0, 101)  # where COCO reads the precision
_AT_ONCE = 1 << 18  # numbers worked on together: they stay in the cache, and memory small


@dataclass(frozen=True, eq=False)
class _Ranking:
    """The detections of one class by score at one IoU.

    hit_picture: (T,) pictures of the right ones. wrong: sparse (T, P), how many wrong ones of each picture stand
    between a right one and the one before it; those after the last change nothing.
    """

    hit_picture: Ints
    wrong: Any


class WeightedPrecision:
    """The detections of P pictures, K classes, ranked once at each of I IoUs."""

    def __init__(self, matches: SetMatches, pictures: int, classes: int) -> None:
        # (K, P): targets of a class in a picture
        self.targets = np.zeros((classes, pictures))
        real = ~matches.crowd
        np.add.at(self.targets, (matches.truth_class[real], matches.truth_picture[real]), 1.0)
        order = np.argsort(-matches.score, kind="stable")
        self._rankings = [
            [_ranking(matches, level, order[matches.found_class[order] == k], pictures) for k in range(classes)]
            for level in range(len(matches.ious))
        ]

    def average(self, weights: Array, levels: Sequence[int]) -> Array:
        """Return the average precision when each picture counts as often as each row of weights (R, P) says.

        levels: which of the IoUs, L places. The result is (L, K, R), NaN where a class has no target then.
        """
        values = np.full((len(levels), len(self.targets), len(weights)), np.nan)
        for row, level in enumerate(levels):
            for k, ranking in enumerate(self._rankings[level]):
                step = max(1, _AT_ONCE // max(len(ranking.hit_picture), 1))
                for start in range(0, len(weights), step):
                    chosen = slice(start, start + step)
                    values[row, k, chosen] = _average(ranking, self.targets[k], weights[chosen])
        return values


def _ranking(matches: SetMatches, level: int, order: Ints, pictures: int) -> _Ranking:
    order = order[~matches.ignored[level, order]]
    right = matches.target[level, order] != NOBODY
    before = np.cumsum(right)
    hits = int(right.sum())
    wrong = ~right & (before < hits)
    where = before[wrong], matches.found_picture[order[wrong]]
    between = csr_array((np.ones(len(where[0])), where), shape=(hits, pictures))
    return _Ranking(matches.found_picture[order[right]], between)


def _average(ranking: _Ranking, targets: Array, weights: Array) -> Array:
    """Return the average precision (R,) of one ranking; targets: (P,)."""
    columns = np.ascontiguousarray(weights.T)
    positives = targets @ columns
    values = np.where(positives > 0.0, 0.0, np.nan)
    if not len(ranking.hit_picture):
        return values
    hits = np.cumsum(columns[ranking.hit_picture], axis=0)
    wrong = np.cumsum(ranking.wrong @ columns, axis=0)
    # p(r) = max over all ranks of recall >= r of hits / (hits + wrong); only a right detection can be the largest
    precision = np.divide(hits, hits + wrong, out=np.zeros_like(hits), where=hits > 0.0)
    best = np.maximum.accumulate(precision[::-1], axis=0)[::-1]
    recall = np.divide(hits, positives, out=np.zeros_like(hits), where=positives > 0.0)
    # AP = 1/101 sum of p(r), r = 0, 0.01 ... 1: each right detection is read at the recalls it is the first to reach
    reached = np.searchsorted(RECALLS, recall, side="right")
    values += (np.diff(reached, axis=0, prepend=0) * best).sum(axis=0) / len(RECALLS)
    return values
