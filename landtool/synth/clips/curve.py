"""Smooth functions of time: what a platform's speed, heading and sway are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from landtool.geometry import Array


@dataclass(frozen=True)
class Wave:
    """amplitude * sin(rate_radps * t + phase_rad)."""

    amplitude: float
    rate_radps: float
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Ramp:
    """A step of height `rise` between two times, by the polynomial whose first two derivatives end at zero."""

    start_s: float
    end_s: float
    rise: float


@dataclass(frozen=True)
class Curve:
    """base + slope * t + waves + ramps: a function of time with two continuous derivatives, in any unit."""

    base: float = 0.0
    slope: float = 0.0
    waves: tuple[Wave, ...] = ()
    ramps: tuple[Ramp, ...] = ()

    def at(self, t_s: ArrayLike) -> Array:
        """Return the values at times of any shape, seconds."""
        t = np.asarray(t_s, dtype=np.float64)
        value: Array = self.base + self.slope * t
        for wave in self.waves:
            value = value + wave.amplitude * np.sin(wave.rate_radps * t + wave.phase_rad)
        for ramp in self.ramps:
            u = _share(ramp, t)
            # 10 u^3 - 15 u^4 + 6 u^5
            value = value + ramp.rise * u**3 * (10.0 + u * (6.0 * u - 15.0))
        return value

    def rate(self, t_s: ArrayLike) -> Array:
        """Return the first derivative at times of any shape, per second."""
        t = np.asarray(t_s, dtype=np.float64)
        value: Array = np.full_like(t, self.slope)
        for wave in self.waves:
            value = value + wave.amplitude * wave.rate_radps * np.cos(wave.rate_radps * t + wave.phase_rad)
        for ramp in self.ramps:
            u = _share(ramp, t)
            # 30 u^2 (1 - u)^2 du/dt
            value = value + ramp.rise / (ramp.end_s - ramp.start_s) * 30.0 * (u * (1.0 - u)) ** 2
        return value


def _share(ramp: Ramp, t: Array) -> Array:
    share: Array = np.clip((t - ramp.start_s) / (ramp.end_s - ramp.start_s), 0.0, 1.0)
    return share
