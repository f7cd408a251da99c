"""How the pad truly moves in the plane of a reference frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """Places of the pad over time, a row a frame; NaN is unknown.

    t_ns: (N,) rising. places_m: (N, 2) x and y. told_mps: (N, 2) velocities, None where nobody told them.
    """

    t_ns: Array
    places_m: Array
    told_mps: Array | None = None

    @cached_property
    def velocities_mps(self) -> Array:
        """The velocities (N, 2): as told, else slopes of the places; NaN where neither is known."""
        if self.told_mps is not None:
            return self.told_mps
        slopes = np.full(self.places_m.shape, np.nan)
        known = self._known
        if np.count_nonzero(known) > 1:
            slopes[known] = np.gradient(self.places_m[known], self._t_s[known], axis=0)
        return slopes

    def later_m(self, row: int, ahead_s: float) -> Array | None:
        """Return the place (2,) some time after a row, between rows on a straight line; None after the last one."""
        at, known = self._t_s[row] + ahead_s, self._known
        if not known.any() or not at <= self._t_s[known][-1]:
            return None
        return np.array([np.interp(at, self._t_s[known], places) for places in self.places_m[known].T])

    @cached_property
    def _known(self) -> NDArray[np.bool_]:
        known: NDArray[np.bool_] = np.isfinite(self.t_ns) & np.isfinite(self.places_m).all(axis=1)
        return known

    @cached_property
    def _t_s(self) -> Array:
        """Seconds since the first row; in whole nanoseconds a float is exact for a hundred days only."""
        return np.asarray((self.t_ns - self.t_ns[0]) * 1e-9)
