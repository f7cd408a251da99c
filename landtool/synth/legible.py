"""Whether an eye could find the print in a picture: what fog, shadow, blur, noise, tone and JPEG leave of it."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.pad import PadSpec
from landtool.synth.compose import Rendered
from landtool.synth.surfaces import PRINT
from landtool.tone import srgb_encode
from landtool.types import Image

Map = NDArray[np.float32]

LEAST_LEGIBLE = 20.0
"""Legibility at which one who knows where to look just makes out the ring or the H: judged by eye on 150 pictures."""

# an eye steps back from a large, noisy pad: more pixels across than these tell it nothing more
_SIDE = 48
# what changes slower than over this share of the pad is light and shadow, not the print
_SLOW, _LEAST_SLOW_PX = 0.25, 2.0
# a pad of fewer pixels, after what hides it, has no pattern
_LEAST_PIXELS = 4.0


def legibility(image: Image, rendered: Rendered, pad: PadSpec) -> float:
    """Return how well the picture (H, W, 3) of a rendered scene shows its print, 0 where it does not.

    It is a r sqrt(n), over the n pixels of the ring's disc that nothing hides: a is the standard deviation, in grey
    levels, of the part of the picture that follows the clear print; r its correlation with it. So a faint print must
    be clean (8-bit steps and JPEG drown it), a noisy one strong, and a small one both. The brightness of the paper
    against the ground does not count: a blank sheet is no pad.
    """
    sheet = rendered.seen.sheet
    if sheet is None or pad.ring is None:
        return 0.0
    radius = pad.ring.outer * pad.diameter_m / 2.0
    seen = rendered.seen.raster.coverage(PRINT)[sheet.window]
    share: Map = np.where(np.square(sheet.x_m) + np.square(sheet.y_m) <= radius * radius, seen, np.float32(0.0))
    rows, columns = np.flatnonzero(share.any(axis=1)), np.flatnonzero(share.any(axis=0))
    if not len(rows):
        return 0.0
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    clear = _stepped_back(cv2.cvtColor(sheet.albedo[part], cv2.COLOR_BGR2GRAY))
    grey = _stepped_back(cv2.cvtColor(image[sheet.window][part], cv2.COLOR_BGR2GRAY))
    return _alike(grey, np.asarray(255.0 * srgb_encode(clear), np.float32), _stepped_back(share[part]))


def _stepped_back(values: NDArray[np.generic]) -> Map:
    """Return values (H, W), of _SIDE pixels a side at most."""
    factor = min(1.0, _SIDE / max(values.shape))
    height, width = (max(1, round(n * factor)) for n in values.shape)
    return np.asarray(cv2.resize(values.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _alike(grey: Map, clear: Map, share: Map) -> float:
    """Return a r sqrt(n) of two pictures (H, W) in grey levels, over the pixels mostly covered by `share`."""
    weight = np.where(share > 0.5, share, np.float32(0.0))
    pixels = float(weight.sum())
    if pixels < _LEAST_PIXELS:
        return 0.0
    sigma = max(_SLOW * max(share.shape), _LEAST_SLOW_PX)
    a, b = (_without_slow(values, weight, sigma) for values in (grey, clear))
    aa, bb, ab = (float((weight * product).sum()) for product in (a * a, b * b, a * b))
    if not (aa > 0.0 and bb > 0.0 and ab > 0.0):
        return 0.0
    contrast, correlation = ab / math.sqrt(bb * pixels), ab / math.sqrt(aa * bb)
    return contrast * correlation * math.sqrt(pixels)


def _without_slow(values: Map, weight: Map, sigma: float) -> Map:
    """Return values (H, W) less their weighted mean about each pixel."""
    total, near = (
        cv2.GaussianBlur(each, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) for each in (values * weight, weight)
    )
    fast: Map = values - total / (near + np.float32(1e-6))
    return fast
