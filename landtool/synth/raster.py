"""Which flat surface each part of each pixel sees: faces painted one over the other, nine samples a pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.view import View

Ids = NDArray[np.uint16]
SAMPLES = 3  # a side of a pixel
_SHIFT = 6  # fractional bits of the painter's coordinates
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


@dataclass(frozen=True, eq=False)
class Raster:
    """The painted picture. ids: (SAMPLES H, SAMPLES W) uint16, 0 where nothing was painted."""

    ids: Ids

    @cached_property
    def centre(self) -> Ids:
        """The surface (H, W) in the middle of each pixel."""
        return np.ascontiguousarray(self.ids[SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES])

    @cached_property
    def mixed(self) -> NDArray[np.intp]:
        """The pixels (M,) that see more than one surface, as places in the flattened picture."""
        rows = self.ids.reshape(-1, SAMPLES, self.ids.shape[1])
        middle = rows[:, SAMPLES // 2]
        differs = np.zeros(middle.shape, np.bool_)
        for i in range(SAMPLES):
            if i != SAMPLES // 2:
                differs |= rows[:, i] != middle
        across = middle[:, 1:] != middle[:, :-1]
        across[:, SAMPLES - 1 :: SAMPLES] = False  # from one pixel to the next
        differs[:, 1:] |= across
        pixels = np.flatnonzero(differs) // SAMPLES
        return pixels[np.diff(pixels, prepend=-1) > 0]

    @cached_property
    def mixed_ids(self) -> Ids:
        """The surfaces (M, SAMPLES^2) of the mixed pixels."""
        width = self.centre.shape[1]
        row, column = np.divmod(self.mixed, width)
        first = row * (SAMPLES * SAMPLES * width) + column * SAMPLES
        steps = np.add.outer(np.arange(SAMPLES) * (SAMPLES * width), np.arange(SAMPLES)).ravel()
        ids: Ids = np.take(self.ids.ravel(), first[:, None] + steps)
        return ids

    def coverage(self, low: int, high: int | None = None) -> NDArray[np.float32]:
        """Return the share (H, W) of each pixel that sees surface `low`, or one of low to high inclusive."""
        high = low if high is None else high
        share = ((self.centre >= low) & (self.centre <= high)).astype(np.float32)
        inside = (self.mixed_ids >= low) & (self.mixed_ids <= high)
        share.ravel()[self.mixed] = inside.mean(axis=1, dtype=np.float32)
        return share


def paint(view: View, faces: Faces, exact: int | None = None) -> Raster:
    """Paint faces in their order.

    OpenCV paints half a sample beyond an outline, so that bodies have no gaps between their faces; the convex ones of
    the surface `exact` are drawn in by as much first.
    """
    camera = view.camera
    ids = np.zeros((SAMPLES * camera.height, SAMPLES * camera.width), np.uint16)
    seen = [(id, p) for id, p in zip(faces.ids.tolist(), on_picture(view, faces), strict=True) if p is not None]
    fixed = fixed_points([_drawn_in(p, 0.5 / SAMPLES) if id == exact else p for id, p in seen], SAMPLES)
    for (id, _), outline in zip(seen, fixed, strict=True):
        cv2.fillPoly(ids, [outline], id, cv2.LINE_8, _SHIFT)
    return Raster(ids)


Window = tuple[slice, slice]


def window_of(view: View, outlines: Sequence[Array], rim_px: float) -> Window | None:
    """Return the rows and columns of the picture that outlines and a rim about them take up; None if there are none."""
    if not outlines:
        return None
    points = np.concatenate(outlines)
    low, high = points.min(axis=0) - rim_px, points.max(axis=0) + rim_px
    x0, y0 = (max(int(v) - 1, 0) for v in low)
    x1, y1 = min(int(high[0]) + 3, view.camera.width), min(int(high[1]) + 3, view.camera.height)
    return (slice(y0, y1), slice(x0, x1)) if x0 < x1 and y0 < y1 else None


def filled(outlines: Sequence[Array], window: Window, samples: int) -> NDArray[np.uint8]:
    """Return how much of each pixel of a window (h, w) the union of outlines (N, 2) in pixels covers, 255 for all."""
    rows, columns = window
    height, width = rows.stop - rows.start, columns.stop - columns.start
    mask = np.zeros((samples * height, samples * width), np.uint8)
    for outline in fixed_points(outlines, samples, (columns.start, rows.start)):
        cv2.fillPoly(mask, [outline], 255, cv2.LINE_8, _SHIFT)
    if samples == 1:
        return mask
    return np.asarray(cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def fixed_points(
    outlines: Sequence[Array], samples: int, first_px: tuple[int, int] = (0, 0)
) -> list[NDArray[np.int32]]:
    """Return outlines (N, 2) in pixels as OpenCV's painter wants them.

    samples: how many times as large the painted picture is. first_px: column and row of its first pixel.
    """
    if not outlines:
        return []
    enlarged = (np.concatenate(outlines) + (0.5 - first_px[0], 0.5 - first_px[1])) * samples - 0.5
    fixed = np.rint(np.minimum(np.maximum(enlarged, -30000.0), 30000.0) * (1 << _SHIFT)).astype(np.int32)
    ends = np.cumsum([len(outline) for outline in outlines]).tolist()
    return [fixed[a:b] for a, b in zip([0, *ends[:-1]], ends, strict=True)]


def _drawn_in(outline: Array, by_px: float) -> Array:
    """Return a convex outline (N, 2) with every edge moved inwards."""
    edge = np.roll(outline, -1, axis=0) - outline
    length = np.linalg.norm(edge, axis=1, keepdims=True)
    if not (length > 1e-9).all():
        return outline
    x, y = outline.T
    turn = np.sign(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    after = turn * np.column_stack([-edge[:, 1], edge[:, 0]]) / length
    before = np.roll(after, 1, axis=0)
    # both edges at a corner move by d along their normals n and m: the corner by d (n + m) / (1 + n . m)
    share = 1.0 + (before * after).sum(axis=1, keepdims=True)
    inner: Array = outline + by_px * (before + after) / np.maximum(share, 0.2)
    return inner


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
