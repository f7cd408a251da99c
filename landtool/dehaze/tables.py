"""Recovery by table: a pixel's new value depends on its value and on how thick the air is there, 8 bits each."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.types import Image

Levels = NDArray[np.uint8]
Tables = NDArray[np.uint8]


def recover_by_tables(image: Image, levels: Levels, tables: Tables) -> Image:
    """Return tables[c, image[y, x, c] + 256 levels[y, x]] of a picture (H, W, 3); a new array of its shape.

    levels: (H, W) uint8. tables: (3, 65536) uint8, for each colour: rows of 256 values, a row for each level.
    """
    planes = [
        looked_up(np.asarray(plane, np.uint8), levels, table)
        for plane, table in zip(cv2.split(image), tables, strict=True)
    ]
    return np.asarray(cv2.merge(planes), dtype=np.uint8)


def looked_up(low: Levels, high: Levels, table: Tables) -> Levels:
    """Return table[low + 256 high], (H, W) uint8 as both; table: (65536,) uint8."""
    # two bytes beside each other, the lower first, are one index of 16 bits
    pair = np.asarray(cv2.merge((low, high)))
    return np.asarray(cv2.LUT(pair.view("<u2")[..., 0], table), dtype=np.uint8)
