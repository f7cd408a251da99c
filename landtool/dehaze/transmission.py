"""Step 3: the transmission, how much of a scene's light reaches the camera."""

from __future__ import annotations

import cv2
import numpy as np

from landtool.dehaze.air import Map
from landtool.dehaze.dark_channel import least_nearby
from landtool.geometry import Array
from landtool.types import Image

# no air is darker than the darkest grey level: what is divided by it stays finite
_DARKEST_AIR = 1.0 / 255.0


def transmission(image: Image, airlight: Array, patch_px: int, omega: float) -> Map:
    """Return the transmission (H, W) of a picture (H, W, 3), constant in patches of side patch_px; in [0, 1].

    airlight: (3,) in [0, 1]. omega: the share of the haze that is taken off.
    """
    return transmission_of_least(least_nearby(image, patch_px), airlight, omega)


def transmission_of_least(least: Image, airlight: Array, omega: float) -> Map:
    """Return the same from the least values nearby (H, W, 3), by `least_nearby` or a part of them."""
    # t(x) = 1 - omega min over y in the patch of x, of min over the colours c, of I_c(y) / A_c
    air = 255.0 * np.maximum(airlight, _DARKEST_AIR)
    blue, green, red = (plane / np.float32(a) for plane, a in zip(cv2.split(least), air, strict=True))
    hazy = np.minimum(np.minimum(blue, green), red)
    # a patch brighter than the airlight would have less than none
    made: Map = np.clip(np.float32(1.0) - np.float32(omega) * hazy, 0.0, 1.0, dtype=np.float32)
    return made
