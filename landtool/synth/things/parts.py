"""What bodies are put together from: wheels, windows, planks, gear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from landtool.geometry import Array
from landtool.synth.mesh import Albedo, Mesh, Thing, bar, box, circle, cylinder, flat, loft, panels, rounded
from landtool.synth.things import paint


@dataclass(frozen=True, eq=False)
class Body:
    """Something a pad can lie on, in its own frame: on the ground at z = 0, x forward.

    deck_m: (3,) middle of the free flat part of its top. deck_albedo: of that part.
    """

    thing: Thing
    deck_m: tuple[float, float, float]
    deck_albedo: Albedo


def wheel(x_m: float, y_m: float, radius_m: float, width_m: float, albedo: Albedo, *, sides: int = 10) -> Mesh:
    """Return a tyre on the ground, turning about y, about x and y; faces: left side, tread, right side."""
    rim = circle(radius_m, sides)
    ring = np.stack([rim[:, 0] + x_m, np.full(sides, y_m), rim[:, 1] - float(rim[:, 1].min())], axis=1)
    return loft(ring + (0.0, width_m / 2.0, 0.0), ring - (0.0, width_m / 2.0, 0.0), albedo)


def discs(centres_m: Sequence[tuple[float, float, float]], radii_m: Sequence[float], albedos: Sequence[Albedo]) -> Mesh:
    """Return upright discs, as the outsides of wheels: a disc at y > 0 looks to the left, one at y < 0 to the right.

    At every centre one disc a radius, the largest first, each with its albedo.
    """
    polygons = []
    for radius in radii_m:
        rim = circle(radius, 10)
        for x, y, z in centres_m:
            ring = np.stack([rim[:, 0] + x, np.full(10, y), rim[:, 1] + z], axis=1)
            polygons.append(ring[::-1] if y > 0 else ring)
    return panels(polygons, [albedo for albedo in albedos for _ in centres_m])


def within(quad_m: Array, u: tuple[float, float], v: tuple[float, float]) -> Array:
    """Return the part (4, 3) of a flat quad (4, 3) from u to u along its first edge and v to v along its last."""
    a, b, c, d = quad_m
    s = np.array([[u[0]], [u[1]], [u[1]], [u[0]]])
    t = np.array([[v[0]], [v[0]], [v[1]], [v[1]]])
    part: Array = (a * (1 - s) + b * s) * (1 - t) + (d * (1 - s) + c * s) * t
    return part


def slab(
    length_m: float, width_m: float, z_from_m: float, z_to_m: float, albedo: Albedo, *,
    x_m: float = 0.0, y_m: float = 0.0, radius_m: float = 0.1, inset_m: float = 0.0, steps: int = 1,
) -> Mesh:  # fmt: skip
    """Return an upright block with round corners, narrower at its top by `inset_m` on every side."""
    foot = flat(rounded(length_m, width_m, radius_m, steps=steps), z_from_m, x_m=x_m, y_m=y_m)
    smaller = rounded(length_m - 2 * inset_m, width_m - 2 * inset_m, radius_m, steps=steps)
    return loft(foot, flat(smaller, z_to_m, x_m=x_m, y_m=y_m), albedo)


def planks(
    rng: Generator, length_m: float, width_m: float, z_m: float, albedo: Albedo, *,
    count: int, x_m: float = 0.0, y_m: float = 0.0, gap_m: float = 0.012,
) -> Mesh:  # fmt: skip
    """Return boards side by side along x, seen from above: a few shades of one albedo."""
    edges = np.linspace(-width_m / 2.0, width_m / 2.0, count + 1) + y_m
    shades = [paint.dimmed(albedo, gain) for gain in (0.75, 0.9, 1.0, 1.15)]
    x0, x1 = x_m - length_m / 2.0, x_m + length_m / 2.0
    polygons = [
        np.array([[x0, a, z_m], [x1, a, z_m], [x1, b, z_m], [x0, b, z_m]])
        for a, b in zip(edges[:-1] + gap_m / 2.0, edges[1:] - gap_m / 2.0, strict=True)
    ]
    return panels(polygons, [shades[i] for i in rng.integers(0, 4, count)])


def gear(rng: Generator, x_m: float, y_m: float, z_m: float, size_m: float) -> Thing:
    """Return a bag, a box, a canister or a beacon that stands at (x, y, z) and is at most `size_m` long and wide."""
    kind = rng.integers(5)
    height = float(size_m * rng.uniform(0.4, 1.1))
    if kind == 0:
        ring = circle(size_m / 2.0, 8)
        low, high = z_m + height / 3.0, z_m + height
        foot = loft(flat(ring, z_m, x_m=x_m, y_m=y_m), flat(ring, low, x_m=x_m, y_m=y_m), paint.srgb((30, 30, 30)))
        skirt, crown = (flat(ring * share, z, x_m=x_m, y_m=y_m) for share, z in ((0.8, low), (0.65, high)))
        return (foot, loft(skirt, crown, paint.srgb((236, 150, 20))))
    if kind == 1:
        bag = paint.clothes(rng)
        size = (size_m, size_m * float(rng.uniform(0.5, 1.0)))
        sack = slab(*size, z_m, z_m + height / 2, bag, x_m=x_m, y_m=y_m, radius_m=size_m * 0.3)
        mouth = slab(*size, z_m + height / 2, z_m + height, paint.dimmed(bag, 0.9), x_m=x_m, y_m=y_m,
                    radius_m=size_m * 0.3, inset_m=size_m * 0.15)  # fmt: skip
        return (sack, mouth)
    albedo = paint.plain(rng) if kind < 4 else paint.signal(rng)
    return (
        box((size_m, size_m * float(rng.uniform(0.5, 1.0)), height), (x_m, y_m, z_m + height / 2), albedo, taper=0.05),
    )


def antenna(rng: Generator, x_m: float, y_m: float, z_m: float, scale: float = 1.0) -> Thing:
    """Return a thin whip, or a mushroom on a stalk."""
    black = paint.srgb((30, 30, 32))
    height = scale * float(rng.uniform(0.15, 0.6))
    lean = scale * rng.uniform(-0.05, 0.05, 2)
    whip = bar((x_m, y_m, z_m), (x_m + lean[0], y_m + lean[1], z_m + height), 0.02 * scale, black, end_m=0.01 * scale)
    if rng.random() < 0.6:
        return (whip,)
    cap = cylinder(0.06 * scale, z_m + 0.1 * scale, z_m + 0.15 * scale, paint.srgb((225, 225, 222)), sides=8, taper=0.3)
    stalk = bar((x_m, y_m, z_m), (x_m, y_m, z_m + 0.1 * scale), 0.02 * scale, black)
    return (stalk, replace(cap, points_m=cap.points_m + (x_m, y_m, 0.0)))
