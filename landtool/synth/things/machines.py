"""Machines a pad is built onto: a small lorry, a trailer, a rover with six wheels, a robot on tracks."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from landtool.synth.mesh import Albedo, Mesh, Thing, bar, box, panels, rounded, wedge
from landtool.synth.things import paint
from landtool.synth.things.parts import Body, antenna, discs, gear, planks, slab, wheel, within

_BLACK = paint.srgb((30, 30, 31))
_RED = paint.srgb((190, 24, 22))
_LAMP = paint.srgb((226, 228, 226))


def flatbed(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a lorry; the pad lies on its load bed behind the cab. Small pads get small lorries."""
    scale = side_m / 1.1
    length, width = max(side_m * float(rng.uniform(1.0, 2.2)), keep_m), side_m * float(rng.uniform(1.02, 1.5))
    deck_z, radius = scale * float(rng.uniform(0.6, 0.95)), scale * float(rng.uniform(0.2, 0.28))
    cab_length, gap = scale * float(rng.uniform(0.7, 1.2)), scale * float(rng.uniform(0.06, 0.4))
    whole = length + gap + cab_length
    cab_x, deck_x = (whole - cab_length) / 2.0, (length - whole) / 2.0
    body, floor = paint.car_paint(rng), _floor(rng)
    frame = box(
        (whole * 0.96, width * 0.5, deck_z - radius), (0.0, 0.0, (deck_z + radius) / 2.0 - 0.05 * scale), _BLACK
    )
    axles = [cab_x, deck_x - length * 0.25] + ([deck_x + length * 0.15] if length > 1.6 * side_m else [])
    parts: list[Mesh] = [*_wheels(rng, axles, width / 2.0 - 0.12 * scale, radius, 0.22 * scale), frame]
    low, high = _cab(rng, cab_x, cab_length, width * float(rng.uniform(0.9, 1.02)), deck_z, scale, body)
    parts += low
    if gap > 0.15 * scale:
        x, wide = deck_x + length / 2.0 + gap / 2.0, gap * 0.8
        parts += gear(rng, x, width * 0.28, deck_z * 0.95, wide) + gear(rng, x, -width * 0.25, deck_z * 0.95, wide)
    parts += _deck(rng, length, width, deck_x, deck_z, floor, scale)
    parts += _tail_lamps(deck_x - length / 2.0, width, deck_z, scale)
    shift = float(rng.uniform(-0.5, 0.5)) * max(length - keep_m, 0.0)
    return Body((*parts, *high), (deck_x + shift, 0.0, deck_z), floor)


def trailer(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a trailer with its drawbar in front; the pad lies on its bed, now and then between side boards."""
    scale = side_m / 1.1
    length, width = side_m * float(rng.uniform(1.02, 1.9)), side_m * float(rng.uniform(1.02, 1.3))
    deck_z = scale * float(rng.uniform(0.45, 0.7))
    radius = min(scale * float(rng.uniform(0.2, 0.3)), 0.49 * deck_z)
    floor, metal = _floor(rng), paint.plain(rng)
    axles = [0.0] if length < 1.5 * side_m else [radius * 1.1, -radius * 1.1]
    parts: list[Mesh] = [box((length * 0.95, width * 0.7, deck_z * 0.4), (0.0, 0.0, deck_z * 0.75), _BLACK)]
    parts += _wheels(rng, axles, width / 2.0 + 0.08 * scale, radius, 0.16 * scale)
    tip = (length / 2.0 + scale * float(rng.uniform(0.6, 1.1)), 0.0, deck_z * 0.75)
    parts += [bar((length / 2.0, s * width * 0.35, tip[2]), tip, 0.07 * scale, metal) for s in (1.0, -1.0)]
    parts += [bar((tip[0] - 0.15 * scale, 0.0, 0.0), (tip[0] - 0.15 * scale, 0.0, tip[2]), 0.06 * scale, metal)]
    parts += [*_deck(rng, length, width, 0.0, deck_z, floor, scale), *_tail_lamps(-length / 2.0, width, deck_z, scale)]
    parts += (
        [
            box((length * 0.4, 0.18 * scale, 0.03), (0.0, s * (width / 2.0 + 0.1 * scale), 2 * radius + 0.03), metal)
            for s in (1.0, -1.0)
        ]
        if deck_z > 2 * radius + 0.05
        else []
    )
    if rng.random() < 0.4 and min(length, width) > keep_m:
        parts += _boards(length, width, deck_z, scale * float(rng.uniform(0.1, 0.35)), paint.plain(rng))
    return Body(tuple(parts), (0.0, 0.0, deck_z), floor)


def rover6(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a robot with six wheels; its whole top is the deck."""
    scale = side_m / 1.1
    length, width = side_m * float(rng.uniform(0.98, 1.25)), side_m * float(rng.uniform(0.96, 1.12))
    radius, deck_z = scale * float(rng.uniform(0.13, 0.22)), scale * float(rng.uniform(0.45, 0.75))
    body, deck = paint.signal(rng) if rng.random() < 0.5 else paint.car_paint(rng), _plate_colour(rng)
    track = width * float(rng.uniform(0.46, 0.58))
    axles = [float(x) for x in np.array([-0.4, 0.0, 0.4]) * length * float(rng.uniform(0.85, 1.15))]
    parts: list[Mesh] = [*_wheels(rng, axles, track, radius, 0.16 * scale)]
    hull = deck_z - 0.04 * scale
    parts.append(slab(length * 0.86, width * 0.74, radius * 0.8, hull * 0.7, _BLACK, radius_m=0.06 * scale))
    parts.append(slab(length * 0.92, width * 0.8, hull * 0.7, hull, body, radius_m=0.08 * scale, inset_m=0.02 * scale))
    parts.append(_lamps(length * 0.47, width * 0.28, hull * 0.9, 0.08 * scale, _LAMP, ahead=True))
    parts += _bumpers(rng, length, width, hull * 0.6, deck_z, keep_m, scale, body)
    parts.append(slab(length, width, hull, deck_z, deck, radius_m=scale * float(rng.choice([0.01, 0.06]))))
    parts += _mast(rng, length / 2.0, width, deck_z, keep_m, scale)
    return Body(tuple(parts), (0.0, 0.0, deck_z), deck)


def tracked(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a robot on two tracks that stand out beside its deck."""
    scale = side_m / 1.1
    length, width = side_m * float(rng.uniform(1.0, 1.25)), side_m * float(rng.uniform(0.98, 1.1))
    high, wide = scale * float(rng.uniform(0.25, 0.4)), scale * float(rng.uniform(0.18, 0.3))
    deck_z = high + scale * float(rng.uniform(0.02, 0.25))
    body, deck = paint.signal(rng) if rng.random() < 0.4 else paint.plain(rng), _plate_colour(rng)
    parts: list[Mesh] = []
    long, rubber = length * float(rng.uniform(1.05, 1.25)), paint.rubber(rng)
    for s in (1.0, -1.0):
        parts += _track(long, s * (width / 2.0 + wide * 0.25), wide, high, rubber)
    parts.append(
        box((length * 0.95, width * 0.8, deck_z - 0.1 * scale), (0.0, 0.0, (deck_z + 0.1 * scale) / 2.0), body)
    )
    parts += _bumpers(rng, length, width * 0.7, high * 0.8, deck_z, keep_m, scale, body)
    parts.append(slab(length, width, deck_z - 0.03 * scale, deck_z, deck, radius_m=0.03 * scale))
    parts += _mast(rng, length / 2.0, width, deck_z, keep_m, scale)
    return Body(tuple(parts), (0.0, 0.0, deck_z), deck)


def _floor(rng: Generator) -> Albedo:
    return paint.wood(rng) if rng.random() < 0.4 else paint.plain(rng) if rng.random() < 0.6 else paint.car_paint(rng)


def _plate_colour(rng: Generator) -> Albedo:
    return paint.signal(rng) if rng.random() < 0.5 else paint.plain(rng)


def _wheels(rng: Generator, axles_m: list[float], y_m: float, radius_m: float, width_m: float) -> list[Mesh]:
    """Return pairs of tyres whose middle is at +-y, and their hubs."""
    tyre, hub = paint.rubber(rng), paint.plain(rng)
    spots = [(x, s * (y_m + width_m / 2.0 + 0.003), radius_m) for x in axles_m for s in (1.0, -1.0)]
    tyres = [
        wheel(x, s * y_m, radius_m, width_m, tyre, sides=8 if len(axles_m) < 3 else 7)
        for x in axles_m
        for s in (1.0, -1.0)
    ]
    return [*tyres, discs(spots, (radius_m * 0.55,), (hub,))]


def _deck(rng: Generator, length: float, width: float, x: float, z: float, floor: Albedo, scale: float) -> list[Mesh]:
    """Return a load bed whose top is at z: bare, planked, or with a rim of another colour."""
    edge = floor if rng.random() < 0.4 else paint.car_paint(rng)
    parts = [box((length, width, 0.12 * scale), (x, 0.0, z - 0.06 * scale), edge)]
    rim = scale * float(rng.uniform(0.02, 0.06))
    count = int(rng.integers(5, 10)) if rng.random() < 0.6 else 1
    return [*parts, planks(rng, length - 2 * rim, width - 2 * rim, z, floor, count=count, x_m=x, gap_m=0.012 * scale)]


def _tail_lamps(x_m: float, width_m: float, z_m: float, scale: float) -> list[Mesh]:
    return [_lamps(x_m, width_m * 0.38, z_m - 0.07 * scale, 0.1 * scale, _RED, ahead=False)]


def _lamps(x_m: float, y_m: float, z_m: float, half_m: float, albedo: Albedo, *, ahead: bool) -> Mesh:
    """Return a pair of lamps at +-y on a front or a back, leaning so that they are seen from above."""
    rims = []
    for y in (y_m, -y_m):
        foot, top = (x_m + (0.06 if ahead else -0.06) * half_m * 10, z_m - half_m), (x_m, z_m)
        rim = [
            (foot[0], y - half_m, foot[1]),
            (foot[0], y + half_m, foot[1]),
            (top[0], y + half_m, top[1]),
            (top[0], y - half_m, top[1]),
        ]
        rims.append(np.array(rim if ahead else rim[::-1]))
    return panels(rims, [albedo, albedo])


def _boards(length: float, width: float, z: float, high: float, albedo: Albedo) -> list[Mesh]:
    """Return four side boards on the rim of a bed."""
    t = 0.03
    sides = [box((length + 2 * t, t, high), (0.0, s * (width + t) / 2.0, z + high / 2.0), albedo) for s in (1.0, -1.0)]
    ends = [box((t, width, high), (s * (length + t) / 2.0, 0.0, z + high / 2.0), albedo) for s in (1.0, -1.0)]
    return [*sides, *ends]


def _cab(
    rng: Generator, x: float, length: float, width: float, deck_z: float, scale: float, body: Albedo
) -> tuple[list[Mesh], list[Mesh]]:
    """Return the driver's cab up to the deck, which is painted before the deck, and above it, with windows and roof."""
    foot, belt = deck_z * 0.45, deck_z + scale * float(rng.uniform(0.03, 0.3))
    top = belt + scale * float(rng.uniform(0.3, 0.7))
    front, back, half = x + length / 2.0, x - length / 2.0, width / 2.0
    lower, middle = (
        slab(length, width, a, b, body, x_m=x, radius_m=0.15 * scale) for a, b in ((foot, deck_z), (deck_z, belt))
    )
    lean, tuck = scale * float(rng.uniform(0.05, 0.3)), 0.05 * scale
    profile = [(back + tuck, belt), (front - tuck, belt), (front - tuck - lean, top), (back + 1.5 * tuck, top)]
    house = wedge(profile, half - tuck, half - 2.0 * tuck, body)
    glass, n = paint.glass(rng), 4
    right, left = house.points_m[n:], house.points_m[:n][::-1]
    shield = within(house.points_m[house.faces[2]], (0.12, 0.9), (0.07, 0.93))
    windows = panels(
        [shield, within(right, (0.4, 0.9), (0.1, 0.85)), within(left, (0.4, 0.9), (0.15, 0.9))], [glass] * 3
    )
    roof = slab(
        length - 2.4 * tuck - lean,
        width - 4 * tuck,
        top,
        top + 0.05 * scale,
        body,
        x_m=(back + front + 0.5 * tuck - lean) / 2.0,
        radius_m=0.12 * scale,
        inset_m=0.04 * scale,
        steps=2,
    )
    lamps = _lamps(front, half * 0.72, foot + 0.2 * scale, 0.1 * scale, _LAMP, ahead=True)
    size = (0.06 * scale, 0.14 * scale, 0.2 * scale)
    mirrors = [box(size, (front - 0.1 * scale, s * (half + 0.06 * scale), belt), _BLACK) for s in (1.0, -1.0)]
    beacon = gear(rng, x, 0.0, top + 0.05 * scale, 0.16 * scale) if rng.random() < 0.4 else ()
    return [lower, lamps], [middle, *mirrors, house, windows, roof, *beacon]


def _track(length: float, y: float, wide: float, high: float, rubber: Albedo) -> list[Mesh]:
    """Return one track: a long body with round ends, and the bars across its top."""
    outline = rounded(length, high, high / 2.0, steps=2) + (0.0, high / 2.0)
    belt = wedge(outline, wide / 2.0, wide / 2.0, rubber)
    count = 7
    x = np.linspace(-0.36, 0.36, count) * length
    bars = [
        np.array(
            [
                [a - 0.02 * length, -wide / 2, high],
                [a + 0.02 * length, -wide / 2, high],
                [a + 0.02 * length, wide / 2, high],
                [a - 0.02 * length, wide / 2, high],
            ]
        )
        for a in x
    ]
    grip = panels(bars, [paint.dimmed(rubber, 2.2)] * count)
    return [Mesh(m.points_m + (0.0, y, 0.0), m.faces, m.albedo, m.closed, m.casts) for m in (belt, grip)]


def _bumpers(
    rng: Generator, length: float, width: float, z: float, deck_m: float, keep_m: float, scale: float, body: Albedo
) -> list[Mesh]:
    """Return bars across front and back, and now and then gear on the front one."""
    reach = length / 2.0 + scale * float(rng.uniform(0.03, 0.15))
    parts: list[Mesh] = [
        bar((s * reach, -width * 0.4, z), (s * reach, width * 0.4, z), 0.05 * scale, body) for s in (1.0, -1.0)
    ]
    # gear ends below the deck, so that the deck can be painted over it
    size = min(scale * float(rng.uniform(0.12, 0.25)), 0.85 * (deck_m - z))
    if size > 0.06 * scale and rng.random() < 0.5:
        x = max(reach, (keep_m + size) / 2.0 + 0.01 * scale)
        parts += gear(rng, x, width * float(rng.uniform(-0.3, 0.3)), z + 0.03 * scale, size)
    return parts


def _mast(rng: Generator, nose_m: float, width_m: float, deck_m: float, keep_m: float, scale: float) -> Thing:
    """Return what stands up beside the deck: a mast with a camera before it, an antenna behind it, or nothing."""
    x = max(nose_m, keep_m / 2.0) + 0.08 * scale
    parts: Thing = ()
    if rng.random() < 0.45:
        y, top = width_m * float(rng.uniform(-0.3, 0.3)), deck_m + scale * float(rng.uniform(0.3, 0.8))
        head = box((0.12 * scale, 0.2 * scale, 0.1 * scale), (x, y, top), paint.plain(rng))
        parts += (bar((x, y, deck_m), (x, y, top), 0.05 * scale, _BLACK), head)
    if rng.random() < 0.5:
        parts += antenna(rng, -x, width_m * float(rng.uniform(-0.4, 0.4)), deck_m, scale)
    return parts
