"""The pictures in which AprilTag looks for tags.

A tag of 15 px has modules as wide as the lens blur. In encoded values its thin white parts swell and its border breaks;
in linear light, sharpened, with white equally bright everywhere, the same library over the same picture reads all of
them. The encoded picture stays the second look: it is the better one where the tag itself is dark or low in contrast.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.tone import Tone, linear_lut

Grey = NDArray[np.uint8]
Light = NDArray[np.float32]
_TILE_PX = 4  # white is the brightest tile nearby: smaller than the white around a small tag
_NEARBY = np.ones((9, 9), np.uint8)  # tiles
_DARKEST_WHITE = 0.05
_SHARPENING, _SHARPENING_SIGMA_PX = 1.0, 1.0


@dataclass(frozen=True, eq=False)
class Look:
    """A picture for AprilTag. scale_xy: its pixels for one of the original."""

    picture: Grey
    scale_xy: Array

    def to_original(self, corners_apriltag_px: Array) -> Array:
        """Take places (N, 2), pixel centres at +0.5 as the library has them, to the original's pixels."""
        # the library's frame begins at the picture's corner, as scaling does; OpenCV's begins half a pixel later
        original: Array = corners_apriltag_px / self.scale_xy - 0.5
        return original

    def holds(self, corners_px: Array) -> bool:
        """Whether places (N, 2) of the original lie in the picture, a quarter of a pixel beyond its rim at most."""
        size = np.array(self.picture.shape[::-1]) / self.scale_xy
        return bool((corners_px > -0.75).all() and (corners_px < size - 0.25).all())


def look_encoded(grey: Grey, scale: float) -> Look:
    """Return the picture (H, W) as it is, scaled."""
    return _scaled(grey, scale)


def look_in_light(grey: Grey, scale: float, tone: Tone) -> Look:
    """Return the picture (H, W) in linear light, evenly lit, sharpened unless it is reduced, and scaled."""
    before = _scaled(grey, min(scale, 1.0))  # reduced first: the rest is then quick
    light = np.asarray(cv2.LUT(before.picture, linear_lut(tone)), dtype=np.float32)
    even = np.minimum(cv2.divide(light, _white(light)), 1.0)
    if scale >= 1.0:
        blurred = cv2.GaussianBlur(even, (0, 0), _SHARPENING_SIGMA_PX)
        even = np.maximum(cv2.addWeighted(even, 1.0 + _SHARPENING, blurred, -_SHARPENING, 0.0), 0.0)
    after = _scaled(np.asarray(cv2.convertScaleAbs(even, alpha=255.0), dtype=np.uint8), max(scale, 1.0))
    return Look(after.picture, before.scale_xy * after.scale_xy)


def _white(light: Light) -> Light:
    """Return the brightness (H, W) of the brightest tile around each pixel."""
    height, width = light.shape
    tiles = (max(width // _TILE_PX, 1), max(height // _TILE_PX, 1))
    white = np.asarray(cv2.resize(light, tiles, interpolation=cv2.INTER_AREA))
    white = np.asarray(cv2.GaussianBlur(cv2.dilate(white, _NEARBY), (0, 0), 3.0))
    white = np.asarray(cv2.resize(white, (width, height), interpolation=cv2.INTER_LINEAR))
    return np.maximum(white, _DARKEST_WHITE, dtype=np.float32)


def _scaled(grey: Grey, scale: float) -> Look:
    height, width = grey.shape
    size = max(round(width * scale), 1), max(round(height * scale), 1)
    if size != (width, height):
        kind = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LANCZOS4
        grey = np.asarray(cv2.resize(grey, size, interpolation=kind), dtype=np.uint8)
    return Look(grey, np.array([size[0] / width, size[1] / height]))
