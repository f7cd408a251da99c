"""Noise: how much of it a picture has, and a picture with less of it."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.types import Image

# second differences across both axes: zero on any plane; noise of deviation s comes out as 6 s (J. Immerkaer, 1996)
_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
_BLOCK = 16
_BANDS = 12  # of the picture's rows: enough blocks to find even ones among
_EVEN_SHARE = 0.15
_STEP = 0.5  # thresholds are rounded to this, so that their tables are used again
_REACH = 2  # of the window a pixel is compared with


def noise_level(image: Image) -> float:
    """Return the standard deviation of the noise of a picture (H, W, 3) uint8, grey levels of its luma.

    Taken where it is most even, in bands of its rows: texture counts as noise, if there is nothing but texture.
    """
    height, width = image.shape[:2]
    if min(height, width) < _BLOCK:
        return 0.0
    tops = np.unique(np.linspace(0, height - _BLOCK, _BANDS).astype(int))
    across = width // _BLOCK * _BLOCK
    means = []
    for top in tops:
        luma = cv2.cvtColor(image[top : top + _BLOCK, :across], cv2.COLOR_BGR2GRAY)
        size = np.abs(cv2.filter2D(luma, cv2.CV_16S, _KERNEL))
        means.append(size.reshape(_BLOCK, -1, _BLOCK).mean(axis=(0, 2)))
    even = np.quantile(np.concatenate(means), _EVEN_SHARE)
    return float(even) * math.sqrt(math.pi / 2.0) / 6.0


def quieter(image: Image, threshold: float, rows: slice = slice(None)) -> Image:
    """Return a picture whose details of less than about `threshold` grey levels are taken back, or some rows of it.

    A pixel's difference d to the mean about it becomes d^3 / (d^2 + threshold^2): edges stay as they are.
    """
    rounded = round(threshold / _STEP) * _STEP
    if rounded <= 0.0:
        return image[rows]
    start, stop, _ = rows.indices(len(image))
    above, below = min(start, _REACH), min(len(image) - stop, _REACH)
    part = image[start - above : stop + below]
    mean = cv2.GaussianBlur(part, (2 * _REACH + 1, 2 * _REACH + 1), 0.0)
    flat = (stop - start, 3 * image.shape[1])
    # two bytes beside each other, the lower first, are one index of 16 bits
    pair = np.asarray(cv2.merge([p[above : above + flat[0]].reshape(flat) for p in (part, mean)]))
    calm = np.asarray(cv2.LUT(pair.view("<u2")[..., 0], _table(rounded)), np.uint8)
    return calm.reshape(flat[0], -1, 3)


@lru_cache(maxsize=32)
def _table(threshold: float) -> NDArray[np.uint8]:
    """Return the new value (65536,) uint8 for value + 256 mean."""
    value, mean = np.arange(256.0)[None, :], np.arange(256.0)[:, None]
    d = value - mean
    table: NDArray[np.uint8] = np.rint(mean + d**3 / (d * d + threshold * threshold)).astype(np.uint8).ravel()
    table.setflags(write=False)
    return table
