"""Which flat surface each part of each pixel sees: faces painted one over the other, nine samples a pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.faces import Faces, on_picture
from landtool.synth.view import View

Ids = NDArray[np.uint16]
SAMPLES = 3  # a side of a pixel
_SHIFT = 6  # fractional bits of the painter's coordinates


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

    def coverage(self, id: int) -> NDArray[np.float32]:
        """Return the share (H, W) of each pixel that sees a surface."""
        share: NDArray[np.float32] = (self.centre == id).astype(np.float32)
        share.ravel()[self.mixed] = (self.mixed_ids == id).mean(axis=1, dtype=np.float32)
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
