"""Which detection found which target: greedy matching by score, as COCO defines it, at several IoUs in one pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from landtool.evaluate.matching import NOBODY, Flags, Ints, PictureBoxes, paired_iou
from landtool.geometry import Array


@dataclass(frozen=True, eq=False)
class SetMatches:
    """All targets (M) and detections (N) of some pictures, and who belongs to whom at each of I IoUs.

    found, truth: boxes (N, 4) and (M, 4) in pixels, in the order of the pictures; of one picture the highest score
    first. found_picture, truth_picture: which picture each is in. target: (I, N) what each detection found, -1 for
    nothing. ignored: (I, N) detections of a crowd, which count neither way. detection: (I, M) the detection that found
    each target, -1 for a miss; of a crowd always -1. found_iou: (N,) of each detection the largest IoU with anything
    of its class.
    """

    ious: tuple[float, ...]
    found: Array
    found_class: Ints
    found_picture: Ints
    score: Array
    found_iou: Array
    truth: Array
    truth_class: Ints
    truth_picture: Ints
    crowd: Flags
    target: Ints
    ignored: Flags
    detection: Ints

    def pair_iou(self, level: int) -> Array:
        """Return the IoU (N,) of each detection with what it found at the IoU of that place, NaN for those of none."""
        values = np.full(len(self.found), np.nan)
        right = np.flatnonzero(self.target[level] != NOBODY)
        target = self.target[level, right]
        values[right] = paired_iou(self.found[right], self.truth[target], self.crowd[target])
        return values

    def truth_score(self, level: int) -> Array:
        """Return the score (M,) of the detection that found each target at the IoU of that place, -inf for a miss."""
        scores: Array = np.append(self.score, -np.inf)[self.detection[level]]
        return scores


@dataclass(frozen=True, eq=False)
class _Pairs:
    """A detection and a target of the same class in the same picture that overlap, (K,) each."""

    found: Ints
    target: Ints
    iou: Array

    def __getitem__(self, chosen: Ints | Flags) -> _Pairs:
        return _Pairs(self.found[chosen], self.target[chosen], self.iou[chosen])


def match_set(pictures: Sequence[PictureBoxes], ious: Sequence[float]) -> SetMatches:
    """Match every picture as COCO has it: the highest score first, each detection takes the best target left.

    Those of lower scores change nothing for the higher ones, so the matches hold for any least score.
    """
    found = np.concatenate([np.zeros((0, 4)), *(boxes.found for boxes in pictures)])
    truth = np.concatenate([np.zeros((0, 4)), *(boxes.truth for boxes in pictures)])
    crowd = _joined([boxes.crowd for boxes in pictures]).astype(np.bool_)
    classes = _joined([boxes.found_class for boxes in pictures]), _joined([boxes.truth_class for boxes in pictures])
    counts = np.array([[len(boxes.found), len(boxes.truth)] for boxes in pictures], np.int64).reshape(-1, 2)
    which = np.arange(len(pictures))
    found_picture, truth_picture = np.repeat(which, counts[:, 0]), np.repeat(which, counts[:, 1])
    together = _together(found_picture, counts[:, 1])
    same = classes[0][together[0]] == classes[1][together[1]]
    of_found, of_truth = together[0][same], together[1][same]
    pairs = _Pairs(of_found, of_truth, paired_iou(found[of_found], truth[of_truth], crowd[of_truth]))
    found_iou = np.zeros(len(found))
    np.maximum.at(found_iou, pairs.found, pairs.iou)
    # as COCO has it: an IoU of 1 may come out as a little less
    least = np.minimum(np.asarray(ious, np.float64), 1.0 - 1e-10)
    near = pairs[pairs.iou >= least.min(initial=1.0)]
    turn = _turns(near.found, found_picture * (1 + int(classes[0].max(initial=0))) + classes[0])
    target, ignored, detection = _taken(near, turn, least, (len(found), crowd))
    score = np.concatenate([np.zeros(0), *(boxes.score for boxes in pictures)])
    return SetMatches(
        tuple(ious), found, classes[0], found_picture, score, found_iou,
        truth, classes[1], truth_picture, crowd, target, ignored, detection,
    )  # fmt: skip


def _joined(parts: Sequence[Ints | Flags]) -> Ints:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def _together(found_picture: Ints, targets: Ints) -> tuple[Ints, Ints]:
    """Return every detection and target that are in one picture; targets: how many each picture has."""
    each = targets[found_picture]
    found = np.repeat(np.arange(len(found_picture)), each)
    first = np.cumsum(targets) - targets
    within = np.arange(len(found)) - np.repeat(np.cumsum(each) - each, each)
    return found, first[found_picture[found]] + within


def _turns(found: Ints, group: Ints) -> Ints:
    """Return when the detection of each pair (K,) takes its turn: after how many of its own group (N,).

    Only those that are in a pair take one. Detections of different groups do not touch each other's targets, so all of
    one turn are matched at once.
    """
    candidates = np.unique(found)
    order = np.argsort(group[candidates], kind="stable")
    sorted_groups = group[candidates][order]
    first = np.searchsorted(sorted_groups, sorted_groups)
    turn = np.zeros(len(candidates), np.int64)
    turn[order] = np.arange(len(candidates)) - first
    turns: Ints = turn[np.searchsorted(candidates, found)]
    return turns


def _taken(pairs: _Pairs, turn: Ints, least: Array, sizes: tuple[int, Flags]) -> tuple[Ints, Flags, Ints]:
    """Return target, ignored and detection of `SetMatches`; sizes: how many detections, which targets are crowds."""
    count, crowd = sizes
    target = np.full((len(least), count), NOBODY, np.int64)
    ignored = np.zeros((len(least), count), np.bool_)
    detection = np.full((len(least), len(crowd)), NOBODY, np.int64)
    # within a detection the one to take comes last: a target before a crowd, the best overlap, the last of equal ones
    order = np.lexsort((pairs.target, pairs.iou, ~crowd[pairs.target], pairs.found, turn))
    pairs, turn = pairs[order], turn[order]
    ends = np.searchsorted(turn, np.arange(int(turn.max(initial=-1)) + 2))
    for start, end in pairwise(ends.tolist()):
        now = pairs[np.arange(start, end)]
        crowds = crowd[now.target]
        allowed = (now.iou >= least[:, None]) & (crowds | (detection[:, now.target] == NOBODY))
        first = np.flatnonzero(np.diff(now.found, prepend=-1))
        last = np.maximum.reduceat(np.where(allowed, np.arange(end - start), NOBODY), first, axis=1)
        level, column = np.nonzero(last != NOBODY)
        chosen = last[level, column]
        taker, taken = now.found[chosen], now.target[chosen]
        target[level, taker], ignored[level, taker] = taken, crowds[chosen]
        own = ~crowds[chosen]
        detection[level[own], taken[own]] = taker[own]
    return target, ignored, detection
