"""Step 5: the picture without the haze."""

from __future__ import annotations

import cv2
import numpy as np

from landtool.dehaze.air import Map
from landtool.dehaze.bands import bands
from landtool.geometry import Array
from landtool.types import Image


def recover(image: Image, airlight: Array, transmission: Map, t0: float) -> Image:
    """Return a picture (H, W, 3) as it would be without haze; a new array, within half a grey level of the equation.

    airlight: (3,) in [0, 1]. transmission: (H, W). t0: the least transmission that is believed.
    """
    made = np.empty(image.shape, np.uint8)
    for band in bands(*transmission.shape):
        # J = (I - A) / max(t, t0) + A
        gain = np.reciprocal(np.maximum(transmission[band], np.float32(t0)))
        planes = []
        for plane, air in zip(cv2.split(image[band]), (255.0 * airlight).tolist(), strict=True):
            light = np.asarray(cv2.subtract(plane, air, dtype=cv2.CV_32F))
            light *= gain
            planes.append(cv2.add(light, air, dtype=cv2.CV_8U))  # rounds and clips
        made[band] = cv2.merge(planes)
    return made
