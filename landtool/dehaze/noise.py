"""A picture with less noise."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.dehaze.tables import looked_up
from landtool.types import Image

_STEP = 0.5  # thresholds are rounded to this, so that their tables are used again
_REACH = 2  # of the window a pixel is compared with


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
    values, means = (np.asarray(p[above : above + flat[0]], np.uint8).reshape(flat) for p in (part, mean))
    return looked_up(values, means, _table(rounded)).reshape(flat[0], -1, 3)


@lru_cache(maxsize=32)
def _table(threshold: float) -> NDArray[np.uint8]:
    """Return the new value (65536,) uint8 for value + 256 mean."""
    value, mean = np.arange(256.0)[None, :], np.arange(256.0)[:, None]
    d = value - mean
    table: NDArray[np.uint8] = np.rint(mean + d**3 / (d * d + threshold * threshold)).astype(np.uint8).ravel()
    table.setflags(write=False)
    return table
