"""Wind over a landing place: a mean and gusts of coloured noise, after Dryden's model at low height."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array

# near the ground the gusts are this share of the mean wind, across it a little less than along, up half of it
_GUST, _GUST_UP = 0.2, 0.1
_SCALE_S, _SCALE_UP_S = 1.4, 0.6
_LARGEST = 2.0  # standard deviations


def wind_mps(
    mean_mps: float, steps: int, dt_s: float, rng: np.random.Generator
) -> tuple[NDArray[np.complex128], Array, complex]:
    """Return the wind on the level as x + iy (steps,), upwards (steps,), and the mean on the level."""
    mean = mean_mps * complex(np.exp(1j * rng.uniform(0.0, 2.0 * np.pi)))
    along, across = (_GUST * mean_mps * coloured(steps, dt_s, _SCALE_S, rng) for _ in range(2))
    up = _GUST_UP * mean_mps * coloured(steps, dt_s, _SCALE_UP_S, rng)
    turn = mean / abs(mean) if mean else 1.0
    return np.asarray(mean + turn * (along + 0.85j * across)), up, mean


def coloured(steps: int, dt_s: float, scale_s: float, rng: np.random.Generator) -> Array:
    """Return noise (steps,) of variance about 1 and correlation time scale_s, bounded, its derivative finite."""
    warm = int(6.0 * scale_s / dt_s)
    white = rng.standard_normal(steps + warm)
    # two equal low-pass filters one after the other: x' = (u - x) / T
    keep = float(np.exp(-2.0 * dt_s / scale_s))
    once = _low_pass(_low_pass(white, keep), keep)[warm:]
    # variance of the pair for white input of variance 1: (1-a)^4 (1+a^2) / (1-a^2)^3
    sigma = np.sqrt((1.0 - keep) ** 4 * (1.0 + keep**2) / (1.0 - keep**2) ** 3)
    bounded: Array = np.clip(once / sigma, -_LARGEST, _LARGEST)
    return bounded


def _low_pass(values: Array, keep: float) -> Array:
    out, last = np.empty_like(values), 0.0
    for i, value in enumerate((values * (1.0 - keep)).tolist()):
        last = keep * last + value
        out[i] = last
    return out
