"""Step 1: the dark channel, near zero in clear air because something nearby is dark in some colour."""

from __future__ import annotations

import cv2
import numpy as np

from landtool.dehaze.bands import bands
from landtool.types import Image


def dark_channel(image: Image, patch_px: int) -> Image:
    """Return the dark channel (H, W) uint8 of a picture (H, W, 3): the least of all colours in the patch around.

    patch_px: the patch's side, odd. Beyond the border nothing counts.
    """
    # dark(x) = min over y in the patch of x, of min over the colours c, of I_c(y)
    return least_colour(least_nearby(image, patch_px))


def least_nearby(image: Image, patch_px: int) -> Image:
    """Return for each pixel and each colour for itself the least value of the patch around; (H, W, 3) uint8."""
    return np.asarray(cv2.erode(image, np.ones((patch_px, patch_px), np.uint8)), dtype=np.uint8)


def least_colour(image: Image) -> Image:
    """Return the least (H, W) uint8 of the three colours of a picture (H, W, 3)."""
    height, width = image.shape[:2]
    least = np.empty((height, width), np.uint8)
    for band in bands(height, width):
        blue, green, red = cv2.split(image[band])
        np.minimum(np.minimum(blue, green), red, out=least[band])
    return least
