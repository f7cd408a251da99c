"""A ground's picture in all its sizes, one below the other in a single array, so that one look-up finds any of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.tone import linear_lut, srgb_encode

Map = NDArray[np.float32]
Bytes = NDArray[np.uint8]
_RIM = 1  # texels around each level, for sampling between the last and the first


@dataclass(frozen=True, eq=False)
class Atlas:
    """A picture and its halvings.

    picture: (rows, columns, 4) uint8, the last channel idle because OpenCV samples four channels twice as fast as
    three, or (rows, columns). places: (4, 256) float32, of every level width,
    height, and the column and row of its first texel; a table of 256 because OpenCV looks up bytes. mirrored: the
    picture's repeats are mirror images, so that any picture joins without a seam.
    """

    picture: Bytes
    places: Map
    levels: int
    mirrored: bool = False

    @cached_property
    def mean_light(self) -> Map:
        """The mean (3,) of an sRGB picture in linear light, kept because an atlas serves many grounds."""
        width, height, left, top = (int(value) for value in self.places[:, 0])
        first = self.picture[top : top + height, left : left + width]
        light = linear_lut("srgb")
        histograms = [np.bincount(first[:, :, i].ravel(), minlength=256) for i in range(3)]
        return np.array([counts @ light / counts.sum() for counts in histograms], np.float32)


@dataclass(frozen=True, eq=False)
class GroundTexture:
    """What a ground looks like, near and far: detail * patches * grain * tint, in linear light.

    detail: sRGB albedo that repeats every tile_m (its width, in metres). patches: slow change over `patch_tiles` tiles,
    128 where there is none, linear. grain: what shows closer than a texel of the detail, as patches but grey, repeats
    every grain_tile_m. tint: (3,) factors on it all, blue first.
    """

    kind: str
    detail: Atlas
    patches: Atlas
    grain: Atlas
    tile_m: float
    patch_tiles: float
    grain_tile_m: float
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def texel_m(self) -> float:
        """Side of a texel of the detail at its largest."""
        return float(self.tile_m / self.detail.places[0, 0])

    @property
    def mean(self) -> Map:
        """Albedo (3,) on average, linear light, blue first."""
        mean: Map = self.detail.mean_light * np.array(self.tint, np.float32)
        return mean

    @property
    def size_bytes(self) -> int:
        """Memory that the pictures take."""
        return sum(atlas.picture.nbytes for atlas in (self.detail, self.patches, self.grain))


def color_atlas(encoded: Bytes, *, mirrored: bool = False) -> Atlas:
    """Return the atlas of an sRGB picture (H, W, 3); its halvings are averages of light."""
    levels = [encoded]
    light = np.asarray(cv2.LUT(encoded, linear_lut("srgb")), dtype=np.float32)
    while min(light.shape[:2]) > 2:
        light = np.asarray(cv2.resize(light, _half(light), interpolation=cv2.INTER_AREA), dtype=np.float32)
        levels.append(np.asarray(srgb_encode(light) * 255.0 + 0.5, dtype=np.uint8))
    return _stacked(levels, mirrored)


def factor_atlas(factors: Map) -> Atlas:
    """Return the atlas of factors (H, W) or (H, W, 3) around 1, which are kept up to 1.99."""
    levels = [factors]
    while min(levels[-1].shape[:2]) > 2:
        smaller = cv2.resize(levels[-1], _half(levels[-1]), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, dtype=np.float32))
    return _stacked([np.clip(level * 128.0 + 0.5, 0, 255).astype(np.uint8) for level in levels], mirrored=False)


def _half(picture: Map) -> tuple[int, int]:
    return max(1, picture.shape[1] // 2), max(1, picture.shape[0] // 2)


def _stacked(levels: list[Bytes], mirrored: bool) -> Atlas:
    """Return the first level at the left and the others in a column to its right."""
    border = cv2.BORDER_REPLICATE if mirrored else cv2.BORDER_WRAP
    rimmed = [cv2.copyMakeBorder(level, _RIM, _RIM, _RIM, _RIM, border) for level in levels]
    height, width = rimmed[0].shape[:2]
    rows = max(height, sum(level.shape[0] for level in rimmed[1:]))
    channels = () if levels[0].ndim == 2 else (4,)
    picture = np.zeros((rows, width + rimmed[1].shape[1], *channels), np.uint8)
    places = np.zeros((4, 256), np.float32)
    left, top = 0, 0
    for index, level in enumerate(rimmed):
        h, w = level.shape[:2]
        picture[top : top + h, left : left + w] = level if level.ndim == 2 else cv2.cvtColor(level, cv2.COLOR_BGR2BGRA)
        places[:, index] = (w - 2 * _RIM, h - 2 * _RIM, left + _RIM, top + _RIM)
        left, top = (width, 0) if index == 0 else (left, top + h)
    return Atlas(picture, places, len(levels), mirrored)
