"""Eight-bit numbers: kernels as int8 a filter, maps as uint8 a tensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landtool.darknet.weights import Floats

Storage = Literal["float32", "float16", "int8"]


@dataclass(frozen=True)
class Scale:
    """What the levels of a uint8 tensor stand for: value = (level - zero) * step."""

    step: float
    zero: int


def scale_between(low: float, high: float) -> Scale:
    """Return the scale whose 256 levels span low to high, and 0, which is a level itself."""
    low, high = min(low, 0.0), max(high, 0.0)
    step = max(high - low, 1e-9) / 255.0
    return Scale(float(np.float32(step)), int(np.clip(round(-low / step), 0, 255)))


def rounded_kernels(kernels: Floats) -> tuple[NDArray[np.int8], Floats]:
    """Return kernels (filters, ...) as levels -127 to 127, and the step of each filter, (filters,) float32."""
    largest = np.abs(kernels).reshape(len(kernels), -1).max(axis=1)
    steps = np.maximum(largest / np.float32(127.0), np.float32(1e-12)).astype(np.float32)
    levels = np.clip(np.rint(kernels / column(steps)), -127, 127)
    return levels.astype(np.int8), steps


def column(values: Floats) -> Floats:
    """Return (filters,) as (filters, 1, 1, 1)."""
    return values[:, None, None, None]
