"""What a track is fed with: places in the reference frame, with their noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from landtool.geometry import Array


@dataclass(frozen=True, eq=False)
class PlanarMeasurement:
    """Where the platform was measured, in the reference frame.

    xy_m: (2,), covariance: (2, 2) in m^2. z_m, z_variance_m2: the same of its height. lever_m: (2, 3), how a constant
    turn of the drone's attitude about its own axes, rad, that its poses don't know of, moves xy_m; in the world only.

    Raises ValueError for values that are not finite, or a covariance that is not positive definite.
    """

    xy_m: Array
    covariance: Array
    z_m: float = 0.0
    z_variance_m2: float = 1.0
    lever_m: Array = field(default_factory=lambda: np.zeros((2, 3)))

    def __post_init__(self) -> None:
        xy_m = np.array(self.xy_m, dtype=np.float64).reshape(2)
        covariance = np.array(self.covariance, dtype=np.float64).reshape(2, 2)
        lever_m = np.array(self.lever_m, dtype=np.float64).reshape(2, 3)
        if not (np.isfinite(xy_m).all() and np.isfinite(covariance).all() and np.isfinite(lever_m).all()):
            raise ValueError("a measured position or its covariance is not finite")
        if np.linalg.eigvalsh(covariance)[0] <= 0:
            raise ValueError("the covariance of a measured position is not positive definite")
        if not (math.isfinite(self.z_m) and math.isfinite(self.z_variance_m2) and self.z_variance_m2 > 0.0):
            raise ValueError("the height of a measured position is not finite or its variance not positive")
        object.__setattr__(self, "xy_m", xy_m)
        object.__setattr__(self, "covariance", 0.5 * (covariance + covariance.T))
        object.__setattr__(self, "lever_m", lever_m)
