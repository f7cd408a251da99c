"""The printed pad as the pixels see it: exact shares of its inks, then its paper's and inks' colours and dirt."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.scene import Target
from landtool.synth.sheet import Sheet
from landtool.synth.texture import InkTexture, ink_texture
from landtool.synth.view import Map, View

Box = tuple[int, int, int, int]
"""First column, first row, and the column and row after the last."""

# about as many samples as this for the whole print, so that small ones are finely sampled and large ones in time
_SAMPLES = 600_000
_MOST, _LEAST = 9, 2
_BEND_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class PrintLayer:
    """The print inside a box of the picture.

    albedo: (h, w, 3) float32 linear, blue first, the mean over each pixel. x_m, y_m: (h, w) place on the pad that the
    middle of each pixel sees. depth_m: (h, w) along the optical axis.
    """

    box: Box
    albedo: NDArray[np.float32]
    x_m: Map
    y_m: Map
    depth_m: Map

    @property
    def window(self) -> tuple[slice, slice]:
        """The box as an index into a picture."""
        x0, y0, x1, y1 = self.box
        return np.s_[y0:y1, x0:x1]


def print_layer(view: View, target: Target) -> PrintLayer | None:
    """Return the pad's print, None where it is not in the picture."""
    inks = ink_texture(target.pad)
    box = _box(view, target, inks.extent_m / 2.0)
    if box is None:
        return None
    x, y, depth = place_on_print(view, target, box)
    shares = _shares(inks, x, y)
    albedo = _colored(shares, target.sheet)
    half = inks.extent_m / 2.0
    u, v = (half - y) / inks.extent_m, (half - x) / inks.extent_m
    footprint = _footprint(x, y) / inks.extent_m
    target.sheet.blend(albedo, u, v, footprint)
    return PrintLayer(box, albedo, x, y, depth)


def outline_m(target: Target, half_m: float, steps: int = 12) -> Array:
    """Return the print's border (4 steps, 3) in the world, bent as the sheet is, counter-clockwise from above."""
    along = np.linspace(-half_m, half_m, steps, endpoint=False)
    side = np.full(steps, half_m)
    x = np.concatenate([side, -along, -side, along])
    y = np.concatenate([along, side, -along, -side])
    return target.on_sheet(np.column_stack([x, y, np.zeros(len(x))]))


def place_on_print(view: View, target: Target, box: Box) -> tuple[Map, Map, Map]:
    """Return where the pixels of a box (h, w) see the sheet, x and y of the pad frame in metres, and their depth."""
    x0, y0, x1, y1 = box
    rotation = target.world_T_pad.rotation.T.astype(np.float32)
    rays = [r[y0:y1, x0:x1] for r in view.rays]
    dx, dy, dz = (row[0] * rays[0] + row[1] * rays[1] + row[2] * rays[2] for row in rotation)
    ox, oy, oz = _origin(view, target, y0, y1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / dz
        depth = -oz * inverse
        x, y = ox + depth * dx, oy + depth * dy
        for _ in range(_BEND_ROUNDS if target.sheet.bent else 0):
            depth = (target.sheet.height_m(x, y).astype(np.float32) - oz) * inverse
            x, y = ox + depth * dx, oy + depth * dy
    unseen = ~(depth > 0)
    if unseen.any():
        for values in (x, y):
            values[unseen] = 1e6
        depth = np.where(unseen, np.float32(np.inf), depth)
    return x, y, depth


def _origin(view: View, target: Target, first_row: int, end_row: int) -> tuple[Map, Map, Map]:
    """Return the camera's place (h, 1) in the pad frame when each row is exposed."""
    t = view.row_time_s(np.arange(first_row, end_row, dtype=np.float64))[:, None]
    moved = t * (view.velocity_mps - np.array(target.velocity_mps))
    world = view.world_T_camera.translation - target.world_T_pad.translation + moved
    inside = (world @ target.world_T_pad.rotation).astype(np.float32)
    return inside[:, 0:1], inside[:, 1:2], inside[:, 2:3]


def _box(view: View, target: Target, half_m: float) -> Box | None:
    camera = view.camera
    above = target.world_T_pad.inverse().apply(view.world_T_camera.translation)
    if above[2] <= 0.0:
        return None
    rim = outline_m(target, half_m)
    if (view.in_camera(rim)[:, 2] <= 0.02).any():
        return (0, 0, camera.width, camera.height)
    pixels = view.project(rim, target.velocity_mps)
    if not np.isfinite(pixels).all():
        return (0, 0, camera.width, camera.height)
    # a pixel of room for the rounding, two for what lies between the points of a bent border
    low, high = np.floor(pixels.min(axis=0) - 3.0).astype(int), np.ceil(pixels.max(axis=0) + 4.0).astype(int)
    x0, y0, x1, y1 = max(low[0], 0), max(low[1], 0), min(high[0], camera.width), min(high[1], camera.height)
    return (int(x0), int(y0), int(x1), int(y1)) if x1 - x0 > 1 and y1 - y0 > 1 else None


def _shares(inks: InkTexture, x_m: Map, y_m: Map) -> NDArray[np.uint8]:
    """Return the mean of the ink shares (h, w, 4) over each pixel."""
    height, width = x_m.shape
    k = int(np.clip(math.sqrt(_SAMPLES / (height * width)), _LEAST, _MOST))
    step = max(_nearest_footprint(x_m, y_m) / k / inks.texel_m, 1e-6)
    level = int(np.clip(math.floor(math.log2(step)), 0, len(inks.levels) - 1))
    n, texel = inks.levels[0].shape[0], 2.0**level
    # level 0's column of y is n/2 - 1/2 - y / texel_m; a coarser level's c' + 1/2 = (c + 1/2) / 2^level
    column, row = (
        (n / 2.0 - v * np.float32(1.0 / inks.texel_m)) / np.float32(texel) - np.float32(0.5) for v in (y_m, x_m)
    )
    size = (width * k, height * k)
    fine_column, fine_row = (_between_pixels(np.clip(m, -1000, 4000), size) for m in (column, row))
    sampled = cv2.remap(inks.levels[level], fine_column, fine_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(cv2.resize(sampled, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _between_pixels(values: Map, size: tuple[int, int]) -> Map:
    """Return values at sample places spread evenly inside each pixel, from those at the pixels' middles."""
    # beyond the outer middles OpenCV repeats the last value; a rim continued in a straight line keeps it linear
    rim = np.pad(values, 1, mode="reflect", reflect_type="odd")
    k = size[0] // values.shape[1]
    large = cv2.resize(rim, (rim.shape[1] * k, rim.shape[0] * k), interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(large[k:-k, k:-k], dtype=np.float32)


def _footprint(x_m: Map, y_m: Map) -> float:
    """Return the width in metres on the print of a pixel in the middle of the box."""
    h, w = x_m.shape
    i, j = h // 2, w // 2
    across = math.hypot(float(x_m[i, j] - x_m[i, j - 1]), float(y_m[i, j] - y_m[i, j - 1]))
    down = math.hypot(float(x_m[i, j] - x_m[i - 1, j]), float(y_m[i, j] - y_m[i - 1, j]))
    return math.sqrt(max(across * down, 1e-12))


def _nearest_footprint(x_m: Map, y_m: Map) -> float:
    """Return the smallest width in metres of a pixel among the corners and the middle of the box."""
    h, w = x_m.shape
    parts = [(slice(i, i + 2), slice(j, j + 2)) for i in (0, h - 2) for j in (0, w - 2)]
    widths = [_footprint(x_m[p], y_m[p]) for p in parts]
    return min([*widths, _footprint(x_m, y_m)])


def _colored(shares: NDArray[np.uint8], sheet: Sheet) -> NDArray[np.float32]:
    """Return the albedo (h, w, 3): the inks' colours by their shares, paper for the rest."""
    paper = np.array(sheet.paper)
    inks = [np.array(ink) - paper for ink in (sheet.ring, sheet.ink, sheet.black)]
    mixing = np.column_stack([*inks, paper]).astype(np.float32) / np.float32(255.0)
    albedo: NDArray[np.float32] = shares.astype(np.float32) @ mixing.T
    # where the print ends inside a pixel, only its own part counts here: how much it covers is the painter's to say
    rim = shares[:, :, 3] < 255
    printed = shares[rim][:, 3:].astype(np.float32) / 255.0
    albedo[rim] = np.where(printed > 0.03, albedo[rim] / np.maximum(printed, 0.03), paper.astype(np.float32))
    return albedo
