"""Patterns that tile the plane: smooth noise, cells, paving, light on a relief. All (n, n) float32."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.synth.grounds.texture import Map

Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Cells:
    """A plane cut into stones.

    number: (n, n) int32 which stone, 0 to count - 1. edge: (n, n) float32 distance to its rim, texels.
    """

    number: Numbers
    edge: Map
    count: int


def value_noise(size: int, first_cells: int, persistence: float, rng: np.random.Generator) -> Map:
    """Return smooth noise (size, size) of mean 0 and standard deviation 1 that tiles the plane.

    Octaves of 1, 2, 4 ... times `first_cells` random values a side are added, each `persistence` times as strong as
    the one before; size and first_cells are powers of two.
    """
    total = np.zeros((size, size), np.float32)
    strength, cells = 1.0, first_cells
    while cells <= size:
        total += np.float32(strength) * enlarged(rng.standard_normal((cells, cells), np.float32), size)
        strength, cells = strength * persistence, cells * 2
    noise: Map = (total - total.mean()) / total.std()
    return noise


def enlarged(values: Map, size: int) -> Map:
    """Return periodic values (n, n) or (n, n, 3), smoothly enlarged to `size`, a multiple of n."""
    n, rim = len(values), 2
    if n == size:
        return values
    wrapped = cv2.copyMakeBorder(values, rim, rim, rim, rim, cv2.BORDER_WRAP)
    scale = size // n
    large = cv2.resize(wrapped, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    return np.asarray(large[rim * scale : -rim * scale, rim * scale : -rim * scale], dtype=np.float32)


def leveled(picture: Map, cells: int) -> Map:
    """Return (n, n, 3) without its changes slower than n / cells texels, which would show as a grid from far away."""
    slow = np.asarray(cv2.resize(picture, (cells, cells), interpolation=cv2.INTER_AREA), dtype=np.float32)
    level: Map = picture - enlarged(slow - slow.mean(axis=(0, 1)), len(picture))
    return level


def blurred(values: Map, sigma: float) -> Map:
    """Return values smoothed by a Gaussian, texels."""
    rim = int(4 * sigma) + 1
    wrapped = cv2.copyMakeBorder(values, rim, rim, rim, rim, cv2.BORDER_WRAP)
    return np.asarray(cv2.GaussianBlur(wrapped, (0, 0), sigma)[rim:-rim, rim:-rim], dtype=np.float32)


def lit(height: Map, angle_rad: float) -> Map:
    """Return how much a relief (texels high) rises towards a light at an angle: slope, 0 where level."""
    down = np.roll(height, -1, axis=0) - np.roll(height, 1, axis=0)
    across = np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)
    slope: Map = np.float32(-0.5) * (np.float32(np.cos(angle_rad)) * across + np.float32(np.sin(angle_rad)) * down)
    return slope


def cells(size: int, side: int, jitter: float, rng: np.random.Generator) -> Cells:
    """Return about side * side stones around random points; jitter 0 is a honeycomb, 1 is wild."""
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2).astype(np.float64)
    grid[:, 0] += 0.5 * (grid[:, 1] % 2)
    points = (grid + jitter * rng.uniform(-0.5, 0.5, grid.shape)) * (size / side)
    column, row = (np.floor(points[:, i]).astype(np.int64) % size for i in (0, 1))
    owners = np.full((size, size), -1, np.int32)
    owners[row, column] = np.arange(len(points), dtype=np.int32)
    rim = int(2.5 * size / side)
    wrapped = cv2.copyMakeBorder(owners, rim, rim, rim, rim, cv2.BORDER_WRAP)
    _, label = cv2.distanceTransformWithLabels(
        (wrapped < 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    seeds = wrapped >= 0
    number_of = np.zeros(int(label.max()) + 1, np.int32)
    number_of[label[seeds]] = wrapped[seeds]
    wide = number_of[label]
    inner = slice(rim, rim + size)
    number = np.ascontiguousarray(wide[inner, inner])
    return Cells(number, _to_rim(wide)[inner, inner], len(points))


def _to_rim(number: Numbers) -> Map:
    """Return every texel's distance to the next texel of another stone."""
    same = np.ones(number.shape, np.uint8)
    same[:, 1:] &= number[:, 1:] == number[:, :-1]
    same[1:] &= number[1:] == number[:-1]
    return np.asarray(cv2.distanceTransform(same, cv2.DIST_L2, cv2.DIST_MASK_5), dtype=np.float32)


def paving(size: int, rows: int, columns: int, wobble: float, rng: np.random.Generator, shift: float = 0.5) -> Cells:
    """Return stones in courses, each course `shift` of a stone beside the one before; wobble: texels they stray."""
    y, x = np.meshgrid(np.arange(size, dtype=np.float32), np.arange(size, dtype=np.float32), indexing="ij")
    if wobble:
        x += np.float32(wobble) * value_noise(size, 16, 0.45, rng)
        y += np.float32(wobble) * value_noise(size, 16, 0.45, rng)
    v = y * np.float32(rows / size)
    course = np.floor(v)
    offsets = (np.arange(rows) * shift + wobble * columns / size * rng.uniform(-1.0, 1.0, rows)).astype(np.float32)
    u = x * np.float32(columns / size) + offsets[course.astype(np.int64) % rows]
    stone = np.floor(u)
    number = ((course % rows) * columns + stone % columns).astype(np.int32)
    u -= stone
    v -= course
    across = np.minimum(u, 1 - u) * np.float32(size / columns)
    down = np.minimum(v, 1 - v) * np.float32(size / rows)
    return Cells(number, np.minimum(across, down), rows * columns)


def smoothstep(low: float, high: float, values: Map) -> Map:
    """Return 0 below low, 1 above high, and a smooth curve between."""
    t = np.clip((values - np.float32(low)) * np.float32(1.0 / (high - low)), 0, 1)
    curve: Map = t * t * (3 - 2 * t)
    return curve
