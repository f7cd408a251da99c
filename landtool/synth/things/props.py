"""What stands or lies about: cones, barrels, pallets, people, parked cars."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from landtool.geometry import Array, Pose
from landtool.synth.mesh import (
    Albedo,
    Mesh,
    Thing,
    ball,
    bar,
    box,
    circle,
    cylinder,
    flat,
    loft,
    panels,
    place,
    rounded,
)
from landtool.synth.things import cars, machines, paint, people, plants, stands
from landtool.synth.things.parts import planks, slab

_BLACK = paint.srgb((32, 32, 33))
_WHITE = paint.srgb((235, 235, 232))


def cone(rng: Generator) -> Thing:
    """Return a traffic cone with one or two white bands."""
    high = float(rng.uniform(0.3, 0.9))
    orange = paint.srgb((240, 86, 22), float(rng.uniform(0.7, 1.1)))
    base = orange if rng.random() < 0.6 else _BLACK
    foot, tip = 0.24 * high + 0.03, 0.03
    cuts = [0.0, 0.3, 0.55, 1.0] if rng.random() < 0.6 else [0.0, 0.3, 0.5, 0.62, 0.8, 1.0]
    parts = [slab(foot * 2.8, foot * 2.8, 0.0, 0.04 * high, base, radius_m=0.15 * foot)]
    ring = circle(1.0, 10)
    for i, (a, b) in enumerate(itertools.pairwise(cuts)):
        radii = [foot + (tip - foot) * t for t in (a, b)]
        levels = [high * (0.04 + 0.96 * t) for t in (a, b)]
        band = _WHITE if i % 2 else orange
        top = _BLACK if i == len(cuts) - 2 else band
        parts.append(loft(flat(ring * radii[0], levels[0]), flat(ring * radii[1], levels[1]), band, top_albedo=top))
    return tuple(parts)


def barrel(rng: Generator) -> Thing:
    """Return a drum, upright or lying."""
    radius, high = float(rng.uniform(0.22, 0.32)), float(rng.uniform(0.6, 0.95))
    albedo = paint.signal(rng) if rng.random() < 0.7 else paint.plain(rng)
    ring = circle(radius, 12)
    body = loft(flat(ring, 0.0), flat(ring, high), albedo)
    if rng.random() < 0.25:
        turn = Pose.from_rotvec(np.array([0.0, 0.0, radius]), np.array([0.0, np.pi / 2.0, 0.0]))
        lying = body.moved(turn)
        # a ring of twelve stands on an edge: put that on the ground
        return (replace(lying, points_m=lying.points_m - (high / 2.0, 0.0, float(lying.points_m[:, 2].min()))),)
    lid = panels([flat(circle(radius * 0.88, 12), high)], [paint.dimmed(albedo, 0.7)])
    bung = panels([flat(circle(0.04, 6), high, x_m=radius * 0.55)], [_BLACK])
    return (body, lid, bung)


def pallet(rng: Generator) -> Thing:
    """Return a pallet: boards with gaps over three bearers, or a stack of boards."""
    wood, length, width = paint.wood(rng), 1.2, float(rng.choice([0.8, 1.0, 1.2]))
    bearers = [box((0.1, width, 0.1), (x, 0.0, 0.05), paint.dimmed(wood, 0.6)) for x in (-0.55, 0.0, 0.55)]
    y = np.linspace(-0.5, 0.5, int(rng.integers(5, 8))) * (width - 0.12)
    high = 0.144
    tops = [np.array([[-length / 2, a - 0.05, high], [length / 2, a - 0.05, high], [length / 2, a + 0.05, high],
                      [-length / 2, a + 0.05, high]]) for a in y]  # fmt: skip
    shades = [paint.dimmed(wood, gain) for gain in (0.8, 1.0, 1.1)]
    boards = panels(tops, [shades[i] for i in rng.integers(0, 3, len(y))])
    return (*bearers, replace(boards, closed=False, casts=True))


def crate(rng: Generator) -> Thing:
    """Return a box, a crate or a block, 0.2 to 1 m."""
    return _turned(rng, stands.crate(rng, float(rng.uniform(0.25, 0.9)), 9.0).thing)


def bollard(rng: Generator) -> Thing:
    """Return a post with a bright band."""
    high, radius = float(rng.uniform(0.5, 1.1)), float(rng.uniform(0.05, 0.12))
    albedo, ring = paint.plain(rng), circle(radius, 8)
    band = _WHITE if rng.random() < 0.5 else paint.signal(rng)
    levels = [0.0, 0.65 * high, 0.85 * high, high]
    return tuple(
        loft(flat(ring, a), flat(ring, b), c)
        for a, b, c in zip(levels[:-1], levels[1:], (albedo, band, albedo), strict=True)
    )


def lamp(rng: Generator) -> Thing:
    """Return a lamp post with one or two arms, 3 to 8 m tall."""
    high, albedo = float(rng.uniform(3.0, 8.0)), paint.plain(rng)
    arms = [1.0] if rng.random() < 0.7 else [1.0, -1.0]
    reach = float(rng.uniform(0.5, 1.6))
    parts = [slab(0.35, 0.35, 0.0, 0.05, paint.dimmed(albedo, 0.8), radius_m=0.1)]
    parts.append(bar((0.0, 0.0, 0.0), (0.0, 0.0, high), 0.14, albedo, end_m=0.09, sides=6))
    for s in arms:
        parts.append(bar((0.0, 0.0, high), (s * reach, 0.0, high + 0.15), 0.07, albedo))
        parts.append(box((0.5, 0.2, 0.1), (s * (reach + 0.2), 0.0, high + 0.17), _WHITE, taper=0.2))
    return tuple(parts)


def bench(rng: Generator) -> Thing:
    """Return a bench, most with a back."""
    wood, metal = paint.wood(rng), paint.plain(rng)
    length = float(rng.uniform(1.2, 2.0))
    parts: list[Mesh] = [box((0.08, 0.42, 0.42), (s * length * 0.4, 0.0, 0.21), metal) for s in (1.0, -1.0)]
    parts.append(box((length, 0.45, 0.03), (0.0, 0.0, 0.43), paint.dimmed(wood, 0.4)))
    parts.append(planks(rng, length, 0.45, 0.445, wood, count=4, gap_m=0.02))
    if rng.random() < 0.6:
        parts += [box((length, 0.03, 0.12), (0.0, -0.24 - 0.03 * i, 0.58 + 0.16 * i), wood) for i in (0, 1)]
    return _turned(rng, tuple(parts))


def tyre(rng: Generator) -> Thing:
    """Return a tyre that lies flat: a dark ring, its hole as dark as shadow."""
    radius, high, rubber = float(rng.uniform(0.25, 0.45)), float(rng.uniform(0.12, 0.25)), paint.rubber(rng)
    ring = circle(radius, 12)
    lower = loft(flat(ring * 0.93, 0.0), flat(ring, high / 2.0), rubber)
    upper = loft(flat(ring, high / 2.0), flat(ring * 0.9, high), paint.dimmed(rubber, 1.2))
    hole = panels([flat(circle(radius * 0.58, 12), high)], [paint.dimmed(rubber, 0.3)])
    return (lower, upper, hole)


def bin_(rng: Generator) -> Thing:
    """Return a bin on wheels, or a round one."""
    albedo = paint.signal(rng) if rng.random() < 0.5 else paint.plain(rng)
    lid = paint.dimmed(albedo, 0.7) if rng.random() < 0.6 else paint.signal(rng)
    if rng.random() < 0.4:
        ring, high = circle(float(rng.uniform(0.18, 0.3)), 10), float(rng.uniform(0.6, 0.9))
        body = loft(flat(ring * 0.85, 0.0), flat(ring, high), albedo)
        return (body, panels([flat(ring * 0.85, high)], [paint.dimmed(albedo, 0.15)]))
    width, depth = float(rng.uniform(0.5, 1.2)), float(rng.uniform(0.5, 0.75))
    high = float(rng.uniform(0.9, 1.15))
    body = loft(
        flat(rounded(depth * 0.8, width * 0.85, 0.05, steps=1), 0.0),
        flat(rounded(depth, width, 0.05, steps=1), high),
        albedo,
    )
    cover = slab(depth + 0.06, width + 0.04, high, high + 0.07, lid, radius_m=0.06, inset_m=0.04)
    return (
        body,
        cover,
        bar((-depth / 2.0 - 0.08, -width * 0.4, high), (-depth / 2.0 - 0.08, width * 0.4, high), 0.04, _BLACK),
    )


def rock(rng: Generator) -> Thing:
    """Return a stone: a lump with a smaller top."""
    size = float(rng.uniform(0.08, 0.6))
    albedo = paint.srgb((128, 122, 112), float(rng.uniform(0.4, 1.4)))
    base = rounded(size * 2.0, size * float(rng.uniform(1.0, 1.8)), size * 0.6, steps=1)
    z = size * float(rng.uniform(0.3, 0.6))
    shift = rng.uniform(-0.1, 0.1, 2) * size
    lower = loft(flat(base * 0.95, 0.0), flat(base, z * 0.5), albedo)
    upper = loft(flat(base, z * 0.5), flat(base * 0.6, z, x_m=float(shift[0]), y_m=float(shift[1])), albedo)
    return (lower, upper)


def hose(rng: Generator) -> Thing:
    """Return a cable or a hose on the ground, 2 to 10 m of bends."""
    width, count = float(rng.uniform(0.015, 0.07)), 26
    heading = np.cumsum(np.cumsum(rng.normal(0.0, 0.12, count))) + rng.uniform(0.0, 6.0)
    step = float(rng.uniform(2.0, 10.0)) / count
    path = np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1) * step, axis=0)
    albedo = paint.signal(rng) if rng.random() < 0.4 else _BLACK
    return (strip(path - path.mean(axis=0), width, 0.7 * width, albedo),)


def manhole(rng: Generator) -> Thing:
    """Return a cover of iron, level with the ground, with its ring and ribs."""
    radius = float(rng.uniform(0.28, 0.4))
    iron = paint.srgb((74, 70, 66), float(rng.uniform(0.5, 1.5)))
    discs = [flat(circle(r * radius, 16), 0.0) for r in (1.1, 1.0, 0.94)]
    ribs = [
        flat(circle(0.1 * radius, 4) + (x * radius, y * radius), 0.0)
        for x in (-0.5, 0.0, 0.5)
        for y in (-0.5, 0.0, 0.5)
    ]
    shades = [paint.dimmed(iron, 1.3), paint.dimmed(iron, 0.4), iron, *[paint.dimmed(iron, 0.6)] * len(ribs)]
    return (panels([*discs, *ribs], shades),)


def bicycle(rng: Generator) -> Thing:
    """Return a bicycle that stands: two thin wheels, the frame, saddle and handlebar."""
    frame = paint.car_paint(rng)
    lines = [
        ((-0.52, 0.34), (-0.08, 0.3)),
        ((-0.08, 0.3), (0.38, 0.82)),
        ((-0.08, 0.3), (-0.22, 0.86)),
        ((0.52, 0.34), (0.36, 0.95)),
    ]
    parts = [_hoop(x, 0.34, 0.045) for x in (-0.52, 0.52)]
    parts += [bar((a[0], 0.0, a[1]), (b[0], 0.0, b[1]), 0.04, frame) for a, b in lines]
    parts.append(box((0.26, 0.14, 0.05), (-0.24, 0.0, 0.9), _BLACK, taper=0.2))
    parts.append(bar((0.34, -0.28, 0.97), (0.34, 0.28, 0.97), 0.035, _BLACK))
    return tuple(parts)


def _hoop(x_m: float, radius_m: float, width_m: float) -> Mesh:
    """Return the tread of a thin wheel about y, whose rim is open."""
    rim, n = circle(radius_m, 10), 10
    ring = np.stack([rim[:, 0] + x_m, np.full(n, width_m / 2.0), rim[:, 1] - float(rim[:, 1].min())], axis=1)
    faces = tuple(np.array([i, (i + 1) % n, n + (i + 1) % n, n + i]) for i in range(n))
    points = np.concatenate([ring, ring - (0.0, width_m, 0.0)])
    return Mesh(points, faces, np.tile(np.array(_BLACK), (n, 1)), closed=False, casts=True)


def parked_car(rng: Generator) -> Thing:
    """Return a car of any kind."""
    build = (cars.sedan, cars.suv, cars.van, cars.pickup)[int(rng.choice(4, p=(0.4, 0.35, 0.12, 0.13)))]
    return build(rng, 1.0, 1.0).thing


def red_car(rng: Generator) -> Thing:
    """Return a red car."""
    red = paint.srgb((190, 26, 24), float(rng.uniform(0.5, 1.2)))
    return (cars.sedan, cars.suv)[int(rng.integers(2))](rng, 1.0, 1.0, body=red).thing


def lorry(rng: Generator) -> Thing:
    """Return a lorry or a trailer."""
    build = (machines.flatbed, machines.trailer)[int(rng.integers(2))]
    side_m = float(rng.uniform(1.2, 2.0))
    return build(rng, side_m, side_m).thing


def lying_person(rng: Generator) -> Thing:
    """Return somebody who lies on the ground."""
    return people.lying(people.person(rng))


def football(rng: Generator) -> Thing:
    """Return a ball."""
    radius = float(rng.uniform(0.1, 0.3))
    mesh = ball(radius, paint.signal(rng), sides=8, rings=5)
    return (replace(mesh, points_m=mesh.points_m + (0.0, 0.0, radius)),)


def pipe(rng: Generator) -> Thing:
    """Return a pipe or a beam on the ground."""
    length, radius = float(rng.uniform(0.6, 4.0)), float(rng.uniform(0.03, 0.2))
    albedo = paint.signal(rng) if rng.random() < 0.4 else paint.wood(rng) if rng.random() < 0.4 else paint.plain(rng)
    tube = cylinder(radius, -length / 2.0, length / 2.0, albedo, sides=8 if rng.random() < 0.6 else 4)
    lying = tube.moved(Pose.from_rotvec(np.zeros(3), np.array([0.0, np.pi / 2.0, 0.0])))
    return (replace(lying, points_m=lying.points_m - (0.0, 0.0, float(lying.points_m[:, 2].min()))),)


def strip(path_m: Array, width_m: float, z_m: float, albedo: Albedo) -> Mesh:
    """Return a band (loose faces) along a path (N, 2), z_m above the ground; it throws a shadow."""
    step = np.gradient(path_m, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    side = np.stack([-step[:, 1], step[:, 0]], axis=1) * (width_m / 2.0)
    n = len(path_m)
    points = np.concatenate([flat(path_m + side, z_m), flat(path_m - side, z_m)])
    faces = tuple(np.array([n + i, n + i + 1, i + 1, i]) for i in range(n - 1))
    return Mesh(points, faces, np.tile(np.array(albedo), (n - 1, 1)), closed=False, casts=True)


def _turned(rng: Generator, thing: Thing) -> Thing:
    return place(thing, Pose.from_rotvec(np.zeros(3), np.array([0.0, 0.0, float(rng.uniform(0.0, 6.3))])))


PROPS: dict[str, Callable[[Generator], Thing]] = {
    "cone": cone,
    "barrel": barrel,
    "pallet": pallet,
    "crate": crate,
    "bollard": bollard,
    "person": people.person,
    "lying_person": lying_person,
    "bush": plants.bush,
    "tuft": plants.tuft,
    "tree": plants.tree,
    "lamp": lamp,
    "bench": bench,
    "parked_car": parked_car,
    "red_car": red_car,
    "lorry": lorry,
    "tyre": tyre,
    "bin": bin_,
    "rock": rock,
    "hose": hose,
    "pipe": pipe,
    "football": football,
    "bicycle": bicycle,
    "manhole": manhole,
}
"""By kind: a maker of things that stand on the ground about the origin."""
