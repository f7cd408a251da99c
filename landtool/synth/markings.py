"""What people and weather leave on the ground: roads, car parks, yards, stains and cracks, about the origin.

Every layout is world x and y in metres, roads along x. It has few marks of many polygons, as each costs a picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from landtool.geometry import Array
from landtool.synth.grounds import GroundKind
from landtool.synth.mesh import Albedo, Thing, box, circle
from landtool.synth.outlines import beside, blob, crack, rectangle, strip, walk
from landtool.synth.scene import Mark

_REACH_M = 80.0  # roads end this far from the origin, on both sides
_LOT_M = 36.0
_VERGES: tuple[GroundKind, ...] = ("grass", "grass", "soil", "gravel", "concrete", "tiles", "sand", "cobbles")
_ASPHALT_PATCH = (0.035, 0.034, 0.033)


@dataclass(frozen=True, eq=False)
class Layout:
    """marks: bottom first. regions: polygons (N, 2), world x and y in metres, and the ground inside. things: on it."""

    marks: tuple[Mark, ...] = ()
    regions: tuple[tuple[Array, GroundKind], ...] = ()
    things: tuple[Thing, ...] = ()

    def over(self, below: Layout) -> Layout:
        """Return this layout on top of another."""
        return Layout(below.marks + self.marks, below.regions + self.regions, below.things + self.things)


def road(rng: Generator) -> Layout:
    """Return a street along x: lane lines and arrows, and beside it pavements or verges, with kerbs or without."""
    lane, lanes = float(rng.uniform(2.7, 3.7)), int(rng.integers(1, 5))
    half = lane * lanes / 2.0
    lines: list[Array] = []
    for i in range(1, lanes):
        lines += _lane_line(rng, -half + i * lane, middle=2 * i == lanes)
    if rng.random() < 0.7:
        width = float(rng.uniform(0.1, 0.25))
        lines += [strip([[-_REACH_M, y], [_REACH_M, y]], width) for y in (-half + 0.3, half - 0.3)]
    if rng.random() < 0.35:
        x, side = float(rng.uniform(-12.0, 12.0)), int(rng.integers(lanes))
        lines += arrow(rng, x, -half + (side + 0.5) * lane)
    sides = [_roadside(rng, half + float(rng.uniform(0.1, 0.6)), sign) for sign in (-1.0, 1.0)]
    shoulder = sides[0].over(sides[1])
    return Layout((_paint(rng, lines),) if lines else ()).over(shoulder)


def crossing(rng: Generator) -> Layout:
    """Return a street with a pedestrian crossing near the origin."""
    half, x = float(rng.uniform(2.8, 7.0)), float(rng.uniform(-6.0, 6.0))
    width, length = float(rng.uniform(0.4, 0.6)), float(rng.uniform(2.5, 4.5))
    bars = [rectangle(x, y, length, width) for y in np.arange(-half + 0.4, half - 0.3, 2.0 * width)]
    if rng.random() < 0.6:
        away = length / 2.0 + float(rng.uniform(0.8, 2.0))
        bars += [rectangle(x - away, -half / 2.0, 0.4, half - 0.3), rectangle(x + away, half / 2.0, 0.4, half - 0.3)]
    gap = length / 2.0 + 3.0
    for start, end in ((-_REACH_M, x - gap), (x + gap, _REACH_M)):
        bars += _dashes(start, end, 0.0, 0.12, 3.0, 6.0) if rng.random() < 0.7 else []
    sides = [_roadside(rng, half + 0.2, sign) for sign in (-1.0, 1.0)]
    return Layout((_paint(rng, bars),)).over(sides[0].over(sides[1]))


def parking_lot(rng: Generator) -> Layout:
    """Return rows of parking bays, single or back to back, with wheel stops in some."""
    bay, deep, aisle = (float(rng.uniform(*r)) for r in ((2.3, 2.8), (4.6, 5.6), (5.0, 7.0)))
    width, double = float(rng.uniform(0.08, 0.14)), rng.random() < 0.7
    lean = float(rng.choice([0.0, 0.0, 0.35, -0.35]))
    rows = np.arange(-2, 3) * ((2.0 if double else 1.0) * deep + aisle) + float(rng.uniform(-8.0, 8.0))
    lines: list[Array] = []
    for y in rows[np.abs(rows) < _LOT_M]:
        lines.append(strip([[-_LOT_M, y], [_LOT_M, y]], width))
        for x in np.arange(-_LOT_M, _LOT_M, bay):
            ends = (-deep if double else 0.0, deep)
            lines.append(strip([[x + lean * end, y + end] for end in ends], width))
    things = tuple(_wheel_stop(rng, bay, float(y)) for y in rows[:2]) if rng.random() < 0.4 else ()
    arrows = arrow(rng, float(rng.uniform(-6.0, 6.0)), float(rows[2]) + deep + aisle / 2.0)
    return Layout((_paint(rng, lines + (arrows if rng.random() < 0.5 else [])),), things=things)


def apron(rng: Generator) -> Layout:
    """Return a yard or an airfield's apron: joints, guide lines, a box of stripes."""
    pitch = float(rng.uniform(3.5, 7.0))
    places = np.arange(-_LOT_M, _LOT_M + 0.1, pitch)
    joint = float(rng.uniform(0.012, 0.03))
    joints = [strip([[-_LOT_M, y], [_LOT_M, y]], joint) for y in places]
    joints += [strip([[x, -_LOT_M], [x, _LOT_M]], joint) for x in places]
    marks = [Mark(tuple(joints), (0.05, 0.055, 0.06), float(rng.uniform(0.5, 0.95)))]
    if rng.random() < 0.7:
        angle = np.linspace(0.0, math.pi / 2.0, 12)
        radius, x = float(rng.uniform(6.0, 15.0)), float(rng.uniform(-8.0, 0.0))
        turn = np.column_stack([x + radius * np.sin(angle), radius * (1.0 - np.cos(angle))])
        guide = np.concatenate([[[-_LOT_M, 0.0]], turn, [[x + radius, _LOT_M]]])
        marks.append(_paint(rng, [strip(guide, 0.15), strip([[x, 0.0], [_LOT_M, 0.0]], 0.15)], yellow=0.8))
    if rng.random() < 0.5:
        marks.append(_paint(rng, _striped_box(rng), yellow=0.6))
    return Layout(tuple(marks))


def stains(rng: Generator) -> Layout:
    """Return drops of oil, wet or dusty patches, tyre tracks and mended places."""
    oil = [blob(rng, 14.0, (0.04, 0.5)) for _ in range(int(rng.integers(3, 14)))]
    marks = [
        Mark(tuple(oil), (0.012, 0.012, 0.013), float(rng.uniform(0.25, 0.75)), soft_m=float(rng.uniform(0.03, 0.15)))
    ]
    if rng.random() < 0.5:
        pools = [blob(rng, 20.0, (0.5, 3.0)) for _ in range(int(rng.integers(1, 5)))]
        dusty = rng.random() < 0.4
        albedo: Albedo = (0.20, 0.25, 0.29) if dusty else (0.03, 0.03, 0.032)
        marks.append(
            Mark(tuple(pools), albedo, float(rng.uniform(0.15, 0.45)), wear=0.2, soft_m=float(rng.uniform(0.1, 0.6)))
        )
    if rng.random() < 0.5:
        marks.append(
            Mark(tuple(_tracks(rng)), (0.015, 0.015, 0.015), float(rng.uniform(0.15, 0.5)), wear=0.35, soft_m=0.05)
        )
    if rng.random() < 0.3:
        centre, size = rng.uniform(-8.0, 8.0, 2), rng.uniform(0.5, 4.0, 2)
        patch = rectangle(float(centre[0]), float(centre[1]), float(size[0]), float(size[1]))
        marks.append(Mark((patch,), _ASPHALT_PATCH, float(rng.uniform(0.3, 0.7))))
    return Layout(tuple(marks))


def cracks(rng: Generator) -> Layout:
    """Return branching cracks, open or sealed with tar."""
    sealed = rng.random() < 0.3
    width = float(rng.uniform(0.03, 0.07) if sealed else rng.uniform(0.006, 0.02))
    lines: list[Array] = []
    for _ in range(int(rng.integers(2, 6))):
        start, along = rng.uniform(-6.0, 6.0, 2), float(rng.uniform(0.0, 2.0 * math.pi))
        trunk = walk(rng, start, along, int(rng.integers(20, 90)), bend=0.12 if sealed else 0.35)
        lines.append(crack(rng, trunk, width))
        for _branch in range(int(rng.integers(0, 5))):
            i = int(rng.integers(1, len(trunk) - 1))
            way = trunk[i] - trunk[i - 1]
            turned = math.atan2(way[1], way[0]) + float(rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 1.2))
            lines.append(crack(rng, walk(rng, trunk[i], turned, int(rng.integers(5, 25)), bend=0.4), 0.6 * width))
    dark = float(rng.uniform(0.008, 0.02))
    return Layout((Mark(tuple(lines), (dark, dark, dark), float(rng.uniform(0.6, 1.0)), wear=0.0 if sealed else 0.1),))


def manhole(rng: Generator) -> Layout:
    """Return an iron cover in its frame, within a few metres of the origin."""
    centre, radius = rng.uniform(-5.0, 5.0, 2), float(rng.uniform(0.28, 0.42))
    iron = float(rng.uniform(0.03, 0.10))
    cover, rim = (centre + circle(r, 32) for r in (radius, 1.14 * radius))
    bars = []
    for y in np.linspace(-0.7, 0.7, 7) * radius:
        reach = math.sqrt(0.72 * radius**2 - y * y)
        bars.append(centre + rectangle(0.0, float(y), 2.0 * reach, 0.09 * radius))
    frame = Mark((rim,), (0.10, 0.11, 0.12), 0.8)
    return Layout(
        (frame, Mark((cover,), (iron, 1.05 * iron, 1.12 * iron)), Mark(tuple(bars), (0.015, 0.015, 0.015), 0.8))
    )


def arrow(rng: Generator, x_m: float, y_m: float) -> list[Array]:
    """Return the polygons of a painted arrow about a place, straight ahead or turning off, forward or back along x."""
    way, length = float(rng.choice([-1.0, 1.0])), float(rng.uniform(2.5, 5.0))
    shaft = 0.15 * length / 3.0
    parts = [rectangle(-0.1 * length, 0.0, 0.8 * length, shaft)]
    head = np.array([[0.0, -0.3], [0.0, 0.3], [0.9, 0.0]]) * (length / 3.0)
    if rng.random() < 0.6:
        parts.append(head + [0.3 * length, 0.0])
    else:
        side, x = float(rng.choice([-1.0, 1.0])), 0.3 * length - shaft / 2.0
        parts.append(strip([[x, 0.0], [x, side * 0.12 * length]], shaft))
        parts.append(head[:, ::-1] * [1.0, side * 0.7] + [x, side * 0.12 * length])
    return [part * way + [x_m, y_m] for part in parts]


def _lane_line(rng: Generator, y_m: float, *, middle: bool) -> list[Array]:
    width = float(rng.uniform(0.1, 0.2))
    if middle and rng.random() < 0.4:
        offsets = (-width, width) if rng.random() < 0.5 else (0.0,)
        return [strip([[-_REACH_M, y_m + o], [_REACH_M, y_m + o]], width) for o in offsets]
    dash = float(rng.choice([1.5, 3.0, 6.0]))
    return _dashes(-_REACH_M, _REACH_M, y_m, width, dash, dash * float(rng.uniform(1.0, 2.0)))


def _dashes(start_m: float, end_m: float, y_m: float, width_m: float, dash_m: float, gap_m: float) -> list[Array]:
    starts = np.arange(start_m, end_m - dash_m, dash_m + gap_m)
    return [rectangle(x + dash_m / 2.0, y_m, dash_m, width_m) for x in starts]


def _roadside(rng: Generator, y_m: float, side: float) -> Layout:
    """Return what lies beyond the road's edge at |y| = y_m on one side."""
    kind = _VERGES[int(rng.integers(len(_VERGES)))]
    paved = kind in ("concrete", "tiles", "cobbles")
    if not paved and rng.random() < 0.25:
        return Layout()
    end = y_m + float(rng.uniform(1.5, 4.0)) if paved else _REACH_M
    strip = rectangle(0.0, side * (y_m + end) / 2.0, 2.0 * _REACH_M, end - y_m)
    regions: list[tuple[Array, GroundKind]] = [(strip, kind)]
    if paved:
        lawn = rectangle(0.0, side * (end + _REACH_M) / 2.0, 2.0 * _REACH_M, _REACH_M - end)
        regions.append((lawn, "grass" if rng.random() < 0.7 else "soil"))
    kerbed = rng.random() < (0.85 if paved else 0.3)
    return Layout(regions=tuple(regions), things=(_kerb(rng, side * y_m),) if kerbed else ())


def _kerb(rng: Generator, y_m: float) -> Thing:
    """Return a row of kerbstones along x."""
    width, height = float(rng.uniform(0.12, 0.25)), float(rng.uniform(0.04, 0.14))
    stone = float(rng.uniform(0.16, 0.42))
    length = 2.0 * _REACH_M / 6.0
    return tuple(
        box(
            (length - 0.01, width, height), (-_REACH_M + (i + 0.5) * length, y_m, height / 2.0), _grey(rng, stone, 0.04)
        )
        for i in range(6)
    )


def _wheel_stop(rng: Generator, bay_m: float, y_m: float) -> Thing:
    """Return wheel stops in a few neighbouring bays of the row that begins at y_m."""
    tone, first = float(rng.uniform(0.2, 0.5)), int(rng.integers(-4, 2))
    places = (-_LOT_M % bay_m + (first + i + 0.5) * bay_m for i in range(4))
    return tuple(box((1.7, 0.14, 0.11), (x, y_m + 0.6, 0.055), _grey(rng, tone, 0.08), taper=0.15) for x in places)


def _striped_box(rng: Generator) -> list[Array]:
    """Return a frame filled with slanted stripes."""
    x, y = rng.uniform(-8.0, 8.0, 2)
    side = float(rng.uniform(1.5, 5.0))
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * side / 2.0 + [x, y]
    lines = [strip(np.stack([corners[i], corners[(i + 1) % 4]]), 0.12) for i in range(4)]
    for offset in np.arange(-0.8, 0.9, 0.2) * side:
        low, high = max(-side / 2.0, offset - side / 2.0), min(side / 2.0, offset + side / 2.0)
        lines.append(strip([[x + low, y + low - offset], [x + high, y + high - offset]], 0.12))
    return lines


def _tracks(rng: Generator) -> list[Array]:
    """Return two parallel, gently curved tyre tracks."""
    gauge, width = float(rng.uniform(1.2, 1.8)), float(rng.uniform(0.14, 0.26))
    line = walk(rng, rng.uniform(-10.0, 4.0, 2), float(rng.uniform(0.0, 2.0 * math.pi)), 24, bend=0.07, step_m=0.6)
    return [strip(beside(line, side * gauge / 2.0), width) for side in (-1.0, 1.0)]


def _paint(rng: Generator, polygons: Sequence[Array], *, yellow: float = 0.12) -> Mark:
    """Return polygons of road paint, new or worn."""
    bright = float(rng.uniform(0.4, 0.8))
    albedo = (0.08 * bright, 0.6 * bright, 0.95 * bright) if rng.random() < yellow else _grey(rng, bright, 0.03)
    wear = float(rng.uniform(0.0, 0.45)) if rng.random() < 0.7 else 0.0
    return Mark(tuple(polygons), albedo, float(rng.uniform(0.75, 1.0)), wear)


def _grey(rng: Generator, tone: float, spread: float) -> Albedo:
    blue, green, red = (float(v) for v in np.clip(tone * rng.uniform(1.0 - spread, 1.0 + spread, 3), 0.01, 0.95))
    return blue, green, red
