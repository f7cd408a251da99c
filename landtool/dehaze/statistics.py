"""What a picture's numbers say of the air before it: statistics of a small copy of it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.types import Image

Statistics = NDArray[np.float32]

SMALL = (80, 60)  # width and height of the copy, whatever the picture's shape
SHARES = (0.005, 0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98, 0.995)
DARK, MIDDLE, BRIGHT = 1, 4, 7  # which of the shares says how dark a picture gets, how bright it is and gets
_DARK_PATCH = np.ones((5, 5), np.uint8)
_CELLS = 3  # the copy is cut into 3 x 3 of them
_TILE = 4  # contrast is taken in tiles of 4 x 4
# brightest colour of a pixel: where its classes end
_BRIGHTNESS = (38, 77, 128, 191, 256)
_CLASSES = np.digitize(np.arange(256), _BRIGHTNESS)
_SHARES = np.array(SHARES)
_X, _Y = (np.linspace(-1.0, 1.0, n, dtype=np.float32) for n in SMALL)


def small_copy(image: Image) -> Image:
    """Return a picture (H, W, 3) uint8 made small, `SMALL`; means over areas, which take most of the noise off."""
    return np.asarray(cv2.resize(image, SMALL, interpolation=cv2.INTER_AREA), np.uint8)


def statistics(small: Image) -> Statistics:
    """Return the statistics (N,) of a small copy (60, 80, 3) BGR uint8, in [0, 1] or a little around it.

    Quantiles of the colours (the first 27: nine of blue, of green, of red), of the dark channel, of what the colours
    lack to grey, of the brightest colour, of steps and of contrast; how dark, even and bright each ninth of the
    picture is; how colourful the bright and the dark parts are; and how things change across the picture.
    """
    least, most = _least(small), _most(small)
    dark = np.asarray(cv2.erode(least, _DARK_PATCH), np.uint8)
    lack = np.asarray(cv2.subtract(most, least), np.uint8)
    luma = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
    maps = [*cv2.split(small), dark, lack, most, _steps(luma), _contrast(least, most)]
    groups = [_quantiles([np.asarray(m) for m in maps])]
    groups += [_of_cells(dark, luma), _of_brightness(most, lack)]
    groups += [_slopes(m) for m in (dark, luma, lack)]
    return np.concatenate(groups).astype(np.float32)


def _least(small: Image) -> Image:
    b, g, r = cv2.split(small)
    return np.asarray(cv2.min(cv2.min(b, g), r), np.uint8)


def _most(small: Image) -> Image:
    b, g, r = cv2.split(small)
    return np.asarray(cv2.max(cv2.max(b, g), r), np.uint8)


def _steps(luma: Image) -> Image:
    """Return how far each pixel is from its right and lower neighbours, four times, at most 255."""
    across = cv2.absdiff(luma[:-1, 1:], luma[:-1, :-1])
    down = cv2.absdiff(luma[1:, :-1], luma[:-1, :-1])
    return np.asarray(cv2.addWeighted(across, 2.0, down, 2.0, 0.0), np.uint8)


def _contrast(least: Image, most: Image) -> Image:
    """Return the brightest less the darkest colour of each tile."""
    height, width = least.shape
    tiles = (height // _TILE, _TILE, width // _TILE, _TILE)
    bright = most.reshape(tiles).max(axis=(1, 3))
    darkest = least.reshape(tiles).min(axis=(1, 3))
    return np.asarray(bright - darkest, np.uint8)


def _quantiles(maps: Sequence[Image]) -> Statistics:
    """Return the quantiles of each map at `SHARES`, by counting: the least value that so many are not above."""
    # counted all at once, each map's values above those of the map before it
    raised = [values.ravel() + np.uint16(256 * i) for i, values in enumerate(maps)]
    counts = np.bincount(np.concatenate(raised), minlength=256 * len(maps)).cumsum()
    ends = np.array([0, *counts[255::256]])
    wanted = ends[:-1, None] + np.ceil(_SHARES * np.diff(ends)[:, None])
    values = np.searchsorted(counts, wanted) - 256 * np.arange(len(maps))[:, None]
    return np.asarray(values.ravel() / 255.0, np.float32)


def _of_cells(dark: Image, luma: Image) -> Statistics:
    """Return of each cell a low dark channel, the spread of its luma, and its brightest."""
    height, width = luma.shape[0] // _CELLS, luma.shape[1] // _CELLS
    shape = (_CELLS, height, _CELLS, width)
    order = (0, 2, 1, 3)
    of_dark, of_luma = (
        m[: _CELLS * height, : _CELLS * width].reshape(shape).transpose(order).reshape(_CELLS * _CELLS, -1)
        for m in (dark, luma)
    )
    low = np.partition(of_dark, of_dark.shape[1] // 4, axis=1)[:, of_dark.shape[1] // 4]
    return np.concatenate([low, of_luma.std(axis=1), of_luma.max(axis=1)]).astype(np.float32) / np.float32(255.0)


def _of_brightness(most: Image, lack: Image) -> Statistics:
    """Return for pixels of each class of brightness their mean lack of grey, and their share."""
    classes = _CLASSES[most.ravel()]
    counts = np.bincount(classes, minlength=len(_BRIGHTNESS))
    total = np.bincount(classes, weights=lack.ravel(), minlength=len(_BRIGHTNESS))
    # a handful of pixels says little
    return np.concatenate([total / (counts + 5.0) / 255.0, counts / most.size]).astype(np.float32)


def _slopes(values: Image) -> Statistics:
    """Return how a map rises to the right and downwards: its products with x and y in [-1, 1]."""
    height, width = values.shape
    level = values.astype(np.float32) / np.float32(255.0)
    level -= level.mean()
    return np.array([level.mean(axis=0) @ _X / width, level.mean(axis=1) @ _Y / height], np.float32) * np.float32(3.0)
