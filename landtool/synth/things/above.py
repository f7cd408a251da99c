"""What lies on the pad or sticks out over it, and hides a part of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from landtool.geometry import Array, Pose
from landtool.synth.mesh import Thing, bar, circle, cylinder, loose, place
from landtool.synth.things import paint, people
from landtool.synth.things.parts import gear
from landtool.synth.things.props import strip


def above_pad(rng: Generator, side_m: float) -> Thing:
    """Return something in the pad's frame, z > 0, that hides a part of a board of side `side_m`."""
    thing = _KINDS[int(rng.integers(len(_KINDS)))](rng, side_m)
    return place(thing, Pose.from_rotvec(np.zeros(3), np.array([0.0, 0.0, float(rng.uniform(0.0, 2.0 * np.pi))])))


def _cable(rng: Generator, side_m: float) -> Thing:
    bend = np.cumsum(np.cumsum(rng.normal(0.0, 0.05, 24)))
    x = np.linspace(-0.8, 0.8, 24) * side_m
    path = np.stack([x, (bend - bend.mean()) * 0.15 * side_m + rng.uniform(-0.4, 0.4) * side_m], axis=1)
    width = side_m * float(rng.uniform(0.01, 0.03))
    return (strip(path, width, width, paint.signal(rng) if rng.random() < 0.4 else paint.srgb((30, 30, 32))),)


def _strap(rng: Generator, side_m: float) -> Thing:
    y = side_m * float(rng.uniform(-0.45, 0.45))
    path = np.array([[-0.56, y / side_m], [-0.2, y / side_m], [0.2, y / side_m + 0.02], [0.56, y / side_m]]) * side_m
    return (strip(path, side_m * float(rng.uniform(0.03, 0.07)), 0.006 * side_m, paint.signal(rng)),)


def _parcel(rng: Generator, side_m: float) -> Thing:
    x, y = rng.uniform(-0.45, 0.45, 2) * side_m
    return gear(rng, float(x), float(y), 0.001, side_m * float(rng.uniform(0.08, 0.25)))


def _leaf(rng: Generator, side_m: float) -> Thing:
    """Return a few fallen leaves."""
    leaves, albedos = [], []
    for _ in range(int(rng.integers(1, 7))):
        outline = circle(1.0, 8) * (1.0, float(rng.uniform(0.4, 0.7)))
        size = side_m * float(rng.uniform(0.03, 0.08))
        leaves.append(_lying(rng, outline * size, rng.uniform(-0.5, 0.5, 2) * side_m, 0.012 * side_m))
        albedos.append(paint.srgb((150, 96, 34) if rng.random() < 0.6 else (92, 110, 40), float(rng.uniform(0.5, 1.3))))
    return (loose(leaves, albedos, casts=True),)


def _branch(rng: Generator, side_m: float) -> Thing:
    """Return a twig with leaves that hangs over an edge of the pad."""
    bark, green = paint.srgb((86, 68, 50)), paint.srgb((74, 104, 42), float(rng.uniform(0.6, 1.4)))
    z, reach = side_m * float(rng.uniform(0.05, 0.4)), float(rng.uniform(0.0, 0.4))
    start, end = np.array([0.75, 0.0, z * 1.3]) * (side_m, 1.0, 1.0), np.array([-reach * side_m, side_m * 0.1, z])
    spots = [start + (end - start) * t for t in rng.uniform(0.1, 1.0, 14)]
    leaves = [
        _lying(rng, circle(side_m * 0.06, 6) * (1.0, 0.5), spot[:2] + rng.normal(0.0, 0.06, 2) * side_m, float(spot[2]))
        for spot in spots
    ]
    shades = [paint.dimmed(green, gain) for gain in (0.7, 1.0, 1.2)]
    twig = bar(start, end, 0.02 * side_m, bark, end_m=0.006 * side_m)
    return (twig, loose(leaves, [shades[i] for i in rng.integers(0, 3, 14)], casts=True))


def _arm(rng: Generator, side_m: float) -> Thing:
    thing = people.arm_over(rng, 0.75, 0.02)
    shift = np.array([side_m * float(rng.uniform(0.1, 0.45)), side_m * float(rng.uniform(-0.3, 0.3)), 0.0])
    return place(thing, Pose(np.eye(3), shift))


def _pole(rng: Generator, side_m: float) -> Thing:
    """Return a bar across, a stick or a mast beside the pad that leans over it."""
    albedo, width = paint.plain(rng), side_m * float(rng.uniform(0.02, 0.08))
    y = side_m * float(rng.uniform(-0.5, 0.5))
    if rng.random() < 0.5:
        z = width * 0.75 + side_m * float(rng.uniform(0.0, 0.5))
        return (bar((-0.7 * side_m, y, z), (0.7 * side_m, y * 0.4, z), width, albedo, sides=6),)
    foot = (0.62 * side_m, y, 0.001)
    top = (side_m * float(rng.uniform(-0.1, 0.5)), y * 0.5, side_m * float(rng.uniform(0.3, 1.0)))
    return (bar((foot[0], foot[1], width), top, width, albedo, end_m=0.6 * width, sides=6),)


def _can(rng: Generator, side_m: float) -> Thing:
    x, y = rng.uniform(-0.4, 0.4, 2) * side_m
    radius = side_m * float(rng.uniform(0.03, 0.1))
    can = cylinder(radius, 0.001, radius * float(rng.uniform(0.8, 3.0)), paint.signal(rng), sides=10)
    return place((can,), Pose(np.eye(3), np.array([x, y, 0.0])))


def _lying(rng: Generator, outline_m: Array, at_m: Array, z_m: float) -> Array:
    """Return an outline (N, 2) turned, slightly tilted, at a place: (N, 3)."""
    turn, tilt = rng.uniform(0.0, 6.3), rng.uniform(-0.15, 0.15, 2)
    c, s = np.cos(turn), np.sin(turn)
    xy = outline_m @ np.array([[c, s], [-s, c]])
    rise = xy @ tilt
    return np.column_stack([xy + at_m, rise + max(z_m, 0.001 - float(rise.min()))])


_KINDS: tuple[Callable[[Generator, float], Thing], ...] = (_cable, _strap, _parcel, _leaf, _branch, _arm, _pole, _can)
