"""Trees and bushes: loose leaves around a dark core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from landtool.geometry import Array, rotation_from_rotvec
from landtool.synth.mesh import Albedo, Mesh, Thing, ball, circle, flat, loft
from landtool.synth.things import paint

_GREENS: tuple[paint.Rgb, ...] = (
    (66, 96, 36),
    (92, 116, 44),
    (48, 78, 40),
    (112, 128, 58),
    (120, 96, 40),
    (150, 84, 34),
)
_BARK = paint.srgb((92, 74, 58))
_CORNERS, _WAYS = 6, 9


def tree(rng: Generator) -> Thing:
    """Return a tree 2.5 to 8 m tall, its crown of leaves around darkness."""
    tall = float(rng.uniform(2.5, 8.0))
    radius, green = tall * float(rng.uniform(0.22, 0.36)), _green(rng)
    middle = np.array([*rng.normal(0.0, 0.05 * tall, 2), tall * 0.68])
    ring = circle(0.025 * tall, 6)
    x, y, z = (float(a) for a in middle)
    trunk = loft(flat(ring, 0.0), flat(0.6 * ring, z, x_m=x, y_m=y), _BARK)
    flat_by = float(rng.uniform(0.7, 1.1))
    core = _core(middle, (0.62 * radius, 0.62 * radius, 0.62 * radius * flat_by), paint.dimmed(green, 0.25))
    return (trunk, core, _crown(rng, middle, radius, flat_by, green, count=200, leaf=0.2))


def bush(rng: Generator) -> Thing:
    """Return a bush 0.3 to 1.4 m tall."""
    tall, green = float(rng.uniform(0.3, 1.4)), _green(rng)
    radius = tall * float(rng.uniform(0.5, 0.9))
    middle, flat_by = np.array([0.0, 0.0, tall * 0.42]), 0.58 * tall / radius
    core = _core(middle, (0.8 * radius, 0.8 * radius, 0.4 * tall), paint.dimmed(green, 0.3))
    return (core, _crown(rng, middle, radius, flat_by, green, count=150, leaf=0.22))


def tuft(rng: Generator) -> Thing:
    """Return a tuft of weeds, at most 0.3 m tall."""
    tall = float(rng.uniform(0.06, 0.3))
    middle = np.array([0.0, 0.0, tall * 0.5])
    leaves = _crown(rng, middle, tall * float(rng.uniform(0.6, 1.2)), 0.3, _green(rng), count=28, leaf=0.3)
    return (replace(leaves, points_m=leaves.points_m - (0.0, 0.0, float(leaves.points_m[:, 2].min()))),)


def crown_shade(rng: Generator, radius_m: float, height_m: float) -> Thing:
    """Return a bare crown at a height, to throw the dappled shadow of a tree."""
    count = int(rng.integers(60, 180))
    middle = np.array([0.0, 0.0, height_m])
    return (_crown(rng, middle, radius_m, 0.5, _green(rng), count=count, leaf=float(rng.uniform(0.08, 0.18))),)


def _green(rng: Generator) -> Albedo:
    gain = float(rng.uniform(0.6, 1.3))
    return paint.srgb(_GREENS[int(rng.choice(len(_GREENS), p=(0.28, 0.24, 0.2, 0.14, 0.08, 0.06)))], gain)


def _core(middle_m: Array, radii_m: Sequence[float] | Array, albedo: Albedo) -> Mesh:
    mesh = ball(1.0, albedo, sides=7, rings=4).stretched(radii_m)
    points = mesh.points_m + middle_m
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    return Mesh(points, mesh.faces, mesh.albedo)


def _crown(
    rng: Generator, middle_m: Array, radius_m: float, flat_by: float, green: Albedo, *, count: int, leaf: float
) -> Mesh:
    """Return leaves on clumps inside a spheroid, the lowest first: brighter above, few albedos and ways to look."""
    clumps = int(rng.integers(5, 9))
    on = rng.normal(size=(clumps, 3))
    on *= 0.55 / np.maximum(np.linalg.norm(on, axis=1, keepdims=True), 1e-9)
    out = rng.normal(size=(count, 3))
    out *= rng.uniform(0.25, 0.48, (count, 1)) / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
    spot = on[rng.integers(0, clumps, count)] + out
    spot = spot[np.argsort(spot[:, 2])]
    size = radius_m * leaf * rng.uniform(0.6, 1.3, (count, 1, 1))
    leaves = _leaves()[rng.integers(0, _WAYS, count)] * size
    leaves += (spot * (radius_m, radius_m, radius_m * flat_by) + middle_m)[:, None, :]
    leaves[..., 2] -= np.minimum(leaves[..., 2].min(axis=1, keepdims=True), 0.0)  # the low ones lie on the ground
    shades = np.array([paint.dimmed(green, gain) for gain in (0.5, 0.85, 1.25)])
    level = np.digitize(spot[:, 2] + rng.normal(0.0, 0.15, count), (-0.15, 0.3))
    return Mesh(leaves.reshape(-1, 3), _leaf_faces(count), shades[level], closed=False, casts=True)


@lru_cache(maxsize=1)
def _leaves() -> Array:
    """Return ragged leaves (ways, corners, 3) of radius 1, one for each way they look."""
    ragged = circle(1.0, _CORNERS) * np.array([1.0, 0.72, 1.05, 0.68, 0.95, 0.8])[:, None]
    level = flat(ragged, 0.0)
    turns = [np.zeros(3)]
    for i in range(_WAYS - 1):
        angle = 2.0 * np.pi * i / (_WAYS - 1)
        turns.append((0.4 if i % 2 else 0.8) * np.array([np.cos(angle), np.sin(angle), 0.0]))
    leaves: Array = np.stack([level @ rotation_from_rotvec(turn).T for turn in turns])
    leaves.setflags(write=False)
    return leaves


@lru_cache(maxsize=16)
def _leaf_faces(count: int) -> tuple[NDArray[np.intp], ...]:
    faces = tuple(np.arange(count * _CORNERS).reshape(count, _CORNERS))
    for face in faces:
        face.setflags(write=False)
    return faces
