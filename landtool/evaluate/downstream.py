"""What dehazing is worth to the network: the same pictures in fog, looked at with it and without."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from landtool.evaluate.bootstrap import UNDEFINED, Estimate, Resamples
from landtool.evaluate.detection import FOUND_IOU
from landtool.evaluate.detection_metrics import ScoredPicture, matched
from landtool.evaluate.metric import Metric, metric
from landtool.evaluate.resampled_precision import WeightedPrecision
from landtool.geometry import Array

_Statistic = Callable[[Array], Array]


def downstream_metrics(
    off: Sequence[ScoredPicture], auto: Sequence[ScoredPicture], names: Sequence[str], *, conf: float
) -> list[Metric]:
    """Return recall and mAP50 in fog without dehazing, with it, and the gain, resampled together.

    off, auto: what was found with each; pictures in clear air are left out, and those of `off` must all be in `auto`,
    by part, file and frame. names: of the dataset's classes. conf: least score that counts in the recall. Whether
    there is fog, a picture's facts say. Raises ValueError for a picture that `auto` lacks.
    """
    seen = {_key(picture): picture for picture in auto}
    foggy = [picture for picture in off if (picture.facts.fog_per_m or 0.0) > 0.0]
    missing = [picture.file for picture in foggy if _key(picture) not in seen]
    if missing:
        raise ValueError(f"not looked at with dehazing: {missing[0]}")
    resamples = Resamples([picture.unit for picture in foggy])
    before = _Looked(foggy, names, conf)
    after = _Looked([seen[_key(picture)] for picture in foggy], names, conf)
    return [
        *_compared(resamples, "recall", before.recall, after.recall, before.targets),
        *_compared(resamples, "map50", before.map50, after.map50, before.targets),
    ]


def _key(picture: ScoredPicture) -> tuple[str, str, int | None]:
    return picture.part, picture.file, picture.frame


class _Looked:
    """What was found in P pictures. recall, map50: under weights (R, P) of the pictures (R,), NaN without targets."""

    def __init__(self, pictures: Sequence[ScoredPicture], names: Sequence[str], conf: float) -> None:
        matches = matched(pictures, names, (FOUND_IOU,))
        count = len(pictures)
        real = np.flatnonzero(~matches.crowd)
        where = matches.truth_picture[real]
        score = np.append(matches.score, -np.inf)[matches.detection[0, real]]
        self.targets = len(real)
        self._of = np.bincount(where, minlength=count).astype(np.float64)
        self._hits = np.bincount(where[score >= conf], minlength=count).astype(np.float64)
        self._precision = WeightedPrecision(matches, count, len(names))

    def recall(self, weights: Array) -> Array:
        targets = weights @ self._of
        shares: Array = np.divide(weights @ self._hits, targets, out=np.full_like(targets, np.nan), where=targets > 0.0)
        return shares

    def map50(self, weights: Array) -> Array:
        by_class = self._precision.average(weights, (0,))[0]
        known = np.isfinite(by_class)
        total, count = np.where(known, by_class, 0.0).sum(axis=0), known.sum(axis=0)
        means: Array = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
        return means


def _compared(resamples: Resamples, name: str, off: _Statistic, auto: _Statistic, targets: int) -> Iterator[Metric]:
    """Yield a number without dehazing, with it, and by how much it is more; the same draws for all."""

    def gain(weights: Array) -> Array:
        difference: Array = auto(weights) - off(weights)
        return difference

    yield metric("dehaze", f"{name}_off", _estimate(resamples, off, targets, is_share=True), "neither")
    yield metric("dehaze", f"{name}_auto", _estimate(resamples, auto, targets, is_share=True), "higher")
    yield metric("dehaze", f"{name}_gain", _estimate(resamples, gain, targets), "higher")


def _estimate(resamples: Resamples, statistic: _Statistic, targets: int, *, is_share: bool = False) -> Estimate:
    if not targets:
        return UNDEFINED
    as_they_are = np.ones((1, len(resamples.unit)))
    return resamples.estimate(float(statistic(as_they_are)[0]), slice(None), statistic, targets, is_share=is_share)
