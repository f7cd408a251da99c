"""The default recipe: a smooth veil is taken off in linear light, the noise behind it kept down, all by tables."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from landtool.dehaze.air import Air, Airlight, Map
from landtool.dehaze.bands import bands
from landtool.dehaze.noise import quieter
from landtool.dehaze.tables import Levels, Tables, recover_by_tables
from landtool.dehaze.veil import Veil
from landtool.tone import Tone, encode, linear_lut
from landtool.types import Image

# of the map of transmission; it is smooth, and interpolated to the picture's size
_MAP = (80, 60)
_LEVELS = 256
_CODES = 65536  # of light before it is encoded again: 16 bits, as gammas are steep in the dark
# grey levels below which detail is taken for noise: where hardly anything is gained none, soon some, and more for each
# time that 1 / t adds to it
_HARDLY = 0.1
_THRESHOLD, _THRESHOLD_OF_GAIN, _MOST_THRESHOLD = 3.5, 5.0, 16.0


class VeilRecipe:
    """Takes a smooth veil off. tone: the pictures' curve; the haze model holds in light, not in encoded numbers."""

    def __init__(self, tone: Tone = "srgb") -> None:
        self._linear = linear_lut(tone)
        self._encoded = np.rint(255.0 * encode(np.linspace(0.0, 1.0, _CODES), tone)).astype(np.uint8)

    def estimate(self, image: Image, veil: Veil, steady: Callable[[Airlight], Airlight]) -> Air:  # noqa: ARG002
        """Return the veil as air: the statistics have said all of it, and it is smooth in time already."""
        height, width = image.shape[:2]
        return Air(veil.airlight, veil.transmission(min(width, _MAP[0]), min(height, _MAP[1])))

    def recover(self, image: Image, air: Air) -> Image:
        """Return the picture without the veil, a new array."""
        levels, transmission = _levels(air.transmission, image.shape[1], image.shape[0])
        threshold = noise_threshold(air.transmission)
        tables = self._tables(air.airlight, transmission)
        made = np.empty_like(image)
        for band in bands(*levels.shape):
            made[band] = recover_by_tables(quieter(image, threshold, band), levels[band], tables)
        return made

    def _tables(self, airlight: Airlight, transmission: Map) -> Tables:
        """Return the new value (3, 65536) of each value at each level of transmission (256,)."""
        gain = np.reciprocal(transmission)[:, None]
        tables = np.empty((3, _LEVELS * 256), np.uint8)
        for table, light in zip(tables, airlight.astype(np.float32), strict=True):
            # J = (I - A) / t + A
            codes = gain * (self._linear - light)
            codes += light
            codes *= np.float32(_CODES - 1)
            codes += np.float32(0.5)
            np.clip(codes, 0, _CODES - 1, out=codes)
            table[:] = self._encoded[codes.astype(np.uint16)].ravel()
        return tables


def noise_threshold(transmission: Map) -> float:
    """Return the detail, in grey levels, below which a picture is taken for noise, before 1 / t makes it larger.

    A threshold by the measured noise did no better: where texture is all there is, it counts as noise.
    """
    gained = 1.0 / float(np.median(transmission)) - 1.0
    return min(_THRESHOLD * min(gained / _HARDLY, 1.0) + _THRESHOLD_OF_GAIN * gained, _MOST_THRESHOLD)


def _levels(transmission: Map, width: int, height: int) -> tuple[Levels, Map]:
    """Return a map in 256 levels at the picture's size (height, width), and the transmission (256,) they stand for."""
    low, high = float(transmission.min()), float(transmission.max())
    step = max(high - low, 1e-6) / (_LEVELS - 1)
    small = np.rint((transmission - np.float32(low)) / np.float32(step)).astype(np.uint8)
    levels = np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)
    return levels, (low + step * np.arange(_LEVELS)).astype(np.float32)
