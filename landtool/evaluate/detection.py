"""How well boxes were found: COCO's average precision, precision and recall, recall by size, false alarms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from landtool.errors import UsageError
from landtool.evaluate.average_precision import IOUS, average_precision
from landtool.evaluate.matching import NOBODY, PictureBoxes, picture_boxes
from landtool.evaluate.set_matching import SetMatches, match_set
from landtool.geometry import Array
from landtool.io.labels import LabelledImage
from landtool.types import Detection

SIZES_PX = (0.0, 14.0, 20.0, 40.0, 100.0, 300.0, math.inf)  # bounds of the classes of a target's longer side
FOUND_IOU = 0.5  # a target counts as found from here on, outside of the average precision at other IoUs


@dataclass(frozen=True)
class SizeRecall:
    """Of the targets whose longer side is `low_px` or more and under `high_px`, how many were found."""

    low_px: float
    high_px: float
    found: int
    targets: int

    @property
    def recall(self) -> float | None:
        """The share found, None without targets."""
        return _share(self.found, self.targets)


@dataclass(frozen=True)
class FalseAlarm:
    """A detection that found no target, or one that a better detection had found already.

    iou: the largest with a target of its class. background: nothing at all is labelled in the picture.
    """

    path: Path
    detection: Detection
    iou: float
    background: bool


@dataclass(frozen=True, eq=False)
class PrecisionRecall:
    """Precision and recall, (N,) each, if every detection of at least `score` (N,), descending, is taken.

    At an IoU of 0.5, all classes together. Empty without targets or without detections.
    """

    score: Array
    precision: Array
    recall: Array


@dataclass(frozen=True, eq=False)
class DetectionScore:
    """How well the targets of some pictures were found; None is what nothing was there to tell.

    pictures, targets: how many there are, crowds not counted. map50, map50_95: means over the classes that have
    targets. ap_by_iou: the same at each IoU of `IOUS`. ap50_by_class: by class id. precision, recall, mean_iou (of
    those found), sizes: of the detections of at least `conf`, at an IoU of 0.5. false_alarms: of at least `alarm_conf`,
    the highest score first.
    """

    pictures: int
    targets: int
    map50: float | None
    map50_95: float | None
    ap_by_iou: tuple[float | None, ...]
    ap50_by_class: tuple[float | None, ...]
    conf: float
    precision: float | None
    recall: float | None
    mean_iou: float | None
    sizes: tuple[SizeRecall, ...]
    alarm_conf: float
    false_alarms: tuple[FalseAlarm, ...]
    curve: PrecisionRecall

    def recall_from(self, low_px: float) -> float | None:
        """Return the recall of all targets of `low_px` and more, which is one of SIZES_PX."""
        if low_px not in SIZES_PX:
            raise UsageError(f"{low_px:g} px is no bound of a size class", hint=f"bounds: {_listed(SIZES_PX)}")
        chosen = [size for size in self.sizes if size.low_px >= low_px]
        return _share(sum(size.found for size in chosen), sum(size.targets for size in chosen))


def score_detections(
    truth: Sequence[LabelledImage],
    found: Sequence[Sequence[Detection]],
    names: Sequence[str] = ("pad",),
    *,
    conf: float = 0.25,
    alarm_conf: float = 0.5,
) -> DetectionScore:
    """Score the detections of each picture against what is labelled there; names: of the classes, by their ids.

    Give detections of every score (0.001 and more, say): what is left out of them is missing in the average precision.
    Of a class the 100 of the highest score in a picture count.

    Raises ValueError unless there is one sequence of detections a picture, UsageError for a detection of another class
    than those named, InputError for one that is not finite.
    """
    pictures = picture_boxes(truth, found, names)
    matches = match_set(pictures, (FOUND_IOU,))
    ap = average_precision(pictures, len(names))
    by_iou = tuple(_mean(row) for row in ap)
    sizes = _sizes(matches, conf)
    taken = (matches.score >= conf) & ~matches.ignored[0]
    overlap = matches.pair_iou(0)[taken & (matches.target[0] != NOBODY)]
    targets = sum(size.targets for size in sizes)
    return DetectionScore(
        pictures=len(truth),
        targets=targets,
        map50=by_iou[0],
        map50_95=_mean(ap),
        ap_by_iou=by_iou,
        ap50_by_class=tuple(_mean(value) for value in ap[0]),
        conf=conf,
        precision=_share(len(overlap), int(taken.sum())),
        recall=_share(len(overlap), targets),
        mean_iou=_mean(overlap),
        sizes=sizes,
        alarm_conf=alarm_conf,
        false_alarms=_false_alarms(truth, found, pictures, matches, alarm_conf),
        curve=curve_of(matches),
    )


def curve_of(matches: SetMatches) -> PrecisionRecall:
    """Return precision and recall at the first IoU of the matches, a point for every detection."""
    targets = int((~matches.crowd).sum())
    if not targets:
        return PrecisionRecall(np.zeros(0), np.zeros(0), np.zeros(0))
    counted = ~matches.ignored[0]
    score, right = matches.score[counted], matches.target[0, counted] != NOBODY
    order = np.argsort(-score, kind="stable")
    hits = np.cumsum(right[order])
    return PrecisionRecall(score[order], hits / np.arange(1, len(hits) + 1), hits / targets)


def _sizes(matches: SetMatches, conf: float) -> tuple[SizeRecall, ...]:
    real = ~matches.crowd
    side = (matches.truth[:, 2:] - matches.truth[:, :2]).max(axis=1, initial=0.0)[real]
    hit = matches.truth_score(0)[real] >= conf
    inside = [(low, high, (side >= low) & (side < high)) for low, high in pairwise(SIZES_PX)]
    return tuple(SizeRecall(low, high, int(hit[there].sum()), int(there.sum())) for low, high, there in inside)


def _false_alarms(
    truth: Sequence[LabelledImage],
    found: Sequence[Sequence[Detection]],
    pictures: Sequence[PictureBoxes],
    matches: SetMatches,
    conf: float,
) -> tuple[FalseAlarm, ...]:
    first = np.searchsorted(matches.found_picture, np.arange(len(pictures)))
    alarms = []
    for i in np.flatnonzero((matches.score >= conf) & (matches.target[0] == NOBODY)):
        k = matches.found_picture[i]
        detection = found[k][pictures[k].order[i - first[k]]]
        alarms.append(FalseAlarm(truth[k].path, detection, float(matches.found_iou[i]), not truth[k].boxes))
    return tuple(sorted(alarms, key=lambda alarm: -alarm.detection.score))


def _mean(values: Array) -> float | None:
    """Return the mean of those that are numbers, None when there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else None


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


__all__ = [
    "IOUS",
    "SIZES_PX",
    "DetectionScore",
    "FalseAlarm",
    "PrecisionRecall",
    "SizeRecall",
    "curve_of",
    "score_detections",
]
