"""Whether a filter is as sure of itself as it should be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from landtool.geometry import Array
from landtool.tracking.kalman import chi2_quantile

Confidence = Literal["over_confident", "as_sure_as_it_should_be", "too_careful"]


@dataclass(frozen=True)
class Consistency:
    """The median of the track's NIS against what it is when the filter is as sure of itself as it should be.

    band: 95 % of such medians of so many frames lie in it.
    """

    frames: int
    median: float
    expected: float
    band: tuple[float, float]

    @property
    def confidence(self) -> Confidence:
        """What the filter makes of its own errors."""
        low, high = self.band
        if self.median > high:
            return "over_confident"
        return "too_careful" if self.median < low else "as_sure_as_it_should_be"


def consistency(nis: Array, dof: int) -> Consistency | None:
    """Judge the NIS (N,) of a filter with `dof` numbers a measurement (2 or 4); None where there is none."""
    count = len(nis)
    if not count:
        return None
    from scipy.special import betaincinv  # loaded when it is needed: it takes its time

    # the k-th smallest of N values has Beta(k, N + 1 - k) for its share of the distribution, the median k = (N + 1) / 2
    middle = 0.5 * (count + 1)
    low, high = (chi2_quantile(float(betaincinv(middle, middle, p)), dof) for p in (0.025, 0.975))
    return Consistency(count, float(np.median(nis)), chi2_quantile(0.5, dof), (low, high))
