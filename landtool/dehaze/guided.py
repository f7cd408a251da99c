"""Step 4, the quick way: the guided filter fits the transmission to the picture's edges.

K. He, J. Sun, X. Tang, Guided image filtering, 2013; K. He, J. Sun, Fast guided filter, 2015.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from landtool.dehaze.air import Map
from landtool.geometry import Array
from landtool.types import Image


@dataclass(frozen=True, eq=False)
class Coefficients:
    """q = a I + b: what turns a guide I into the filtered map. Both (h, w) float32."""

    a: Map
    b: Map

    def applied(self, guide: Image) -> Map:
        """Return a I + b (H, W) for a guide (H, W) of 8 bits, 255 of which are 1.

        A guide larger than the coefficients has them interpolated.
        """
        height, width = guide.shape
        a, b = self.a / np.float32(255.0), self.b
        if self.a.shape != guide.shape:
            a = np.asarray(cv2.resize(a, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
            b = np.asarray(cv2.resize(b, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
        a *= guide
        a += b
        return a


def guided_coefficients(guide: Image, values: Map, radius_px: int, epsilon: float) -> Coefficients:
    """Return the guided filter's coefficients for values (H, W) and a guide (H, W) of 8 bits, 255 of which are 1.

    Windows are squares of side 2 radius_px + 1; beyond the border nothing counts. epsilon: edges whose variance is
    below it are smoothed over.
    """
    # in double precision: a variance is a small difference of large numbers, and epsilon may be smaller still
    window = _Window(guide.shape, radius_px)
    i, p = guide / 255.0, values.astype(np.float64)
    mean_i, mean_p = window.mean(i), window.mean(p)
    # a_k = (mean(I p) - mean(I) mean(p)) / (var(I) + epsilon),  b_k = mean(p) - a_k mean(I)
    variance = np.maximum(window.mean(i * i) - mean_i * mean_i, 0.0)
    a = (window.mean(i * p) - mean_i * mean_p) / (variance + epsilon)
    b = mean_p - a * mean_i
    # q_i = mean over the windows k around i, of a_k I_i + b_k
    return Coefficients(window.mean(a).astype(np.float32), window.mean(b).astype(np.float32))


class _Window:
    """The mean over square windows, of what lies in the picture."""

    def __init__(self, shape: tuple[int, ...], radius_px: int) -> None:
        height, width = shape
        # a window wider than the picture holds no more than the picture
        self._size = (2 * min(radius_px, width) + 1, 2 * min(radius_px, height) + 1)
        self._share = 1.0 / (_counts(height, radius_px)[:, None] * _counts(width, radius_px)[None, :])

    def mean(self, values: Array) -> Array:
        """Return the mean (H, W) of values (H, W) float64 in the window around each."""
        total = cv2.boxFilter(values, cv2.CV_64F, self._size, normalize=False, borderType=cv2.BORDER_CONSTANT)
        mean: Array = total * self._share
        return mean


def _counts(length: int, radius_px: int) -> Array:
    """Return how many places (length,) of a row lie at most a radius away from each."""
    place = np.arange(length)
    counts: Array = np.minimum(place + radius_px, length - 1) - np.maximum(place - radius_px, 0) + 1.0
    return counts
