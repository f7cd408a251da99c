"""Textures in linear light: the pad's own picture with exact coverage at every edge, and its mip pyramid."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.pad import BLACK, PadSpec, Shape
from landtool.tone import srgb_decode

Texels = NDArray[np.uint16]
Mask = NDArray[np.bool_]

# Texels across the printed extent. 1.10 D of pad v1 / 2200 = D / 2000, so that all its straight edges (multiples of
# D / 100) lie between texels.
_TEXELS_ACROSS = 2200
# sides are multiples of this, so that the pyramid halves evenly down to a few texels
_BLOCK = 256
# a disc is drawn as a polygon that strays less than this many texels from the circle
_SAGITTA = 1e-3


@dataclass(frozen=True, eq=False)
class PadTexture:
    """A pad's picture, centred on the pad frame's origin: its columns run along -y, its rows along -x.

    levels[i]: (n_i, n_i, 4) uint16, linear light (65535 is white), blue first, premultiplied, and coverage: nothing is
    outside what is printed. Each level averages 2x2 texels of the one before. texel_m: edge of a texel of level 0.
    busy[i]: (n_i, n_i), False where a texel and all around it, in all finer levels too, are one colour. extent_m: of
    the printed square.
    """

    levels: tuple[Texels, ...]
    texel_m: float
    busy: tuple[Mask, ...]
    extent_m: float

    @property
    def texel_T_pad(self) -> Array:
        """The homography (3, 3) from metres (x, y, 1) on the pad to level 0's (column, row, 1), integer centres."""
        half, scale = self.levels[0].shape[0] / 2.0 - 0.5, 1.0 / self.texel_m
        return np.array([[0.0, -scale, half], [-scale, 0.0, half], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=4)
def pad_texture(pad: PadSpec) -> PadTexture:
    """Return the texture of a pad, about 60 MB; the last few are kept."""
    texel_m = pad.extent_m / _TEXELS_ACROSS
    n = math.ceil((_TEXELS_ACROSS + 4) / _BLOCK) * _BLOCK
    picture = np.zeros((n, n, 4), dtype=np.float32)
    # neighbours of one colour share edges, so their coverage adds up; painted one by one a seam would show
    for color, group in groupby(pad.shapes(), key=lambda shape: shape.color):
        light = np.append(srgb_decode(np.array(color[::-1]) / 255.0), 1.0)
        _paint(picture, list(group), light, texel_m)
    levels = pyramid(picture)
    return PadTexture(levels, texel_m, _busy(levels), pad.extent_m)


@dataclass(frozen=True, eq=False)
class InkTexture:
    """Which ink covers how much of each texel of a print; columns run along the pad's -y, rows along -x.

    levels[i]: (n_i, n_i, 4) uint8, 255 is all: the ring's ink, the letter's, the tags' black, and anything at all
    (what is covered by none of the three is paper). texel_m: edge of a texel of level 0. extent_m: of the print.
    """

    levels: tuple[NDArray[np.uint8], ...]
    texel_m: float
    extent_m: float


@lru_cache(maxsize=2)
def ink_texture(pad: PadSpec) -> InkTexture:
    """Return the inks of a pad, about 30 MB; the last two are kept."""
    texel_m = pad.extent_m / _TEXELS_ACROSS
    n = math.ceil((_TEXELS_ACROSS + 4) / _BLOCK) * _BLOCK
    inks = {BLACK: 2}
    for part, channel in ((pad.letter, 1), (pad.ring, 0)):
        if part is not None:
            inks[part.color] = channel
    planes = [np.zeros((n, n), np.uint8) for _ in range(4)]
    for color, group in groupby(pad.shapes(), key=lambda shape: shape.color):
        window, cover = _covered(list(group), n, texel_m)
        for channel, plane in enumerate(planes):
            share = 255.0 if channel in (3, inks.get(color)) else 0.0
            _blend(plane[window], cover, share)
    return InkTexture(_halved(planes), texel_m, pad.extent_m)


def _blend(plane: NDArray[np.uint8], cover: NDArray[np.float32], value: float) -> None:
    """Lay a value over a part of a plane (h, w), in place."""
    if not (value or plane.any()):
        return
    mixed = plane.astype(np.float32)
    mixed += cover * (np.float32(value) - mixed)
    mixed += np.float32(0.5)
    plane[:] = mixed


def _halved(planes: list[NDArray[np.uint8]]) -> tuple[NDArray[np.uint8], ...]:
    """Return the planes (n, n) as the levels (n_i, n_i, C) of a pyramid; n is a multiple of 256."""
    levels = [np.asarray(cv2.merge(planes), dtype=np.uint8)]
    n = len(planes[0]) // 2
    # averages of averages are taken before they are rounded
    fine = [cv2.resize(plane.astype(np.float32), (n, n), interpolation=cv2.INTER_AREA) for plane in planes]
    picture = np.asarray(cv2.merge(fine), dtype=np.float32)
    while True:
        levels.append((picture + np.float32(0.5)).astype(np.uint8))
        if n % 2 or n <= 4:
            return tuple(levels)
        n //= 2
        picture = np.asarray(cv2.resize(picture, (n, n), interpolation=cv2.INTER_AREA), dtype=np.float32)


def pyramid(picture: NDArray[np.float32]) -> tuple[Texels, ...]:
    """Return the levels of a picture (n, n, C) float32 in [0, 1]; n is a multiple of 256."""
    levels = []
    while True:
        levels.append(np.rint(picture * 65535.0).astype(np.uint16))
        n = picture.shape[0]
        if n % 2 or n <= 4:
            return tuple(levels)
        picture = np.asarray(cv2.resize(picture, (n // 2, n // 2), interpolation=cv2.INTER_AREA), dtype=np.float32)


def polygon_coverage(points: Array) -> tuple[Array, int, int]:
    """Return how much of each texel a polygon covers, exactly: (coverage (h, w) in [0, 1], first column, first row).

    points: (N, 2) column and row, where texel i spans [i, i + 1]. The polygon must not cross itself.
    """
    x0, y0 = np.floor(points.min(axis=0)).astype(int)
    x1, y1 = np.ceil(points.max(axis=0)).astype(int)
    track = np.concatenate(list(_cut(points - (x0, y0))))
    step = np.diff(track, axis=0)
    middle = track[:-1] + step / 2.0
    cell = np.floor(middle).astype(int)
    # Each piece lies in one texel. The area to its right: 1 - inside of this texel, and all of those that follow,
    # which the running sum along the row carries on; the two spare columns take what leaves the box.
    dy, inside = step[:, 1], middle[:, 0] - cell[:, 0]
    stride = x1 - x0 + 2
    at, size = cell[:, 1] * stride + cell[:, 0], (y1 - y0 + 1) * stride
    steps = np.bincount(np.concatenate([at, at + 1]), np.concatenate([dy * (1.0 - inside), dy * inside]), size)
    steps = steps.reshape(-1, stride)
    covered = np.abs(np.cumsum(steps, axis=1, out=steps), out=steps)[:-1, :-2]
    return np.minimum(covered, 1.0, out=covered), int(x0), int(y0)


def _cut(points: Array) -> Iterator[Array]:
    """Yield the points where the polygon crosses texel borders, edge by edge, each with both its ends."""
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        t = np.unique(np.concatenate([[0.0, 1.0], _crossings(a[0], b[0]), _crossings(a[1], b[1])]))
        yield a + t[:, None] * (b - a)


def _crossings(a: float, b: float) -> Array:
    low, high = min(a, b), max(a, b)
    if high == low:
        return np.zeros(0)
    lines = np.arange(math.ceil(low), math.floor(high) + 1, dtype=np.float64)
    cuts: Array = (lines - a) / (b - a)
    return cuts


def _paint(picture: NDArray[np.float32], shapes: list[Shape], paint: Array, texel_m: float) -> None:
    """Paint shapes of one colour, with the values `paint` (C,), over a premultiplied picture."""
    window, cover = _covered(shapes, picture.shape[0], texel_m)
    picture[window] += cover[:, :, None] * (paint.astype(np.float32) - picture[window])


def _covered(shapes: list[Shape], n: int, texel_m: float) -> tuple[tuple[slice, slice], NDArray[np.float32]]:
    """Return a window of the picture (n, n), and how much of its texels (h, w) shapes that do not overlap cover."""
    # column along -y, row along -x; edges of texels, hence no half
    parts = [polygon_coverage(n / 2.0 - _outline(shape, texel_m)[:, ::-1] / texel_m) for shape in shapes]
    left, top = min(x for _, x, _ in parts), min(y for _, _, y in parts)
    right, bottom = max(x + part.shape[1] for part, x, _ in parts), max(y + part.shape[0] for part, _, y in parts)
    cover = np.zeros((bottom - top, right - left), np.float32)
    for part, x, y in parts:
        cover[y - top : y - top + part.shape[0], x - left : x - left + part.shape[1]] += part
    return np.s_[top:bottom, left:right], np.minimum(cover, np.float32(1.0), out=cover)


def _outline(shape: Shape, texel_m: float) -> Array:
    if not shape.radius_m:
        return shape.points_m
    # a chord over the angle 2a leaves the circle by r (1 - cos a), about r a^2 / 2
    sides = math.ceil(math.pi / math.sqrt(2.0 * _SAGITTA * texel_m / shape.radius_m))
    angle = np.arange(sides) * (2.0 * math.pi / sides)
    rim: Array = shape.points_m[0] + shape.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    return rim


def _busy(levels: tuple[Texels, ...]) -> tuple[Mask, ...]:
    near = np.ones((3, 3), np.uint8)
    differs = np.asarray(cv2.morphologyEx(levels[0], cv2.MORPH_GRADIENT, near)).max(axis=2) > 0
    masks = [differs]
    for level in levels[1:]:
        n = level.shape[0]
        differs = differs.reshape(n, 2, n, 2).any(axis=(1, 3))
        masks.append(np.asarray(cv2.dilate(differs.astype(np.uint8), near)) > 0)
    return tuple(masks)
