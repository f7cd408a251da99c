"""The part of a picture about a pad, in linear light, with the rays its samples look along.

A lens bends the rays; a polynomial in the columns and rows has them to a thousandth of a pixel, where the pad fills the
picture to some hundredths.
Pads that are large in the picture are seen in a shrunken patch: what is printed is fitted in a bounded time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.polynomial import chebyshev

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.target.print_model import FINE, Plane
from landtool.tone import Tone, linear_lut
from landtool.types import Image

Rays = TypeVar("Rays", Plane, Array)
_NODES = 10  # a side of the grid on which the lens is looked up
_DEGREE = 7
_MARGIN, _MARGIN_PX = 0.04, 2.5  # about the board: of its longer side, and pixels
_LEAST_SIDE_PX = 6


@dataclass(frozen=True, eq=False)
class Patch:
    """Part of a picture.

    light: (h, w) linear light, each the mean of shrink x shrink pixels. fine: x/z, y/z (h f, w f) of its samples, f of
    them along a side. middle: the same (h, w) of its pixels' middles. px_by_flat: (2, 2) derivative of the patch's
    column and row by (x/z, y/z), in its middle.
    """

    light: Plane
    shrink: int
    fine: tuple[Plane, Plane]
    middle: tuple[Plane, Plane]
    px_by_flat: Array


def cut_patch(image: Image, camera: Camera, around: Pose, pad: PadSpec, tone: Tone, most_px: float) -> Patch | None:
    """Cut the patch about a pad at the pose `around`; None where hardly anything of it is in the picture.

    image: (H, W, 3) BGR uint8 of the camera's size. most_px: of the longer side of the board in the patch.
    """
    half = pad.extent_m / 2.0
    corners = np.array([[half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0], [-half, half, 0.0]])
    seen = camera.project(around.apply(corners))
    if not np.isfinite(seen).all():
        return None
    low, high = seen.min(axis=0), seen.max(axis=0)
    side = float((high - low).max())
    shrink = max(1, math.ceil(side / most_px))
    margin = _MARGIN * side + _MARGIN_PX * shrink
    x0, y0 = (max(0, math.floor(v - margin)) for v in low)
    size = [min(limit, math.ceil(v + margin) + 1) - start for limit, v, start in
            zip(image.shape[1::-1], high, (x0, y0), strict=True)]  # fmt: skip
    columns, rows = (n // shrink for n in size)
    if min(columns, rows) < _LEAST_SIDE_PX:
        return None
    part = image[y0 : y0 + rows * shrink, x0 : x0 + columns * shrink]
    # the luma is what codecs keep sharp
    light = linear_lut(tone)[cv2.cvtColor(part, cv2.COLOR_BGR2GRAY)]
    if shrink > 1:
        light = cv2.resize(light, (columns, rows), interpolation=cv2.INTER_AREA)
    rays = _Rays.through(camera, x0, y0, columns * shrink, rows * shrink)
    if rays is None:
        return None
    fine = rays.on_grid(columns * FINE, rows * FINE)
    return Patch(np.asarray(light, np.float32), shrink, fine, rays.on_grid(columns, rows), rays.slope(columns, rows))


@dataclass(frozen=True, eq=False)
class _Rays:
    """x/z and y/z over a rectangle of the picture as Chebyshev series (degree + 1, degree + 1), row before column."""

    x: Array
    y: Array

    @classmethod
    def through(cls, camera: Camera, x0: int, y0: int, columns: int, rows: int) -> _Rays | None:
        nodes = chebyshev.chebpts1(_NODES)
        u = x0 - 0.5 + (nodes + 1.0) / 2.0 * columns
        v = y0 - 0.5 + (nodes + 1.0) / 2.0 * rows
        grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        flat = camera.normalize(grid)
        if not np.isfinite(flat).all():
            return None
        inverse = np.linalg.pinv(chebyshev.chebvander(nodes, _DEGREE))
        x, y = (inverse @ f.reshape(_NODES, _NODES) @ inverse.T for f in flat.T)
        return cls(x, y)

    def on_grid(self, columns: int, rows: int) -> tuple[Plane, Plane]:
        """Return x/z, y/z (rows, columns) in the middles of a grid's cells."""
        across, down = (chebyshev.chebvander((np.arange(n) + 0.5) * (2.0 / n) - 1.0, _DEGREE) for n in (columns, rows))
        x, y = ((down @ series @ across.T).astype(np.float32) for series in (self.x, self.y))
        return x, y

    def slope(self, columns: int, rows: int) -> Array:
        """Return the derivative (2, 2) of a grid's column and row by x/z, y/z in the middle."""
        by_grid = np.array(
            [
                [chebyshev.chebval2d(0.0, 0.0, chebyshev.chebder(series, axis=axis)) * 2.0 / n
                 for axis, n in ((1, columns), (0, rows))]
                for series in (self.x, self.y)
            ]
        )  # fmt: skip
        inverse: Array = np.linalg.inv(by_grid)
        return inverse


def on_print(flat: tuple[Rays, Rays], camera_T_pad: Pose) -> tuple[Rays, Rays]:
    """Return where on the print, metres along the pad's x and y, the rays through x/z, y/z meet it; shapes stay."""
    # (X, Y, 1) ~ [r1 r2 t]^-1 (x, y, 1)
    plane = np.column_stack([camera_T_pad.rotation[:, :2], camera_T_pad.translation])
    x, y = flat
    m = np.linalg.inv(plane).astype(x.dtype)
    by = 1.0 / (m[2, 0] * x + m[2, 1] * y + m[2, 2])
    return (m[0, 0] * x + m[0, 1] * y + m[0, 2]) * by, (m[1, 0] * x + m[1, 1] * y + m[1, 2]) * by
