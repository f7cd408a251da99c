"""Whether the size of the pad tells anything about the rest of a picture; a detector would learn it if it did."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from landtool.geometry import Array

LIMIT = 0.1  # of a good data set of 1120 pictures; chance alone gives 1 / sqrt(n), 0.03


@dataclass(frozen=True)
class Correlation:
    """How one quantity goes with the logarithm of the pad's size.

    coefficient: in [-1, 1] for numbers, in [0, 1] for kinds, NaN where one of the two never changes. count: pictures.
    """

    name: str
    coefficient: float
    count: int

    @property
    def chance(self) -> float:
        """The standard deviation the coefficient of independent numbers has, 1 / sqrt(count)."""
        return 1.0 / float(np.sqrt(max(self.count, 1)))


def correlations(
    size_px: ArrayLike, numbers: Mapping[str, ArrayLike], kinds: Mapping[str, Sequence[str]]
) -> list[Correlation]:
    """Return how the pad's size (N,) in pixels goes with numbers (N,), which may be NaN, and with kinds (N,).

    Kinds give one coefficient for all of them, and one for each against the rest.

    >>> for c in correlations([1, 10, 1, 10], {"x": [0, 2, 0, 2]}, {"ground": ["sand", "sand", "mud", "mud"]}):
    ...     print(c.name, round(c.coefficient, 3))
    x 1.0
    ground 0.0
    ground mud 0.0
    ground sand 0.0
    """
    size = np.log(np.asarray(size_px, dtype=np.float64))
    found = []
    for name, values in numbers.items():
        value = np.asarray(values, dtype=np.float64)
        both = np.isfinite(size) & np.isfinite(value)
        found.append(Correlation(name, pearson(size[both], value[both]), int(both.sum())))
    known = np.isfinite(size)
    for name, labels in kinds.items():
        label = np.asarray(labels)[known]
        found.append(Correlation(name, correlation_ratio(size[known], label), len(label)))
        found += [
            Correlation(f"{name} {kind}", pearson(size[known], label == kind), len(label)) for kind in np.unique(label)
        ]
    return found


def pearson(a: ArrayLike, b: ArrayLike) -> float:
    """Return Pearson's correlation of two (N,); NaN where one of them never changes.

    >>> pearson([1, 2, 3], [2, 4, 6]), pearson([1, 2, 3], [1, 1, 1])
    (1.0, nan)
    """
    x, y = (_centred(values) for values in (a, b))
    # r = sum(x y) / sqrt(sum(x^2) sum(y^2)) of what differs from the mean
    spread = float(np.sqrt((x @ x) * (y @ y)))
    return float(np.clip(x @ y / spread, -1.0, 1.0)) if spread > 0.0 else np.nan


def correlation_ratio(values: ArrayLike, kinds: ArrayLike) -> float:
    """Return the share of the values' deviation (N,) that their kinds (N,) explain, in [0, 1].

    It is the root of epsilon squared (T. L. Kelley, 1935), 0 where that is negative. The plain ratio, eta squared,
    counts the scatter of the k kinds' means as explained, and the mean of n/k values strays with the k-th part of n of
    their variance even if kinds mean nothing: its expectation is then (k - 1) / (n - 1), so twelve kinds in 950
    pictures give eta = 0.11, the more the smaller n/k is. Epsilon squared takes that part away, and is 0 on average.
    NaN for values that never change, or fewer than two kinds or values a kind.

    >>> correlation_ratio([1, 1, 5, 5], ["a", "a", "b", "b"]), correlation_ratio([1, 5, 1, 5], ["a", "a", "b", "b"])
    (1.0, 0.0)
    """
    value, (names, kind) = _centred(values), np.unique(np.asarray(kinds), return_inverse=True)
    n, k = len(value), len(names)
    total = float(value @ value)
    if k < 2 or n <= k or total <= 0.0:
        return np.nan
    means = np.bincount(kind, value) / np.bincount(kind)
    within = float(np.square(value - means[kind]).sum())
    # epsilon^2 = 1 - (SS_within / (n - k)) / (SS_total / (n - 1))
    return float(np.sqrt(max(0.0, 1.0 - within / (n - k) * (n - 1) / total)))


def _centred(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    centred: Array = array - array.mean() if len(array) else array
    # what rounding leaves of a constant is no spread
    return centred if np.abs(centred).max(initial=0.0) > 1e-12 * np.abs(array).max(initial=0.0) else 0.0 * centred
