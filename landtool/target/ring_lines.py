"""A ring measured along the normals of an ellipse: how its blurred profile, moved along them, agrees with the picture.

Two channels of linear light, in both of which a red ring on white is a ridge: redness (red less green), which fog and
shadow make smaller but do not move and which black on white has not, and darkness (less green), which cameras and
codecs keep several times sharper than colour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.target.ellipse import Contour
from landtool.tone import Tone, linear_lut
from landtool.types import Image

Floats = NDArray[np.floating[Any]]

BLUR_PX = 0.9  # of cameras and codecs, standard deviation, in a picture that is not enlarged
_WORK_PX = 96.0  # the picture is made smaller until the box has at most about this side
_MARGIN = 0.35  # around the box, of its longer side
_BLUR_STEP = 1.25  # kernels are made for blurs of this ratio
_MOST_HALF_KERNEL = 0.25  # of the reach: beyond it is what is around the board
_BORDER_PX = 1.0  # this near to the picture's border nothing is measured
_LEAST_LIKENESS = 0.4
_LEAST_RESPONSE = 0.35  # of the strong lines'
_STRONG = 0.75  # the quantile that is called strong


@dataclass(frozen=True)
class Look:
    """How to look along normals: from `low` to `high` about the outer edge in steps, units of the ellipse's reach.

    coarse: for a red ridge, by its likeness to a ring's, else for a dark one, by its strength. whole: for the ring,
    else for its outer edge. scales: of the robust fit to what was found, from step to step.
    """

    low: float
    high: float
    step: float
    coarse: bool
    whole: bool
    scales: tuple[float, ...]


@lru_cache(maxsize=4)
def _light(tone: Tone) -> Floats:
    return linear_lut(tone)


@dataclass(frozen=True, eq=False)
class Patch:
    """Part of a picture, made smaller by `shrink`: channels (h, w, 2) redness and darkness in linear light.

    corner_px: (2,) the picture's coordinates of its first pixel's outer corner. end_px: (2,) the picture's last
    pixels. white: green light of the brighter things inside the box.
    """

    channels: Floats
    corner_px: Array
    shrink: int
    end_px: Array
    white: float

    @classmethod
    def around(cls, image: Image, box_px: Array, tone: Tone) -> Patch:
        """Cut it out of a picture (H, W, 3) BGR uint8 around a box (4,)."""
        height, width = image.shape[:2]
        side = float((box_px[2:] - box_px[:2]).max())
        shrink = max(1, round(side / _WORK_PX))
        margin = _MARGIN * side + 2.0
        x0, y0 = (max(0, math.floor(v - margin)) for v in box_px[:2])
        x1, y1 = (min(n, math.ceil(v + margin) + 1) for v, n in zip(box_px[2:], (width, height), strict=True))
        columns, rows = (x1 - x0) // shrink, (y1 - y0) // shrink
        part = image[y0 : y0 + rows * shrink, x0 : x0 + columns * shrink]
        if shrink > 1:
            part = np.asarray(cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
        light = _light(tone)
        green, red = light[part[:, :, 1]], light[part[:, :, 2]]
        # what is white or black there has no redness, whatever the camera's white balance
        inside = np.s_[rows // 3 : rows - rows // 3, columns // 3 : columns - columns // 3]
        middle = np.sort(green[inside], axis=None)
        gain = float(red[inside].sum()) / max(float(middle.sum()), 1e-6)
        white = float(middle[int(0.8 * len(middle))])
        corner, end = np.array([x0, y0]) - 0.5, np.array([width, height]) - 1.0
        channels = np.asarray(cv2.merge([red - gain * green, -green]), np.float32)
        return cls(channels, corner, shrink, end, max(white, 1e-6))

    def along(self, ring: Contour, places: Array) -> Floats:
        """Sample (2 N, S), redness above darkness, at places (S,) on the normals, in units of the reach."""
        way = (ring.reach_px / self.shrink)[:, None] * places
        start = (ring.points - self.corner_px[:, None]) / self.shrink - 0.5
        x, y = (start[:, :, None] + ring.normals[:, :, None] * way).astype(np.float32)
        sampled = cv2.remap(self.channels, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(sampled.transpose(2, 0, 1), np.float32).reshape(-1, len(places))

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Return which of the points (2, N) are in the picture, not at its border."""
        middle = self.end_px[:, None] / 2.0
        return np.asarray((np.abs(points - middle) < middle - _BORDER_PX).all(axis=0))


@dataclass(frozen=True, eq=False)
class Lines:
    """What was measured on N normals.

    offsets_px: (N,) from the ellipse outwards to the ring's outer edge. weights: (N,), 0 where nothing was seen.
    quality: (N,) how well the best place agrees. likeness: (N,) correlation of the darkness there with the profile.
    redness: (N,) contrast of the ring where the ellipse has it, of white, in redness.
    """

    offsets_px: Array
    weights: Array
    quality: Floats
    likeness: Floats
    redness: Floats


def measure(patch: Patch, ring: Contour, look: Look, thickness: float) -> Lines | None:
    """Look for a ring of a thickness, in units of the reach; None when no line shows any."""
    reach_px, n = ring.reach_px, len(ring.reach_px)
    reach = float(reach_px.sum()) / n
    kernels = _kernels(look, thickness, round(math.log(BLUR_PX * patch.shrink / reach) / math.log(_BLUR_STEP)))
    sampled = patch.along(ring, kernels.places)
    redness = (sampled[:n] @ kernels.values[:, kernels.unmoved]) / (kernels.norm * patch.white)
    if look.coarse:
        both, likenesses = kernels.compared(sampled)
        red, likeness = both[:n], likenesses[n:]
        quality = _ringlike(red, likenesses[:n], likeness)
    else:
        quality, likeness = kernels.compared(sampled[n:])
    best = quality.argmax(axis=1)
    last = quality.shape[1] - 1
    lines, inner = np.arange(n), np.minimum(np.maximum(best, 1), last - 1)
    before, at, after = quality[lines, inner - 1], quality[lines, inner], quality[lines, inner + 1]
    # the top of the parabola through three values
    past = 0.5 * (before - after) / np.minimum(before + after - 2.0 * at, -1e-12)
    offsets = (kernels.shifts[inner] + np.minimum(np.maximum(past, -1.0), 1.0) * look.step) * reach_px
    if look.whole:
        # a blurred line of curvature 1 / r is brightest s^2 / (2 r) within its middle
        offsets += (BLUR_PX * patch.shrink) ** 2 / 2.0 / reach_px
    alike, strength = likeness[lines, inner], red[lines, inner] if look.coarse else at
    usable = patch.holds(ring.points + ring.normals * offsets) & (best == inner) & (alike > _LEAST_LIKENESS)
    if not usable.any():
        return None
    strong = max(_quantile(strength[usable], _STRONG), 1e-9)
    share = strength / strong
    return Lines(offsets, (usable & (share > _LEAST_RESPONSE)) * np.minimum(share, 1.0), at, alike, redness)


def _ringlike(red: Floats, red_likeness: Floats, dark_likeness: Floats) -> Floats:
    """Return how much each place is like a ring's: red like a ring, dark like one, and not much less red than others.

    An orange frame around the board may be more red than the ring, but has white on one side only; the H has white
    on both, but is not red.
    """
    strong = max(_quantile(red.max(axis=1), _STRONG), 1e-6)
    strength = np.maximum(red, 0.0)
    strength /= strength + 0.3 * strong
    ringlike: Floats = (0.2 + np.maximum(red_likeness, 0.0)) * np.maximum(dark_likeness, 0.0) * (0.2 + strength)
    return ringlike


def _quantile(values: Floats, share: float) -> float:
    place = int(share * len(values))
    return float(np.partition(values, place)[place])


@dataclass(frozen=True, eq=False)
class _Kernels:
    """The ring's profile at every shift along the normals.

    places: (S,) on the normals. shifts: (P,) of the outer edge. values: (S, P) the profile at each shift, mean 0
    and norm 1 over its `taps` samples. support: (S, P) 1 where it has any. norm: of the profile of height 1.
    unmoved: which shift is none.
    """

    places: Array
    shifts: Array
    values: Floats
    support: Floats
    taps: int
    norm: float
    unmoved: int

    def compared(self, sampled: Floats) -> tuple[Floats, Floats]:
        """Return the strength of the profile at each shift (N, P) in samples (N, S), and its correlation with them."""
        strength = sampled @ self.values
        energy = (sampled * sampled) @ self.support - (sampled @ self.support) ** 2 / self.taps
        return strength, strength / np.sqrt(np.maximum(energy, np.float32(1e-8)))


@lru_cache(maxsize=256)
def _kernels(look: Look, thickness: float, blur_level: int) -> _Kernels:
    blur = _BLUR_STEP**blur_level
    middle = -thickness / 2.0 if look.whole else 0.0
    half = min(thickness + 0.8 * blur, _MOST_HALF_KERNEL) if look.whole else 0.55 * thickness
    reach = math.floor(half / look.step)
    taps = 2 * reach + 1
    profile = np.array([_profile(middle + k * look.step, blur, thickness, look) for k in range(-reach, reach + 1)])
    profile -= profile.mean()
    norm = float(np.linalg.norm(profile))
    places = np.arange(look.low, look.high + look.step / 2.0, look.step)
    shifts = places[reach : len(places) - reach] - middle
    values, support = np.zeros((2, len(places), len(shifts)), np.float32)
    for k in range(len(shifts)):
        values[k : k + taps, k] = profile / norm
        support[k : k + taps, k] = 1.0
    return _Kernels(places, shifts, values, support, taps, norm, int(np.abs(shifts).argmin()))


def _profile(place: float, blur: float, thickness: float, look: Look) -> float:
    """Return the height of a blurred ring whose outer edge is at 0."""
    outer, inner = (math.erf(v / (blur * math.sqrt(2.0))) for v in (place, place + thickness))
    return 0.5 * (inner - outer) if look.whole else 0.5 * (1.0 - outer)
