"""People, as they are seen from above."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from landtool.geometry import Pose
from landtool.synth.mesh import Albedo, Mesh, Thing, bar, box, circle, flat, loft, place, rounded
from landtool.synth.things import paint


def person(rng: Generator) -> Thing:
    """Return somebody who stands, walks, points or raises both arms, 1.55 to 1.95 m tall."""
    tall = float(rng.uniform(1.55, 1.95))
    shirt, trousers = paint.clothes(rng), paint.clothes(rng)
    stride = float(rng.uniform(0.0, 0.35)) if rng.random() < 0.6 else 0.03
    hip, shoulder = 0.5 * tall, 0.81 * tall
    parts = [*_legs(rng, stride, hip, trousers), _torso(rng, hip, shoulder, shirt)]
    parts += _arms(rng, stride, shoulder, shirt)
    return tuple(parts) + _head(rng, shoulder, tall)


def arm_over(rng: Generator, reach_m: float, z_m: float) -> Thing:
    """Return an arm that comes from x = reach_m and ends with the hand near the origin, about z_m high."""
    sleeve, hand = paint.clothes(rng), paint.skin(rng)
    wrist = np.array([0.1, 0.0, z_m + 0.04])
    forearm = bar((reach_m, float(rng.normal(0.0, 0.1)), z_m + 0.25), wrist, 0.11, sleeve, end_m=0.07, sides=6)
    palm = bar(wrist, (0.0, 0.0, z_m + 0.03), 0.08, hand, end_m=0.06)
    spread = [bar((0.0, y, z_m + 0.03), (-0.09, 2.0 * y, z_m + 0.015), 0.02, hand) for y in (-0.025, 0.0, 0.025)]
    return (*spread, palm, forearm)


def _legs(rng: Generator, stride_m: float, hip_m: float, trousers: Albedo) -> list[Mesh]:
    shoe = paint.clothes(rng)
    parts = []
    for s in (1.0, -1.0):
        x = s * stride_m
        parts.append(box((0.27, 0.1, 0.09), (x + 0.06, s * 0.11, 0.045), shoe, taper=0.2))
    for s in (1.0, -1.0):
        parts.append(bar((s * stride_m, s * 0.11, 0.06), (0.0, s * 0.09, hip_m), 0.12, trousers, end_m=0.17))
    return parts


def _torso(rng: Generator, hip_m: float, shoulder_m: float, shirt: Albedo) -> Mesh:
    """Return the trunk: a chest wider across than deep."""
    lean, wide = float(rng.uniform(0.0, 0.08)), float(rng.uniform(0.36, 0.46))
    foot = rounded(0.22, wide * 0.85, 0.11, steps=1)
    top = rounded(0.2, wide, 0.09, steps=1)
    return loft(flat(foot, hip_m - 0.05), flat(top, shoulder_m, x_m=lean), shirt)


def _arms(rng: Generator, stride_m: float, shoulder_m: float, shirt: Albedo) -> list[Mesh]:
    sleeve = shirt if rng.random() < 0.6 else paint.skin(rng)
    pose = rng.random()
    parts = []
    for s in (1.0, -1.0):
        start = np.array([0.03, s * 0.21, shoulder_m - 0.06])
        if pose < 0.65 or (pose < 0.85 and s < 0):  # hangs, and swings against the leg
            end = start + (-s * stride_m * 0.9 + 0.05, s * float(rng.uniform(0.02, 0.15)), -0.55)
        elif pose < 0.85:  # points or waves
            end = start + rng.uniform((-0.1, 0.1, -0.1), (0.55, 0.5, 0.45))
        else:  # holds something before the chest
            end = start + (0.42, -s * 0.12, -0.18)
        parts.append(bar(start, end, 0.1, sleeve, end_m=0.065, sides=4))
    return parts


def _head(rng: Generator, shoulder_m: float, tall_m: float) -> Thing:
    """Return the head with hair, a cap or a helmet."""
    face = paint.skin(rng)
    cover = paint.hair(rng) if rng.random() < 0.7 else paint.signal(rng)
    x, middle = 0.05, tall_m - 0.1
    outline = circle(0.1, 6) * (1.0, 0.8)
    skull = loft(flat(outline * 0.7, shoulder_m - 0.01, x_m=x), flat(outline, middle, x_m=x), face)
    crown = loft(flat(outline, middle, x_m=x), flat(outline * 0.55, tall_m, x_m=x - 0.01), cover)
    return (skull, crown)


def lying(thing: Thing) -> Thing:
    """Return a person who lies on the back: turned about y and put on the ground."""
    fallen = place(thing, Pose.from_rotvec(np.zeros(3), np.array([0.0, -np.pi / 2.0, 0.0])))
    points = np.concatenate([mesh.points_m for mesh in fallen])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    moved = place(fallen, Pose(np.eye(3), np.array([-middle[0], -middle[1], -float(points[:, 2].min())])))
    return tuple(sorted(moved, key=lambda mesh: float(mesh.points_m[:, 2].max())))
