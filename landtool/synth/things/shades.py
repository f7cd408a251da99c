"""What is not in the picture but throws its shadow into it: the drone itself, poles, trees."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from landtool.synth.mesh import Mesh, Thing, bar, box, circle, flat, patch
from landtool.synth.things import paint, plants
from landtool.synth.things.parts import slab

_BLACK = paint.srgb((30, 30, 32))


def drone(rng: Generator) -> Thing:
    """Return a multirotor about 0.5 m wide, its middle at the origin: four or six arms, blurred propellers, a body."""
    arms, reach = int(rng.choice([4, 4, 6])), float(rng.uniform(0.2, 0.35))
    blurred = bool(rng.random() < 0.5)  # fast propellers shade like discs, slow ones show their blades
    disc = reach * (0.62 if arms == 4 else 0.46)
    parts: list[Mesh] = [slab(reach * 0.9, reach * 0.6, -0.05, 0.05, _BLACK, radius_m=0.04)]
    parts += [box((reach * 0.7, 0.02, 0.08), (0.0, s * reach * 0.45, -0.09), _BLACK) for s in (1.0, -1.0)]
    for i in range(arms):
        angle = 2.0 * np.pi * (i + 0.5) / arms
        x, y = reach * np.cos(angle), reach * np.sin(angle)
        parts.append(bar((0.0, 0.0, 0.0), (x, y, 0.02), 0.025, _BLACK))
        if blurred:
            rim = flat(circle(disc, 12) * rng.uniform(0.7, 1.0), 0.04, x_m=float(x), y_m=float(y))
            parts.append(patch(rim, _BLACK, casts=True))
        else:
            turn = float(rng.uniform(0.0, np.pi))
            tip = disc * np.array([np.cos(turn), np.sin(turn), 0.0])
            parts.append(bar((x, y, 0.04) - tip, (x, y, 0.04) + tip, 0.03, _BLACK))
    return tuple(parts)


def pole_shade(rng: Generator) -> Thing:
    """Return a mast, a lamp post, a sign or a fence that stands outside of the picture."""
    high, width = float(rng.uniform(2.0, 9.0)), float(rng.uniform(0.05, 0.35))
    parts: list[Mesh] = [bar((0.0, 0.0, 0.0), (0.0, 0.0, high), width, _BLACK, end_m=0.7 * width, sides=6)]
    kind = rng.integers(4)
    if kind == 1:
        parts.append(bar((0.0, 0.0, high), (float(rng.uniform(0.5, 2.0)), 0.0, high), 0.1, _BLACK))
    elif kind == 2:
        size = rng.uniform(0.3, 1.2, 2)
        parts.append(box((0.03, size[0], size[1]), (0.0, 0.0, high), _BLACK))
    elif kind == 3:
        other = (0.0, float(rng.uniform(1.5, 4.0)), 0.0)
        parts.append(bar(other, (0.0, other[1], high), width, _BLACK))
        parts += [bar((0.0, 0.0, z * high), (0.0, other[1], z * high), 0.06, _BLACK) for z in (0.35, 0.65, 0.95)]
    return tuple(parts)


def tree_shade(rng: Generator) -> Thing:
    """Return a tree that stands outside of the picture: a trunk and a crown with holes."""
    radius, high = float(rng.uniform(0.8, 3.0)), float(rng.uniform(2.5, 7.0))
    trunk = bar((0.0, 0.0, 0.0), (0.0, 0.0, high), 0.12 * radius, _BLACK, sides=6)
    return (trunk, *plants.crown_shade(rng, radius, high))
