"""The pad behind a network's box: where exactly its ring is, and whether it is the pad at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.target.letter import letter_likeness
from landtool.target.print_fit import is_sure, register_print
from landtool.target.ring import fit_ring
from landtool.tone import Tone
from landtool.types import Image

# Below the first the ring is too thin to be told from others by itself, beyond the second too little of the blur is
# left that the fit of the whole print is made for
_THIN_PX, _SMALL_PX = 30.0, 48.0
# Nearer pads are seen in steeper perspective than the letter is looked for in; no sign is taken for one there
_LETTER_PX = 200.0
# Correlations below which it is no pad: those of one pad in fifty, and of three in four signs a network took for one
_LEAST_LETTER, _LEAST_PRINT = 0.6, 0.5
# In fog the print is no longer to be told from anything else
_LEAST_CONTRAST = 30.0


@dataclass(frozen=True, eq=False)
class Sight:
    """What is seen at a box.

    box_px: (4,) of the ring's outer circle, clipped to the picture; None where the picture does not show it.
    is_doubtful: the picture would show the print there, and shows something else.
    """

    box_px: Array | None
    is_doubtful: bool


def look_at(image: Image, box_px: Array, pad: PadSpec, tone: Tone = "srgb") -> Sight:
    """Look for the pad at a box (4,) x_min, y_min, x_max, y_max, OpenCV's pixels, in a picture (H, W, 3) BGR uint8."""
    height, width = image.shape[:2]
    side = float((box_px[2:] - box_px[:2]).max())
    ring = fit_ring(image, box_px, pad, tone)
    if ring is not None and side >= _THIN_PX:
        found = ring.box_px(width, height)
        likeness = letter_likeness(image, ring.ellipse, pad) if side <= _LETTER_PX else None
        return Sight(found, likeness is not None and likeness < _LEAST_LETTER)
    if side <= _SMALL_PX and _is_whole(box_px, width, height) and pad.letter is not None:
        fitted = register_print(image, box_px, pad, tone)
        if fitted is not None and is_sure(fitted, box_px):
            return Sight(fitted.box_px(width, height), False)
        if ring is None:
            is_other = fitted is None or fitted.likeness < _LEAST_PRINT
            return Sight(None, is_other and _contrast(image, box_px) >= _LEAST_CONTRAST)
    return Sight(None if ring is None else ring.box_px(width, height), False)


def _contrast(image: Image, box_px: Array) -> float:
    """Return how far apart dark and bright are in a box, grey levels: from the first to the last tenth."""
    x0, y0, x1, y1 = (max(0, round(float(edge))) for edge in box_px)
    low, high = np.percentile(image[y0 : y1 + 1, x0 : x1 + 1, 1], (10.0, 90.0))
    return float(high - low)


def _is_whole(box_px: Array, width: int, height: int) -> bool:
    """Whether a box lies in the picture and does not touch its border."""
    return bool((box_px[:2] > 0.5).all() and (box_px[2:] < np.array([width, height]) - 1.5).all())
