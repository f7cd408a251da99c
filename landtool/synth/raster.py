"""Which flat surface each part of each pixel sees: faces painted one over the other, nine samples a pixel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
# how far beyond the picture's edge polygons are kept, as a share of the largest ray
_MARGIN = 1.15
# an edge longer than this on the picture is bent by the lens
_STRAIGHT_PX = 64.0


@dataclass(frozen=True, eq=False)
class Polygon:
    """A flat face (N, 3) in the world that moves with `velocity_mps` (3,), to be painted as surface `id`."""

    points_m: Array
    id: int
    velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)


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
        differs = np.zeros(self.centre.shape, np.bool_)
        for i in range(SAMPLES):
            for j in range(SAMPLES):
                if (i, j) != (SAMPLES // 2, SAMPLES // 2):
                    differs |= self.ids[i::SAMPLES, j::SAMPLES] != self.centre
        return np.flatnonzero(differs)

    @cached_property
    def mixed_ids(self) -> Ids:
        """The surfaces (M, SAMPLES^2) of the mixed pixels."""
        height, width = self.centre.shape
        row, column = np.divmod(self.mixed, width)
        first = row * (SAMPLES * SAMPLES * width) + column * SAMPLES
        steps = np.add.outer(np.arange(SAMPLES) * (SAMPLES * width), np.arange(SAMPLES)).ravel()
        return np.take(self.ids.ravel(), first[:, None] + steps)

    def coverage(self, low: int, high: int | None = None) -> NDArray[np.float32]:
        """Return the share (H, W) of each pixel that sees surface `low`, or one of low to high inclusive."""
        high = low if high is None else high
        share = ((self.centre >= low) & (self.centre <= high)).astype(np.float32)
        inside = (self.mixed_ids >= low) & (self.mixed_ids <= high)
        share.ravel()[self.mixed] = inside.mean(axis=1, dtype=np.float32)
        return share


def paint(view: View, polygons: Sequence[Polygon]) -> Raster:
    """Paint polygons in their order."""
    camera = view.camera
    ids = np.zeros((SAMPLES * camera.height, SAMPLES * camera.width), np.uint16)
    for polygon, pixels in zip(polygons, on_picture(view, polygons), strict=True):
        if pixels is not None:
            cv2.fillPoly(ids, [fixed_point(pixels, SAMPLES)], polygon.id, cv2.LINE_8, _SHIFT)
    return Raster(ids)


def coverage(view: View, polygons: Sequence[Polygon], samples: int = SAMPLES) -> NDArray[np.uint8]:
    """Return how much of each pixel (H, W) the union of polygons covers, 255 for all; their ids do not matter."""
    camera = view.camera
    mask = np.zeros((camera.height, camera.width), np.uint8)
    outlines = [p for p in on_picture(view, polygons) if p is not None]
    window = window_of(view, outlines, 0.0)
    if window is not None:
        mask[window] = filled(outlines, window, samples)
    return mask


Window = tuple[slice, slice]


def window_of(view: View, outlines: Sequence[Array], rim_px: float) -> Window | None:
    """Return the rows and columns of the picture that outlines and a rim about them take up; None if there are none."""
    if not outlines:
        return None
    low = np.min([outline.min(axis=0) for outline in outlines], axis=0) - rim_px
    high = np.max([outline.max(axis=0) for outline in outlines], axis=0) + rim_px
    x0, y0 = (max(int(v) - 1, 0) for v in low)
    x1, y1 = min(int(high[0]) + 3, view.camera.width), min(int(high[1]) + 3, view.camera.height)
    return (slice(y0, y1), slice(x0, x1)) if x0 < x1 and y0 < y1 else None


def filled(outlines: Sequence[Array], window: Window, samples: int) -> NDArray[np.uint8]:
    """Return how much of each pixel of a window (h, w) the union of outlines (N, 2) in pixels covers, 255 for all."""
    rows, columns = window
    height, width = rows.stop - rows.start, columns.stop - columns.start
    mask = np.zeros((samples * height, samples * width), np.uint8)
    first = np.array([columns.start, rows.start])
    for outline in outlines:
        cv2.fillPoly(mask, [fixed_point(outline - first, samples)], 255, cv2.LINE_8, _SHIFT)
    if samples == 1:
        return mask
    return np.asarray(cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def fixed_point(pixels: Array, samples: int) -> NDArray[np.int32]:
    """Return pixel coordinates (N, 2) as OpenCV's painter wants them on a picture `samples` times as large."""
    enlarged = (pixels + 0.5) * samples - 0.5
    return np.rint(np.clip(enlarged, -30000.0, 30000.0) * (1 << _SHIFT)).astype(np.int32)


def on_picture(view: View, polygons: Sequence[Polygon]) -> list[Array | None]:
    """Return the outlines (M, 2) of polygons in pixels, clipped somewhat outside the picture; None for unseen ones."""
    if not polygons:
        return []
    world = np.concatenate([polygon.points_m for polygon in polygons])
    counts = np.array([len(polygon.points_m) for polygon in polygons])
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    beyond = _beyond(view, view.in_camera(world))
    hidden = np.bitwise_and.reduceat(beyond, starts) != 0
    crossing = (np.bitwise_or.reduceat(beyond, starts) != 0) & ~hidden
    points: list[Array] = []
    for polygon, is_hidden, is_crossing in zip(polygons, hidden, crossing, strict=True):
        part = np.zeros((0, 3)) if is_hidden else polygon.points_m
        points.append(_clipped(view, part) if is_crossing else part)
    return _projected(view, polygons, points)


def _projected(view: View, polygons: Sequence[Polygon], points: list[Array]) -> list[Array | None]:
    pixels = _pixels(view, polygons, points)
    if view.camera.has_distortion or view.readout_s:
        bent = [p is not None and len(p) > 0 and np.ptp(p, axis=0).max() > _STRAIGHT_PX for p in pixels]
        finer = [_refined(w, p) if b else w for w, p, b in zip(points, pixels, bent, strict=True)]
        if any(bent):
            pixels = _pixels(view, polygons, finer)
    return [p if p is not None and len(p) >= 3 else None for p in pixels]


def _pixels(view: View, polygons: Sequence[Polygon], points: list[Array]) -> list[Array | None]:
    """Project all points at once, those of one velocity together."""
    out: list[Array | None] = [None] * len(points)
    velocities = {polygon.velocity_mps for polygon in polygons}
    for velocity in velocities:
        members = [i for i, p in enumerate(polygons) if p.velocity_mps == velocity and len(points[i])]
        if not members:
            continue
        pixels = view.project(np.concatenate([points[i] for i in members]), velocity)
        ends = np.cumsum([len(points[i]) for i in members])[:-1]
        for i, part in zip(members, np.split(pixels, ends), strict=True):
            out[i] = part if np.isfinite(part).all() else part[np.isfinite(part).all(axis=1)]
    return out


def _refined(world: Array, pixels: Array | None) -> Array:
    """Return a polygon with points added along the edges that are long on the picture."""
    assert pixels is not None
    if len(pixels) != len(world):
        return world
    following = np.roll(world, -1, axis=0)
    lengths = np.linalg.norm(np.roll(pixels, -1, axis=0) - pixels, axis=1)
    pieces = np.clip(np.ceil(lengths / _STRAIGHT_PX), 1, 32).astype(int)
    first = np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (np.arange(len(first)) - first) / np.repeat(pieces, pieces)
    start = np.repeat(world, pieces, axis=0)
    finer: Array = start + share[:, None] * (np.repeat(following, pieces, axis=0) - start)
    return finer


@lru_cache(maxsize=4)
def _planes(view: View) -> Array:
    """Return (5, 4) half-spaces n . p + d >= 0 of the camera frame that hold what the picture can show."""
    x, y = view.lens
    left, right = _MARGIN * float(x.min()) - 0.05, _MARGIN * float(x.max()) + 0.05
    low, high = _MARGIN * float(y.min()) - 0.05, _MARGIN * float(y.max()) + 0.05
    return np.array([[0, 0, 1, -_NEAR_M], [1, 0, -left, 0], [-1, 0, right, 0], [0, 1, -low, 0], [0, -1, high, 0]])


def _beyond(view: View, inside: Array) -> NDArray[np.int64]:
    """Return for each camera point (N, 3) a bit for each half-space it is outside of."""
    planes = _planes(view)
    outside = inside @ planes[:, :3].T + planes[:, 3] < 0.0
    bits: NDArray[np.int64] = outside @ (1 << np.arange(len(planes)))
    return bits


def _clipped(view: View, world: Array) -> Array:
    """Return the part of a polygon (N, 3) of the world in front of the camera and near the picture."""
    world_T_camera = view.world_T_camera
    polygon = world_T_camera.inverse().apply(world)
    for plane in _planes(view):
        if len(polygon):
            polygon = np.array(list(_kept(polygon, polygon @ plane[:3] + plane[3]))).reshape(-1, 3)
    return world_T_camera.apply(polygon) if len(polygon) >= 3 else np.zeros((0, 3))


def _kept(polygon: Array, inside: Array) -> Iterator[Array]:
    """Yield the part of a polygon where `inside` (N,), linear along its edges, is not negative."""
    for i in range(len(polygon)):
        a, b = inside[i - 1], inside[i]
        if (a < 0.0) != (b < 0.0):
            yield polygon[i - 1] + a / (a - b) * (polygon[i] - polygon[i - 1])
        if b >= 0.0:
            yield polygon[i]
