"""How sure a number is: resampling whole units, as pictures or seconds of a clip, with replacement.

B. Efron, R. Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 13 (percentile intervals); values of one unit
stay together, as neighbouring frames are not independent of each other.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landtool.geometry import Array

TIMES = 300  # resamples: the ends of a 95 % interval are then off by a tenth of its width
SEED = 0  # the same data give the same interval
TAILS = (2.5, 97.5)  # percentiles of a 95 % interval
FEWEST_UNITS = 5  # of fewer units a bootstrap says more than it knows

_ROUNDING = 1e-12

Units = NDArray[np.int64]


@dataclass(frozen=True)
class Estimate:
    """A value, None where nothing was there to tell it, its 95 % interval and how many values it is made of."""

    value: float | None
    low: float | None
    high: float | None
    count: int

    def scaled(self, factor: float) -> Estimate:
        """Return it in another unit, as 1000 for flips of a thousand."""
        values = (None if v is None else factor * v for v in (self.value, self.low, self.high))
        value, low, high = values
        return Estimate(value, low, high, self.count)


UNDEFINED = Estimate(None, None, None, 0)


class Resamples:
    """The same draws of units for every number of an evaluation.

    units: what each of N values belongs to, in any hashable form (a picture's path, a clip's name and second).
    """

    def __init__(self, units: Sequence[Hashable], times: int = TIMES) -> None:
        numbers: dict[Hashable, int] = {}
        self.unit: Units = np.array([numbers.setdefault(unit, len(numbers)) for unit in units], np.int64)
        self.units = len(numbers)
        rng = np.random.default_rng(SEED)
        # how often each resample (R) holds each unit (U)
        even = np.full(self.units, 1.0 / max(self.units, 1))
        self.draws: Array = rng.multinomial(self.units, even, times).astype(np.float64) if units else np.zeros((0, 0))

    def mean(self, values: ArrayLike, chosen: Any = slice(None)) -> Estimate:
        """Return the mean of values (n,); chosen: indices or mask of which of the N values these are.

        Of truth values it is a share, whose interval has a width even where all are alike.
        """
        asked = np.asarray(values)
        given = asked.astype(np.float64)

        def means(weights: Array) -> Array:
            return _divided(weights @ given, weights.sum(axis=1))

        value = float(given.mean()) if given.size else None
        return self.estimate(value, chosen, means, given.size, is_share=asked.dtype == np.bool_)

    def rms(self, values: ArrayLike, chosen: Any = slice(None)) -> Estimate:
        """Return the root of the mean square of values (n,)."""
        squared = self.mean(np.asarray(values, np.float64) ** 2, chosen)
        return Estimate(_root(squared.value), _root(squared.low), _root(squared.high), squared.count)

    def quantile(self, values: ArrayLike, share: float, chosen: Any = slice(None)) -> Estimate:
        """Return the value that `share` of the values (n,) lie below; 0.5 is the median."""
        given = np.asarray(values, np.float64)
        order = np.argsort(given, kind="stable")
        sorted_values = given[order]

        def quantiles(weights: Array) -> Array:
            mass = np.cumsum(weights[:, order], axis=1)
            place = (mass >= share * mass[:, -1:]).argmax(axis=1)
            return np.where(mass[:, -1] > 0.0, sorted_values[place], np.nan)

        return self.estimate(float(np.quantile(given, share)) if given.size else None, chosen, quantiles, given.size)

    def ratio(self, parts: ArrayLike, wholes: ArrayLike, chosen: Any = slice(None)) -> Estimate:
        """Return sum(parts) / sum(wholes) of n values each, undefined where the wholes are nothing."""
        part, whole = np.asarray(parts, np.float64), np.asarray(wholes, np.float64)
        told = whole > 0.0  # a unit that has nothing of the whole says nothing, and makes no interval narrower
        some = np.arange(len(self.unit))[chosen][told]

        def ratios(weights: Array) -> Array:
            return _divided(weights @ part[told], weights @ whole[told])

        total = float(whole.sum())
        value = float(part.sum()) / total if total else None
        return self.estimate(value, some, ratios, int(whole.size), is_share=True)

    def estimate(
        self,
        value: float | None,
        chosen: Any,
        statistic: Callable[[Array], Array],
        count: int,
        *,
        is_share: bool = False,
    ) -> Estimate:
        """Return a value with the interval of a statistic; none where all resamples say the same.

        statistic: from weights (R, n) of the chosen values to R numbers, NaN where a resample holds none of them.
        is_share: 0 and 1 are none and all of the units, and no resample shows what none of them has shown; the
        interval's other end is then the exact one.
        """
        if value is None:
            return UNDEFINED
        unit = self.unit[chosen]
        units = len(np.unique(unit))
        if units < FEWEST_UNITS:
            return Estimate(value, None, None, count)
        if is_share and min(abs(value), abs(1.0 - value)) < _ROUNDING:
            # C. Clopper, E. Pearson, "The use of confidence or fiducial limits", 1934: (alpha / 2)^(1 / n) for all of n
            least = float(0.025 ** (1.0 / units))
            return Estimate(value, *((0.0, 1.0 - least) if value < 0.5 else (least, 1.0)), count)
        drawn = statistic(self.draws[:, unit])
        drawn = drawn[np.isfinite(drawn)]
        if not drawn.size:
            return Estimate(value, None, None, count)
        low, high = (float(v) for v in np.percentile(drawn, TAILS))
        is_told = low < high or len(drawn) == 1
        return Estimate(value, low, high, count) if is_told else Estimate(value, None, None, count)


def _root(value: float | None) -> float | None:
    return None if value is None else float(np.sqrt(value))


def _divided(parts: Array, wholes: Array) -> Array:
    shares: Array = np.divide(parts, wholes, out=np.full_like(parts, np.nan), where=wholes > 0.0)
    return shares
