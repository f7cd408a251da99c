"""How well boxes were found in a data set and in the parts of it, with intervals: COCO's averages, recall, alarms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from landtool.evaluate.average_precision import IOUS
from landtool.evaluate.bootstrap import UNDEFINED, Estimate, Resamples
from landtool.evaluate.detection import FOUND_IOU, PrecisionRecall, curve_of
from landtool.evaluate.facts import Facts, parts
from landtool.evaluate.matching import NOBODY, Flags, Ints, picture_boxes
from landtool.evaluate.metric import Metric, metric
from landtool.evaluate.resampled_precision import WeightedPrecision
from landtool.evaluate.set_matching import SetMatches, match_set
from landtool.geometry import Array
from landtool.io.labels import LabelledImage
from landtool.types import Detection

CURVE_POINTS = 500  # of a curve that is kept: more than a plot shows
_OF_TARGETS = ("distance_m", "fog_per_m", "shadow", "blur_px")


@dataclass(frozen=True)
class ScoredPicture:
    """A picture, what is labelled in it, what was found there at any score, and what else is known of it.

    part: of the data set, a split or a clip. file: its name there. frame: of a clip, else None. unit: what is resampled
    as one, of a still its file, of a clip its name and whole second.
    """

    part: str
    file: str
    frame: int | None
    unit: Hashable
    image: LabelledImage
    found: tuple[Detection, ...]
    facts: Facts


def detection_metrics(
    pictures: Sequence[ScoredPicture], names: Sequence[str], *, conf: float, alarm_conf: float
) -> list[Metric]:
    """Return the averages, precision, recall and alarms over all pictures and, where facts are known, over parts.

    names: of the dataset's classes by their ids; detections of others are left out (`unknown_classes` counts them).
    precision, recall, mean_iou: of the detections of at least `conf`, at an IoU of 0.5. false_alarms_per_frame:
    detections of at least `alarm_conf` that found nothing. background_false_alarm_share: of the pictures in which
    nothing is labelled, those with such an alarm. Precision is made of the detections, the rest of the targets, the
    alarms of the pictures.

    Raises InputError for a detection that is not finite.
    """
    return _Scores(pictures, names).metrics(conf, alarm_conf)


def detection_curve(pictures: Sequence[ScoredPicture], names: Sequence[str]) -> PrecisionRecall:
    """Return precision and recall by score at an IoU of 0.5, all classes together, at up to CURVE_POINTS scores.

    Empty without targets or without detections. Raises as `detection_metrics`.
    """
    return thinned(curve_of(matched(pictures, names, (FOUND_IOU,))), CURVE_POINTS)


def unknown_classes(pictures: Sequence[ScoredPicture], names: Sequence[str]) -> dict[str, int]:
    """Return how many detections there are of each class the dataset does not name; they are left out everywhere."""
    known = set(names)
    counted = Counter(d.label for picture in pictures for d in picture.found if d.label not in known)
    return dict(sorted(counted.items()))


def unheard_classes(
    pictures: Sequence[ScoredPicture], names: Sequence[str], model_names: Sequence[str]
) -> dict[str, int]:
    """Return how many targets there are of each class of the dataset that the model does not have; it misses them."""
    boxes = (box for picture in pictures for box in picture.image.boxes if not box.crowd)
    counted = Counter(names[box.class_id] for box in boxes)
    return {name: counted[name] for name in names if counted[name] and name not in set(model_names)}


def class_notes(pictures: Sequence[ScoredPicture], names: Sequence[str], model_names: Sequence[str]) -> list[str]:
    """Return a line for each class that only the model or only the dataset has."""
    left_out = [
        f"detections of '{label}' are left out, as the dataset has no such class: {count}"
        for label, count in unknown_classes(pictures, names).items()
    ]
    missed = [
        f"targets of '{label}' count as missed, as the model has no such class: {count}"
        for label, count in unheard_classes(pictures, names, model_names).items()
    ]
    return left_out + missed


def matched(pictures: Sequence[ScoredPicture], names: Sequence[str], ious: Sequence[float]) -> SetMatches:
    """Return who found what; detections of classes that are not named are left out. Raises as `detection_metrics`."""
    known = set(names)
    found = [[d for d in picture.found if d.label in known] for picture in pictures]
    return match_set(picture_boxes([picture.image for picture in pictures], found, names), ious)


def thinned(curve: PrecisionRecall, most: int) -> PrecisionRecall:
    """Return up to `most` points of a curve, the ends among them, evenly spaced along it."""
    if len(curve.score) <= most:
        return curve
    steps = np.abs(np.diff(curve.recall)) + np.abs(np.diff(curve.precision))
    way = np.concatenate([[0.0], np.cumsum(steps)])
    chosen = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], most - 1)))
    chosen = np.unique(np.append(chosen, len(way) - 1))
    return PrecisionRecall(curve.score[chosen], curve.precision[chosen], curve.recall[chosen])


class _Scores:
    """The metrics of one set of pictures: matched once, resampled once."""

    def __init__(self, pictures: Sequence[ScoredPicture], names: Sequence[str]) -> None:
        self.pictures = pictures
        self.resamples = Resamples([picture.unit for picture in pictures])
        self.matches = matched(pictures, names, IOUS)
        self.precision = WeightedPrecision(self.matches, len(pictures), len(names))
        self.level = IOUS.index(FOUND_IOU)
        # of the targets that count: which picture each is in, and the IoU and score of what found it
        self.real: Ints = np.flatnonzero(~self.matches.crowd)
        self.where: Ints = self.matches.truth_picture[self.real]
        self.score: Array = self.matches.truth_score(self.level)[self.real]
        by = self.matches.detection[self.level, self.real]
        self.iou: Array = np.append(self.matches.pair_iou(self.level), np.nan)[by]

    def metrics(self, conf: float, alarm_conf: float) -> list[Metric]:
        hit = self.score >= conf
        overlap = self.resamples.mean(self.iou[hit], self.where[hit])
        return [
            *self._averages(),
            self._precision(conf),
            metric("detection", "recall", self.resamples.mean(hit, self.where), "higher"),
            metric("detection", "mean_iou", overlap, "higher", of=len(self.real)),
            *self._alarms(alarm_conf),
            *self._averages_by_fog(),
            *self._recalls(hit),
        ]

    def _averages(self) -> Iterator[Metric]:
        everything = np.ones(len(self.pictures), np.bool_)
        table = self._table(range(len(IOUS)), everything)
        places: tuple[tuple[str, Any], ...] = (
            ("map50", self.level),
            ("map50_95", slice(None)),
            ("ap75", IOUS.index(0.75)),
        )
        for name, level in places:
            yield metric("detection", name, self._average(table[level], everything), "higher")

    def _averages_by_fog(self) -> Iterator[Metric]:
        fog = [picture.facts.fog_per_m for picture in self.pictures]
        for name, inside in parts("fog_per_m", fog):
            table = self._table((self.level,), inside)
            estimate = self._average(table, inside)
            if estimate.value is not None:
                yield metric("detection", "map50", estimate, "higher", slice=name)

    def _table(self, levels: Sequence[int], inside: Flags) -> Array:
        """Return the average precision (I, K, 1 + R) of some pictures at some IoUs: as they are, then resampled."""
        drawn = self.resamples.draws[:, self.resamples.unit]
        return self.precision.average(np.vstack([np.ones(len(inside)), drawn]) * inside, levels)

    def _average(self, table: Array, inside: Flags) -> Estimate:
        """Return the mean over the classes and IoUs of a table (..., 1 + R), undefined without a target."""
        flat = table.reshape(-1, table.shape[-1])
        known = np.isfinite(flat)
        count = known.sum(axis=0)
        means = np.divide(
            np.where(known, flat, 0.0).sum(axis=0), count, out=np.full(len(count), np.nan), where=count > 0
        )
        if not count[0]:
            return UNDEFINED
        targets = int(self.precision.targets[:, inside].sum())
        return self.resamples.estimate(float(means[0]), inside, lambda _: means[1:], targets, is_share=True)

    def _precision(self, conf: float) -> Metric:
        matches, level = self.matches, self.level
        taken = (matches.score >= conf) & ~matches.ignored[level]
        right = taken & (matches.target[level] != NOBODY)
        estimate = self.resamples.ratio(self._per_picture(right), self._per_picture(taken))
        return metric("detection", "precision", replace(estimate, count=int(taken.sum())), "higher")

    def _alarms(self, alarm_conf: float) -> Iterator[Metric]:
        matches = self.matches
        alarms = self._per_picture((matches.score >= alarm_conf) & (matches.target[self.level] == NOBODY))
        yield metric("detection", "false_alarms_per_frame", self.resamples.mean(alarms), "lower")
        background = np.array([not picture.image.boxes for picture in self.pictures], np.bool_)
        share = self.resamples.mean(alarms[background] > 0.0, background)
        yield metric("detection", "background_false_alarm_share", share, "lower")
        for name, inside in parts("fog_per_m", [picture.facts.fog_per_m for picture in self.pictures]):
            estimate = self.resamples.mean(alarms[inside], inside)
            yield metric("detection", "false_alarms_per_frame", estimate, "lower", slice=name)

    def _recalls(self, hit: Flags) -> Iterator[Metric]:
        """Yield the recall of every part of the targets; a target's size is that of its own box."""
        boxes = self.matches.truth[self.real]
        sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1, initial=0.0)
        facts = [self.pictures[i].facts for i in self.where]
        values: dict[str, Sequence[float | None]] = {"size_px": sides.tolist()}
        values |= {fact: [getattr(known, fact) for known in facts] for fact in _OF_TARGETS}
        for fact, of_targets in values.items():
            for name, inside in parts(fact, of_targets):
                estimate = self.resamples.mean(hit[inside], self.where[inside])
                yield metric("detection", "recall", estimate, "higher", slice=name)

    def _per_picture(self, chosen: Flags) -> Array:
        """Return how many of the chosen detections (N,) each picture has."""
        return np.bincount(self.matches.found_picture[chosen], minlength=len(self.pictures)).astype(np.float64)
