"""Step 2: the airlight, the colour of the haze where it is thickest."""

from __future__ import annotations

import cv2
import numpy as np

from landtool.dehaze.config import AirlightChoice
from landtool.geometry import Array
from landtool.types import Image


def airlight(image: Image, dark: Image, choice: AirlightChoice, share: float) -> Array:
    """Return the airlight (3,) float64, in [0, 1], of a picture (H, W, 3) with the dark channel (H, W) uint8.

    share: the part of the pixels, those where the dark channel is brightest, that tell it; one at least, and with the
    last of them all that equal it, so that the order of the pixels does not matter.
    """
    count = max(round(share * dark.size), 1)
    brightest = dark >= _least_of_brightest(dark, count)
    if choice == "mean":
        # A = mean of I over them
        mean = np.array(cv2.mean(image, mask=brightest.view(np.uint8))[:3]) / 255.0
        return np.minimum(mean, 1.0)  # the last digit of a mean of 255 may be above
    # He: A = I(x) at the x among them where the sum of the colours is greatest
    pixels = image[brightest].astype(np.float64)
    chosen: Array = pixels[np.argmax(pixels.sum(axis=1))] / 255.0
    return chosen


def _least_of_brightest(dark: Image, count: int) -> int:
    """Return the value of the pixel that is `count`-th when the brightest comes first."""
    histogram = np.asarray(cv2.calcHist([dark], [0], None, [256], [0.0, 256.0])).ravel()[::-1]
    # in double precision: a sum of float32 loses pixels of a large picture
    as_bright = np.cumsum(histogram, dtype=np.float64)
    return 255 - int(np.searchsorted(as_bright, count))
