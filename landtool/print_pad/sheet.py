"""What a printed sheet consists of. Millimetres, origin at the sheet's top left, x to the right, y down."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Literal

import numpy as np

from landtool.geometry import Array
from landtool.pad import BLACK, Color, Shape

Point = tuple[float, float]
# Points closer than this are one point; far below what a printer resolves, far above rounding
_SAME_MM = 1e-4


@dataclass(frozen=True, eq=False)
class Area:
    """Polygons (N, 2) painted in one colour: side by side or over each other, none crossing itself."""

    polygons: tuple[Array, ...]
    color: Color = BLACK


@dataclass(frozen=True)
class Disc:
    """A filled circle."""

    x: float
    y: float
    radius: float
    color: Color = BLACK


@dataclass(frozen=True)
class Text:
    """One line of text, its base line starting at (x, y), or centred on x. size_mm is the font's size."""

    x: float
    y: float
    text: str
    size_mm: float = 3.0
    anchor: Literal["start", "middle"] = "start"


Picture = Area | Disc
Box = tuple[float, float, float, float]  # left, top, width, height


@dataclass(frozen=True)
class Sheet:
    """One page: `picture` is the target, seen through `window`; `margin` is what stands around it."""

    width_mm: float
    height_mm: float
    picture: tuple[Picture, ...]
    window: Box
    margin: tuple[Picture | Text, ...]


def bar(left: float, top: float, width: float, height: float, color: Color = BLACK) -> Area:
    """Return an upright rectangle."""
    right, bottom = left + width, top + height
    return Area((np.array([[left, top], [right, top], [right, bottom], [left, bottom]]),), color)


def place(shapes: Iterable[Shape], centre: Point, mm_per_m: float) -> tuple[Picture, ...]:
    """Return a pad's shapes on a sheet: the pad's x goes up the sheet, its y to the left."""

    def on_sheet(points_m: Array) -> Array:
        return np.asarray(centre) - points_m[:, ::-1] * mm_per_m

    placed: list[Picture] = []
    for (color, is_disc), group in groupby(shapes, key=lambda shape: (shape.color, shape.radius_m > 0)):
        if is_disc:
            for shape in group:
                x, y = on_sheet(shape.points_m)[0]
                placed.append(Disc(float(x), float(y), shape.radius_m * mm_per_m, color))
        else:
            placed.append(Area(tuple(on_sheet(shape.points_m) for shape in group), color))
    return tuple(placed)


def outlines(area: Area) -> list[Array]:
    """Return an area's outlines (N, 2), to be filled by the non-zero rule, without the edges its polygons share.

    Viewers soften every edge by itself, so that two polygons side by side show a fine line between them.
    """
    if len(area.polygons) == 1:
        return list(area.polygons)
    rings = [_counted(polygon) for polygon in area.polygons]
    corners = np.unique(np.concatenate(rings), axis=0)
    leaving: dict[Point, list[Point]] = defaultdict(list)
    for ring in rings:
        for a, b in _pieces(ring, corners):
            # an edge met the other way round lies between two polygons: neither keeps it
            if a in leaving[b]:
                leaving[b].remove(a)
            else:
                leaving[a].append(b)
    return [_straightened(loop) * _SAME_MM for loop in _loops(leaving)]


def _counted(polygon: Array) -> Array:
    """Return the corners in whole steps of _SAME_MM, turning the same way for every polygon."""
    x, y = polygon.T
    turned = polygon if x @ np.roll(y, -1) > y @ np.roll(x, -1) else polygon[::-1]
    return np.rint(turned / _SAME_MM)


def _pieces(ring: Array, corners: Array) -> Iterator[tuple[Point, Point]]:
    """Yield a ring's edges, cut at every corner that lies on them."""
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        edge, to_corner = b - a, corners - a
        length = np.hypot(*edge)
        if length == 0:
            continue
        along, aside = to_corner @ edge / length, np.abs(to_corner @ (-edge[1], edge[0])) / length
        inside = np.flatnonzero((aside < 3) & (along > 3) & (along < length - 3))
        stops = [a, *corners[inside[np.argsort(along[inside])]], b]
        yield from pairwise((float(x), float(y)) for x, y in stops)


def _loops(leaving: dict[Point, list[Point]]) -> Iterator[Array]:
    """Chain edges to closed loops; where several meet in a corner, any way on gives the same filled area."""
    for start in list(leaving):
        while leaving[start]:
            loop, point = [start], leaving[start].pop()
            while point != start:
                loop.append(point)
                point = leaving[point].pop()
            yield np.array(loop)


def _straightened(loop: Array) -> Array:
    """Drop the points between which the outline goes straight on."""
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    # a rounded corner strays by at most one step from the straight line
    turns: Array = loop[np.abs(turn) > 2.0 * np.hypot(*after.T) + 2.0 * np.hypot(*before.T)]
    return turns
