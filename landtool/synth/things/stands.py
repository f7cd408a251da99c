"""What a pad lies on that has no wheels: boxes, plinths, tables, landing stages, decks of boats."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from landtool.synth.mesh import Albedo, Mesh, Thing, bar, box, flat, loft, panels
from landtool.synth.things import paint
from landtool.synth.things.parts import Body, gear, planks, slab

_CARDBOARD = paint.srgb((178, 136, 88))
_TAPE = paint.srgb((206, 190, 150))


def crate(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a cardboard box, a crate, a metal case or a plinth of stone."""
    length, width = (side_m * float(f) for f in rng.uniform(0.97, 1.6, 2))
    if rng.random() < 0.5:
        width = length
    high = side_m * float(rng.uniform(0.12, 0.9))
    kind = rng.integers(4)
    albedo = (
        paint.dimmed(_CARDBOARD, float(rng.uniform(0.6, 1.2))),
        paint.wood(rng),
        paint.plain(rng),
        paint.plain(rng),
    )[kind]
    parts: list[Mesh] = []
    if kind == 3:  # a plinth has a wider foot
        parts.append(box((length * 1.12, width * 1.12, high * 0.2), (0.0, 0.0, high * 0.1), paint.dimmed(albedo, 0.85)))
        low = high * 0.2
    else:
        low = 0.0
    body = box(
        (length, width, high - low), (0.0, 0.0, (high + low) / 2.0), albedo, taper=float(rng.choice([0.0, 0.0, 0.08]))
    )
    parts.append(body)
    if kind == 0:
        tape = min(0.04 * side_m, 0.05)
        parts.append(planks(rng, length, tape, high, _TAPE, count=1))
    if kind == 1:
        parts.append(planks(rng, length, width, high, albedo, count=int(rng.integers(4, 9)), gap_m=0.015 * side_m))
    return Body((*parts, *_extra(rng, length, width, high, keep_m)), (0.0, 0.0, high), albedo)


def table(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a table, a landing stage or a scaffold: planks or a plate on legs, now and then with a railing."""
    length, width = side_m * float(rng.uniform(1.0, 2.2)), side_m * float(rng.uniform(1.0, 1.6))
    high, thick = side_m * float(rng.uniform(0.3, 0.9)), side_m * 0.04
    top = paint.wood(rng) if rng.random() < 0.7 else paint.plain(rng)
    leg = paint.dimmed(top, 0.6) if rng.random() < 0.5 else paint.plain(rng)
    x, y = length / 2.0 - 0.06 * side_m, width / 2.0 - 0.06 * side_m
    corners = [(x, y), (-x, y), (-x, -y), (x, -y)]
    parts: list[Mesh] = [bar((a, b, 0.0), (a, b, high - thick), 0.06 * side_m, leg) for a, b in corners]
    parts.append(box((length, width, thick), (0.0, 0.0, high - thick / 2.0), paint.dimmed(top, 0.5)))
    parts.append(planks(rng, length, width, high, top, count=int(rng.integers(5, 12)), gap_m=0.012 * side_m))
    if rng.random() < 0.4 and min(length, width) > keep_m + 0.16 * side_m:
        parts += _railing(corners, high, high + side_m * float(rng.uniform(0.2, 0.8)), 0.03 * side_m, paint.plain(rng))
    return Body((*parts, *_extra(rng, length, width, high, keep_m)), (0.0, 0.0, high), top)


def boat(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a boat; the pad lies on the planks of its after deck, behind the cabin."""
    length, width = side_m * float(rng.uniform(2.8, 4.5)), side_m * float(rng.uniform(1.3, 1.9))
    high = side_m * float(rng.uniform(0.4, 0.8))
    hull, deck = paint.car_paint(rng), paint.wood(rng) if rng.random() < 0.7 else paint.plain(rng)
    outline = np.array(
        [[-0.5, -0.5], [0.15, -0.5], [0.35, -0.36], [0.5, -0.06], [0.5, 0.06], [0.35, 0.36], [0.15, 0.5], [-0.5, 0.5]]
    )
    shape = outline * (length, width)
    body = loft(flat(shape * 0.9, 0.0), flat(shape, high), hull, top_albedo=paint.dimmed(hull, 1.1))
    x = -length * 0.5 + 0.08 * side_m + max(side_m, keep_m) * 0.55
    span = length * 0.62
    boards = planks(
        rng,
        span,
        width * 0.92,
        high,
        deck,
        count=int(rng.integers(7, 13)),
        x_m=-length * 0.5 + span / 2.0 + 0.04 * side_m,
    )
    parts: list[Mesh] = [body, boards]
    cabin_x = max(x + keep_m * 0.5 + 0.32 * side_m, length * 0.12)
    white, glass = paint.srgb((228, 228, 224)), paint.glass(rng)
    size = (0.55 * side_m, width * 0.55)
    parts.append(slab(*size, high, high + 0.25 * side_m, white, x_m=cabin_x, radius_m=0.08 * side_m))
    parts.append(
        slab(
            *size,
            high + 0.25 * side_m,
            high + 0.42 * side_m,
            glass,
            x_m=cabin_x,
            radius_m=0.08 * side_m,
            inset_m=0.05 * side_m,
        )
    )
    parts.append(slab(*size, high + 0.42 * side_m, high + 0.46 * side_m, white, x_m=cabin_x, radius_m=0.08 * side_m))
    y = width * 0.48
    if y > keep_m / 2.0 + 0.03 * side_m:
        corners = [(-length * 0.49, y), (-length * 0.49, -y), (length * 0.1, -y), (length * 0.1, y)]
        parts += _railing(
            corners, high, high + 0.35 * side_m, 0.025 * side_m, paint.srgb((190, 192, 194)), open_end=True
        )
    return Body(tuple(parts), (x, 0.0, high), deck)


def _railing(
    corners_m: list[tuple[float, float]],
    low_m: float,
    high_m: float,
    width_m: float,
    albedo: Albedo,
    *,
    open_end: bool = False,
) -> list[Mesh]:
    """Return posts at four corners and the rails between them; open_end leaves the last side out."""
    posts = [bar((x, y, low_m), (x, y, high_m), width_m, albedo) for x, y in corners_m]
    pairs = list(zip(corners_m, corners_m[1:] + corners_m[:1], strict=True))[: 3 if open_end else 4]
    z = high_m - width_m / 2.0
    return posts + [bar((*a, z), (*b, z), width_m, albedo) for a, b in pairs]


def _extra(rng: Generator, length: float, width: float, z: float, keep_m: float) -> Thing:
    """Return something that stands beside the pad where the top has room."""
    room = min((length - keep_m) / 2.0 - 0.02, 0.4)
    if room < 0.05 * keep_m or rng.random() < 0.5:
        return ()
    x = float(rng.choice([-1.0, 1.0])) * (keep_m + room) / 2.0
    y = float(rng.uniform(-0.5, 0.5)) * max(width - room, 0.0)
    if rng.random() < 0.3:
        mark = np.array(
            [
                [x - room / 3, y - room / 3],
                [x + room / 3, y - room / 3],
                [x + room / 3, y + room / 3],
                [x - room / 3, y + room / 3],
            ]
        )
        return (panels([flat(mark, z)], [paint.signal(rng)]),)
    return gear(rng, x, y, z, room * 0.9)
