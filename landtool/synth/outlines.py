"""Outlines of what lies on the ground, polygons (N, 2) in metres: strips, blobs, cracks."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from landtool.geometry import Array
from landtool.synth.mesh import circle


def strip(line_m: ArrayLike, width_m: float) -> Array:
    """Return the outline (2 N, 2) of a strip of even width along a line (N, 2)."""
    line = np.asarray(line_m, dtype=np.float64)
    if len(line) == 2:  # most are straight, and there are hundreds of them
        (x0, y0), (x1, y1) = line.tolist()
        scale = width_m / 2.0 / math.hypot(x1 - x0, y1 - y0)
        ax, ay = (y0 - y1) * scale, (x1 - x0) * scale
        return np.array([[x0 + ax, y0 + ay], [x1 + ax, y1 + ay], [x1 - ax, y1 - ay], [x0 - ax, y0 - ay]])
    return _widened(line, np.full(len(line), width_m / 2.0))


def rectangle(x_m: float, y_m: float, length_m: float, width_m: float) -> Array:
    """Return an upright rectangle (4, 2) about a place, its length along x."""
    x, y, a, b = x_m, y_m, length_m / 2.0, width_m / 2.0
    return np.array([[x - a, y - b], [x + a, y - b], [x + a, y + b], [x - a, y + b]])


def blob(rng: Generator, reach_m: float, radius_m: tuple[float, float]) -> Array:
    """Return an uneven round outline (24, 2)."""
    low, high = radius_m
    radius = float(np.exp(rng.uniform(math.log(low), math.log(high))))
    angle = np.arange(24) * (2.0 * math.pi / 24)
    uneven = np.ones(24)
    for wave in (2, 3, 5):
        uneven += rng.uniform(0.0, 0.5 / wave) * np.sin(wave * angle + rng.uniform(0.0, 2.0 * math.pi))
    outline: Array = rng.uniform(-reach_m, reach_m, 2) + circle(radius, 24) * uneven[:, None] * rng.uniform(0.7, 1.3, 2)
    return outline


def walk(rng: Generator, start: Array, along_rad: float, steps: int, *, bend: float, step_m: float = 0.12) -> Array:
    """Return a line (steps + 1, 2) that wanders."""
    turns = along_rad + np.cumsum(rng.normal(0.0, 0.3 * bend, steps)) + rng.normal(0.0, bend, steps)
    line: Array = start + np.concatenate(
        [np.zeros((1, 2)), np.cumsum(step_m * np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)]
    )
    return line


def crack(rng: Generator, line: Array, width_m: float) -> Array:
    """Return the outline of a crack along a line (N, 2): uneven, and closing at its end."""
    half = width_m / 2.0 * rng.uniform(0.5, 1.4, len(line)) * np.linspace(1.0, 0.3, len(line))
    return _widened(line, half)


def beside(line: Array, distance_m: float) -> Array:
    """Return a line (N, 2) beside another, to its left where the distance is positive."""
    shifted: Array = line + distance_m * _across(line)
    return shifted


def _widened(line: Array, half_m: Array) -> Array:
    """Return the outline (2 N, 2) that keeps half_m (N,) away from a line (N, 2), on both sides."""
    aside = half_m[:, None] * _across(line)
    return np.concatenate([line + aside, (line - aside)[::-1]])


def _across(line: Array) -> Array:
    """Return the unit vectors (N, 2) to the left of a line (N, 2)."""
    way = np.gradient(line, axis=0)
    left: Array = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    return left
