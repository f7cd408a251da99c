"""The dark channel prior as it is usually written: dense, at the full size, in floats; others are compared with it."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.tone import srgb_decode, srgb_encode
from landtool.types import Image

PATCH_PX, OMEGA, T0, RADIUS_PX, EPSILON, SHARE = 15, 0.95, 0.1, 60, 1e-3, 0.001
Values = NDArray[np.float32]


def textbook(image: Image, *, linear: bool = False) -> Image:
    """Return a picture (H, W, 3) dehazed in its encoded values, or in linear light."""
    values = (srgb_decode(image / np.float32(255.0)) if linear else image / np.float32(255.0)).astype(np.float32)
    patch = cv2.getStructuringElement(cv2.MORPH_RECT, (PATCH_PX, PATCH_PX))
    dark = cv2.erode(values.min(axis=2), patch).ravel()
    brightest = np.argsort(dark)[-max(int(dark.size * SHARE), 1) :]
    air = np.maximum(values.reshape(-1, 3)[brightest].mean(axis=0), np.float32(1.0 / 255.0))
    coarse = 1.0 - OMEGA * cv2.erode((values / air).min(axis=2), patch)
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) / np.float32(255.0), dtype=np.float32)
    t = np.maximum(_guided(grey, coarse.astype(np.float32)), T0)[..., None]
    clear = np.clip((values - air) / t + air, 0.0, 1.0)
    made: Image = np.rint(255.0 * (srgb_encode(clear) if linear else clear)).astype(np.uint8)
    return made


def _guided(guide: Values, values: Values) -> Values:
    def mean(part: NDArray[Any]) -> Values:
        return np.asarray(cv2.boxFilter(part, cv2.CV_32F, (2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1)), dtype=np.float32)

    mean_i, mean_p = mean(guide), mean(values)
    a = (mean(guide * values) - mean_i * mean_p) / (mean(guide * guide) - mean_i * mean_i + np.float32(EPSILON))
    b = mean_p - a * mean_i
    return mean(a) * guide + mean(b)
