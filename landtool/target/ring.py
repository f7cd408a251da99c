"""The pad's red ring in a picture, found to a fraction of a pixel from a box that is good to a few.

An ellipse is started from the box, the ring is measured along its normals, and the ellipse moves to where the lines
agree best, robustly, over shorter and shorter ways. Small rings are measured as a whole: a blur of any width leaves
the middle of a line where it is. Of large ones the last steps take the outer edge alone, as the images of concentric
circles are not concentric in perspective.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.target.ellipse import (
    BOX_ROWS,
    NO_PRIOR,
    Ellipse,
    Prior,
    circle,
    contour,
    prior_of_box,
    robust_step,
    start_ellipses,
)
from landtool.target.ring_lines import BLUR_PX, Lines, Look, Patch, measure
from landtool.tone import Tone
from landtool.types import Image

_LINES = 48
_LEAST_SIDE_PX = 6.0
_EDGE_PX = 48.0  # rings at least this wide, as they are measured, end with their outer edge alone
_COARSE = (
    Look(-0.62, 0.50, 0.032, coarse=True, whole=True, scales=(0.5, 0.2, 0.1)),
    Look(-0.50, 0.36, 0.024, coarse=True, whole=True, scales=(0.15, 0.06)),
)
_FINE = (Look(-0.42, 0.26, 0.02, coarse=False, whole=True, scales=(0.05, 0.02)),)
_EDGE = (*_FINE, Look(-0.16, 0.16, 0.015, coarse=False, whole=False, scales=(0.03, 0.015)))
_MORE_LOOKS = 4  # with the last of them, until the ellipse rests
_STOP = 0.015  # of the reach; the next move would be several times smaller
_LEAST_LINES = 10
_SLACK_PX = 0.15  # of the robust fit's scales: what noise does to any line

# What a ring must show, or it is none: found on generated pictures as what parts good fits from bad
_LEAST_SHARE = 0.55
_LEAST_LIKENESS = 0.6
_LEAST_REDNESS = 0.03
_LEAST_STEADINESS = 0.7
_MOST_SIGMA = 0.007  # of the box's longer side
_MOST_CHANGE = 0.35
_MOST_LAST_STEP = 0.03


@dataclass(frozen=True, eq=False)
class RingFit:
    """The outer circle of a ring as an ellipse in the picture, OpenCV's pixels.

    share: of the lines across the ring, of those in the picture, on which it was seen. residual_px: robust standard
    deviation of the measured places about the ellipse. sigma_px: standard error of the edges of its box that are in
    the picture, the largest of them.
    """

    ellipse: Ellipse
    share: float
    residual_px: float
    sigma_px: float

    def box_px(self, width: int, height: int) -> Array:
        """Return the tight box (4,) x_min, y_min, x_max, y_max, clipped to a picture of this size."""
        return np.clip(self.ellipse.box_px, -0.5, np.array([width, height] * 2) - 0.5)


@dataclass(frozen=True, eq=False)
class _Step:
    """An ellipse after a step, and what the step was taken on."""

    ellipse: Ellipse
    moved: float  # the largest change of its box, in units of the reach
    lines: Lines
    good: NDArray[np.bool_]
    due: NDArray[np.bool_]
    left_px: Array
    information: Array
    weights: Array


def fit_ring(image: Image, box_px: Array, pad: PadSpec, tone: Tone = "srgb") -> RingFit | None:
    """Find the ring's outer circle near a box (4,) x_min, y_min, x_max, y_max; None when the picture does not show it.

    image: (H, W, 3) BGR uint8. box_px: of the circle, clipped to the picture; its edges may be off by 15 %.
    """
    box = np.asarray(box_px, dtype=np.float64)
    side = float((box[2:] - box[:2]).min())
    if pad.ring is None or not side >= _LEAST_SIDE_PX:
        return None
    near = 0.02 * side + 1.5
    end = np.array([image.shape[1], image.shape[0]]) - 0.5
    free = np.concatenate([box[:2] > -0.5 + near, box[2:] < end - near])
    if not free.any():
        return None
    patch = Patch.around(image, box, tone)
    thickness = 1.0 - pad.ring.inner / pad.ring.outer
    found = _found_coarsely(patch, box, free, thickness)
    if found is None:
        return None
    width = 2.0 * min(found.ellipse.sx_px, found.ellipse.sy_px) / patch.shrink
    looks = _EDGE if width >= _EDGE_PX else _FINE
    for look in looks + (looks[-1],) * _MORE_LOOKS:
        found = _step(patch, found.ellipse, look, thickness, NO_PRIOR)
        if found is None:
            return None
        if look is looks[-1] and found.moved < _STOP:
            break
    return _judged(found, box, free, patch)


def _found_coarsely(patch: Patch, box: Array, free: NDArray[np.bool_], thickness: float) -> _Step | None:
    best, most = None, 0.0
    for ellipse in start_ellipses(box, free):
        step = None
        for look in _COARSE:
            step = _step(patch, ellipse, look, thickness, prior_of_box(ellipse, box, free))
            if step is None:
                break
            ellipse = step.ellipse
        if step is not None and (score := float(step.lines.quality[step.good].sum())) > most:
            best, most = step, score
    return best


def _step(patch: Patch, now: Ellipse, look: Look, thickness: float, prior: Prior) -> _Step | None:
    """Measure the ring once and move the ellipse; None when too little of it is seen."""
    ring = contour(now, circle(_LINES))
    lines = measure(patch, ring, look, thickness)
    if lines is None or np.count_nonzero(lines.weights) < _LEAST_LINES:
        return None
    reach = float(ring.reach_px.mean())
    scales = tuple(scale * reach + _SLACK_PX * patch.shrink for scale in look.scales)
    change, information, weights = robust_step(ring.jacobian, lines.offsets_px, lines.weights, scales, prior)
    explained = ring.jacobian @ change
    left = lines.offsets_px - explained
    good = (lines.weights > 0.0) & (np.abs(left) < 2.0 * scales[-1])
    if np.count_nonzero(good) < _LEAST_LINES:
        return None
    due = patch.holds(ring.points + ring.normals * explained) | good
    moved = float(np.abs(change[:4]).max()) / reach
    return _Step(now.moved(change), moved, lines, good, due, left, information, weights)


def _judged(found: _Step, box: Array, free: NDArray[np.bool_], patch: Patch) -> RingFit | None:
    """Return the fit, or None when anything about it is not as a ring's."""
    ellipse, good, due, side = found.ellipse, found.good, found.due, float((box[2:] - box[:2]).max())
    share = np.count_nonzero(good) / np.count_nonzero(due)
    redness = found.lines.redness[due]
    red, spread = float(redness.mean()), float(redness.std())
    likeness = float(np.median(found.lines.likeness[good]))
    sigma = _box_sigma_px(found, patch)
    change = float(np.abs(ellipse.box_px - box)[free].max()) / side
    if (
        share < _LEAST_SHARE
        or likeness < _LEAST_LIKENESS
        or red < max(_LEAST_REDNESS, _LEAST_STEADINESS * spread)
        or sigma > _MOST_SIGMA * side
        or change > _MOST_CHANGE
        or found.moved > _MOST_LAST_STEP
    ):
        return None
    residual = 1.4826 * float(np.median(np.abs(found.left_px[good])))
    return RingFit(ellipse, share, residual, sigma)


def _box_sigma_px(found: _Step, patch: Patch) -> float:
    """Return the standard error of the box's edges in the picture, the largest of them."""
    weights, ellipse = found.weights, found.ellipse
    variance = float(weights @ found.left_px**2) / max(float(weights.sum()), 1e-9)
    # lines that are closer than the blur say the same twice
    around = math.pi * (ellipse.sx_px + ellipse.sy_px)
    alike = max(1.0, 1.5 * _LINES * BLUR_PX * patch.shrink / around)
    covariance = np.linalg.inv(found.information) * variance * alike
    # of x_min, y_min, x_max, y_max by the ellipse's parameters
    variances = np.diag(BOX_ROWS @ covariance @ BOX_ROWS.T)
    inside = np.concatenate([ellipse.box_px[:2] > -0.5, ellipse.box_px[2:] < patch.end_px + 0.5])
    return math.sqrt(max(float(variances[inside].max(initial=0.0)), 0.0))
