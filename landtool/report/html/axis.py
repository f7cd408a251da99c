"""The axis of a chart: from values to places in the picture, and the numbers written along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array

_STEPS = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class Axis:
    """Values low to high lie at start to end in the picture. log: in equal ratios, low above 0."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def place(self, values: Array) -> Array:
        """Return where values (N,) lie; what is outside is put to the edge, unknown stays unknown."""
        low, high, values = self.low, self.high, np.asarray(values, dtype=np.float64)
        if self.log:
            low, high, values = math.log(low), math.log(high), np.log(np.maximum(values, self.low))
        share = np.clip((values - low) / (high - low), 0.0, 1.0)
        placed: Array = self.start + share * (self.end - self.start)
        return placed

    def ticks(self, about: int = 5) -> list[float]:
        """Return the round values along the axis, about so many."""
        return _log_ticks(self.low, self.high, about) if self.log else _ticks(self.low, self.high, about)


def span(values: Array, *, from_zero: bool = False, log: bool = False) -> tuple[float, float]:
    """Return the ends of an axis that shows values (N,): a little more than they take, never nothing."""
    known = values[np.isfinite(values)]
    if log:
        known = known[known > 0.0]
    if not len(known):
        return (1.0, 10.0) if log else (0.0, 1.0)
    low, high = float(known.min()), float(known.max())
    if log:
        return (low / 1.1, high * 1.1)
    if from_zero:
        return min(0.0, low), 1.06 * high if high > 0.0 else 1.0
    margin = 0.04 * (high - low) or 0.5 * max(abs(high), 1e-3)
    return low - margin, high + margin


def tick_text(value: float) -> str:
    """Return a tick's number as short as it can be."""
    return f"{value + 0.0:.6g}"


def _ticks(low: float, high: float, about: int) -> list[float]:
    raw = (high - low) / max(1, about)
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * next(s for s in _STEPS if s * power >= raw * 0.999)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(k * step, 12) for k in range(first, last + 1)]


def _log_ticks(low: float, high: float, about: int) -> list[float]:
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for marks in ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0)):
        found = [10.0**p * m for p in powers for m in marks if low <= 10.0**p * m <= high]
        if len(found) >= min(3, about):
            return found
    return _ticks(low, high, about)
