"""Contact sheets: many pictures small on one, in a grid."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from landtool.types import Image

_GROUND = 32  # grey of what no picture covers
_GAP_PX = 2


def evenly(total: int, count: int) -> list[int]:
    """Return up to `count` indices spread evenly over range(total), the first and the last among them.

    >>> evenly(9, 3), evenly(2, 5), evenly(0, 5)
    ([0, 4, 8], [0, 1], [])
    """
    if count >= total:
        return list(range(total))
    return [round(i * (total - 1) / (count - 1)) for i in range(count)] if count > 1 else [0][:count]


def fitted(image: Image, width: int, height: int) -> tuple[Image, float]:
    """Return a picture (h, w, 3) scaled to lie inside width x height, its shape kept, and the scale."""
    scale = min(width / image.shape[1], height / image.shape[0])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    way = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, size, interpolation=way), np.uint8), scale


def contact_sheet(pictures: Iterable[Image], columns: int, rows: int, width: int, height: int) -> Image:
    """Return pictures (height, width, 3) or smaller in a grid, row by row; free places stay dark.

    Pictures beyond columns x rows are left out.
    """
    shape = rows * (height + _GAP_PX) - _GAP_PX, columns * (width + _GAP_PX) - _GAP_PX, 3
    sheet = np.full(shape, _GROUND, np.uint8)
    for place, picture in zip(range(columns * rows), pictures, strict=False):
        row, column = divmod(place, columns)
        h, w = picture.shape[:2]
        top = row * (height + _GAP_PX) + (height - h) // 2
        left = column * (width + _GAP_PX) + (width - w) // 2
        sheet[top : top + h, left : left + w] = picture
    return sheet
