"""Flat faces, and where a camera sees their outlines: clipped, and bent as the lens bends them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.view import View

_NEAR_M = 0.02
# how far beyond the picture's edge polygons are kept, as a share of the largest ray: not far where a lens bends,
# for its model holds only there
_MARGIN, _MARGIN_BENT = 5.0, 1.15
# an edge longer than this on the picture is bent by the lens
_STRAIGHT_PX = 64.0


@dataclass(frozen=True, eq=False)
class Faces:
    """F flat faces in the world. points_m: (P, 3) their corners, one face after the other. counts: (F,) corners each.

    ids: (F,) the surface each is painted as. velocity_mps: (F, 3) of each in the world.
    """

    points_m: Array
    counts: NDArray[np.intp]
    ids: NDArray[np.intp]
    velocity_mps: Array

    @classmethod
    def of(cls, polygons_m: Sequence[Array], id: int = 1) -> Faces:
        """Return polygons (N, 3) at rest, all of one surface."""
        counts = np.array([len(polygon) for polygon in polygons_m], np.intp)
        points = np.concatenate([np.zeros((0, 3)), *polygons_m])
        return cls(points, counts, np.full(len(counts), id), np.zeros((len(counts), 3)))

    @classmethod
    def level(cls, outlines_m: Sequence[Array] | Sequence[NDArray[np.float32]], z_m: float) -> Faces:
        """Return flat outlines (N, 2) of the world's x and y as faces at a height."""
        counts = np.array([len(outline) for outline in outlines_m], np.intp)
        points = np.full((int(counts.sum()), 3), z_m)
        if len(counts):
            points[:, :2] = np.concatenate(outlines_m)
        return cls(points, counts, np.ones(len(counts), np.intp), np.zeros((len(counts), 3)))

    @classmethod
    def joined(cls, parts: Sequence[Faces]) -> Faces:
        """Return the faces of all parts, in their order."""
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.points_m for part in parts)]),
            np.concatenate([np.zeros(0, np.intp), *(part.counts for part in parts)]),
            np.concatenate([np.zeros(0, np.intp), *(part.ids for part in parts)]),
            np.concatenate([np.zeros((0, 3)), *(part.velocity_mps for part in parts)]),
        )

    @property
    def starts(self) -> NDArray[np.intp]:
        """The place (F,) of each face's first corner among the points."""
        starts: NDArray[np.intp] = np.cumsum(self.counts) - self.counts
        return starts


def on_picture(view: View, faces: Faces) -> list[Array | None]:
    """Return the outlines (M, 2) of faces in pixels, clipped somewhat outside the picture; None for unseen ones."""
    outlines: list[Array | None] = [None] * len(faces.counts)
    corners = _in_sight(view, faces)
    if not len(corners.of):
        return outlines
    pixels = view.project(corners.points_m, corners.velocity_mps(faces))
    _put(outlines, corners, pixels)
    if view.camera.has_distortion or view.readout_s:
        starts = corners.starts
        extent = np.maximum.reduceat(pixels, starts) - np.minimum.reduceat(pixels, starts)
        bent = extent.max(axis=1) > _STRAIGHT_PX
        if bent.any():
            each = np.repeat(bent, corners.counts)
            finer = _refined(_Corners(corners.points_m[each], corners.counts[bent], corners.of[bent]), pixels[each])
            _put(outlines, finer, view.project(finer.points_m, finer.velocity_mps(faces)))
    return outlines


@dataclass(frozen=True, eq=False)
class _Corners:
    """Corners (P, 3) of some faces, in the world or the camera frame; counts: (n,) of each, of: (n,) which face."""

    points_m: Array
    counts: NDArray[np.intp]
    of: NDArray[np.intp]

    @property
    def starts(self) -> NDArray[np.intp]:
        starts: NDArray[np.intp] = np.cumsum(self.counts) - self.counts
        return starts

    def velocity_mps(self, faces: Faces) -> Array:
        """Return the velocity (P, 3) of each corner, or the one (1, 3) of all."""
        velocity = faces.velocity_mps[self.of]
        return np.repeat(velocity, self.counts, axis=0) if velocity.any() else velocity[:1]


def _put(outlines: list[Array | None], corners: _Corners, pixels: Array) -> None:
    """Put the outlines of some faces into the list, without the corners that the lens does not see."""
    fine = bool(np.isfinite(pixels).all())
    ends = np.cumsum(corners.counts).tolist()
    for i, start, end in zip(corners.of.tolist(), [0, *ends[:-1]], ends, strict=True):
        outline = pixels[start:end]
        if not fine:
            outline = outline[np.isfinite(outline).all(axis=1)]
        outlines[i] = outline if len(outline) >= 3 else None


def _refined(corners: _Corners, pixels: Array) -> _Corners:
    """Return polygons with points added along the edges that are long on the picture; pixels: (P, 2) of the corners."""
    points, starts = corners.points_m, corners.starts
    following = np.arange(1, len(points) + 1)
    following[starts + corners.counts - 1] = starts
    lengths = np.hypot(*(pixels[following] - pixels).T)
    pieces = np.clip(np.ceil(lengths / _STRAIGHT_PX), 1, 32).astype(np.intp)
    first = np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (np.arange(len(first)) - first) / np.repeat(pieces, pieces)
    finer = np.repeat(points, pieces, axis=0) + share[:, None] * np.repeat(points[following] - points, pieces, axis=0)
    return _Corners(finer, np.add.reduceat(pieces, starts), corners.of)


def _in_sight(view: View, faces: Faces) -> _Corners:
    """Return the corners, in the world, of what the picture can show of the faces that it can show something of."""
    if not len(faces.counts):
        return _Corners(faces.points_m, faces.counts, faces.ids)
    inside = view.in_camera(faces.points_m)
    beyond, starts = _beyond(view, inside), faces.starts
    seen = np.bitwise_and.reduceat(beyond, starts) == 0
    some = np.bitwise_or.reduceat(beyond, starts)
    crossed = int(np.bitwise_or.reduce(some[seen], initial=0))
    if not crossed:
        return _Corners(faces.points_m[np.repeat(seen, faces.counts)], faces.counts[seen], np.flatnonzero(seen))
    crosses = seen & (some != 0)
    whole, cut = np.flatnonzero(seen & ~crosses), np.flatnonzero(crosses)
    each_whole, each_cut = np.repeat(seen & ~crosses, faces.counts), np.repeat(crosses, faces.counts)
    part = _clipped(view, _Corners(inside[each_cut], faces.counts[cut], cut), crossed)
    return _Corners(
        np.concatenate([faces.points_m[each_whole], view.world_T_camera.apply(part.points_m)]),
        np.concatenate([faces.counts[whole], part.counts]),
        np.concatenate([whole, part.of]),
    )


@lru_cache(maxsize=4)
def _planes(view: View) -> Array:
    """Return (5, 4) half-spaces n . p + d >= 0 of the camera frame that hold what the picture can show."""
    x, y = view.lens
    margin = _MARGIN_BENT if view.camera.has_distortion else _MARGIN
    left, right = margin * float(x[:, 0].min()) - 0.05, margin * float(x[:, -1].max()) + 0.05
    low, high = margin * float(y[0].min()) - 0.05, margin * float(y[-1].max()) + 0.05
    return np.array([[0, 0, 1, -_NEAR_M], [1, 0, -left, 0], [-1, 0, right, 0], [0, 1, -low, 0], [0, -1, high, 0]])


def _beyond(view: View, inside: Array) -> NDArray[np.int64]:
    """Return for each camera point (N, 3) a bit for each half-space it is outside of."""
    planes = _planes(view)
    outside = inside @ planes[:, :3].T + planes[:, 3] < 0.0
    bits: NDArray[np.int64] = outside @ (1 << np.arange(len(planes)))
    return bits


def out_of_sight(view: View, low_m: Array, high_m: Array) -> NDArray[np.bool_]:
    """Return whether the picture can show nothing of boxes, each between two corners (N, 3) of the world; (N,)."""
    planes = _planes(view)
    centre = view.in_camera((low_m + high_m) / 2.0)
    radius = np.linalg.norm(high_m - low_m, axis=1) / 2.0
    away = centre @ planes[:, :3].T + planes[:, 3] + radius[:, None] * np.linalg.norm(planes[:, :3], axis=1)
    hidden: NDArray[np.bool_] = (away < 0.0).any(axis=1)
    return hidden


def _clipped(view: View, corners: _Corners, crossed: int) -> _Corners:
    """Return the parts of polygons of the camera frame inside those half-spaces, by bits, that any of them crosses."""
    for i, plane in enumerate(_planes(view)):
        if crossed & (1 << i) and len(corners.of):
            corners = _kept(corners, corners.points_m @ plane[:3] + plane[3])
    return corners


def _kept(corners: _Corners, inside: Array) -> _Corners:
    """Return the parts of polygons where `inside` (P,), linear along their edges, is not negative."""
    points, starts = corners.points_m, corners.starts
    previous = np.arange(-1, len(points) - 1)
    previous[starts] = starts + corners.counts - 1
    before, a = points[previous], inside[previous]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = before + (a / (a - inside))[:, None] * (points - before)
    # of each edge the point where it crosses, then its end: those that exist
    both = np.stack([crossing, points], axis=1)
    exists = np.stack([(a < 0.0) != (inside < 0.0), inside >= 0.0], axis=1)
    counts = np.add.reduceat(exists.sum(axis=1), starts)
    left = counts >= 3
    exists &= np.repeat(left, corners.counts)[:, None]
    return _Corners(both[exists], counts[left], corners.of[left])
