"""The pad's whole print as a picture would show it: drawn flat once, then through any affine map and any blur.

The print is measured in units of the ring's outer radius, u to the right of the print and v down it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.tone import Tone, decode, encode, srgb_decode

Plane = NDArray[np.float32]

FINE = 2  # samples along a pixel's side
MARGIN_PX = 8  # the model is drawn this much wider than it is wanted: what the blur reaches
_TEXELS_ACROSS = 1600
_TEXELS = 2048
_LEVELS = 8
_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601, as JPEG and video have it, red first
_MOST_KERNEL = 2 * FINE * MARGIN_PX - 1


@dataclass(frozen=True, eq=False)
class Print:
    """A pad's print as textures of planes (n, n, 2): darkness, 1 is black and 0 white, and the board's coverage.

    A print in parts has three (n, n, 3): darkness of all but the ring, coverage, and the darkness of the ring, whose
    paint fades and shines as it likes. levels: each averages 2x2 texels of the one before. texel: of the first, in
    radii. side: half the board's.
    """

    levels: tuple[Plane, ...]
    texel: float
    side: float


@lru_cache(maxsize=8)
def print_of(pad: PadSpec, tone: Tone, *, in_parts: bool = False) -> Print | None:
    """Return the print of a pad; None without a board or a ring, as then what is around it is not known."""
    if pad.board is None or pad.ring is None:
        return None
    texel_m = pad.extent_m / _TEXELS_ACROSS
    planes = np.zeros((_TEXELS, _TEXELS, 3 if in_parts else 2), np.float32)
    white = _luma(pad.board.color, tone)
    for shape in pad.shapes():
        points = np.zeros((_TEXELS, _TEXELS), np.uint8)
        # columns run along the pad's -y, rows along -x, in 1/16 of a texel
        place = (_TEXELS / 2.0 - 0.5 - shape.points_m[:, ::-1] / texel_m) * 16.0
        if shape.radius_m:
            column, row = place[0].round().astype(int).tolist()
            cv2.circle(points, (column, row), round(shape.radius_m / texel_m * 16.0), 1, -1, shift=4)
        else:
            cv2.fillPoly(points, [place.round().astype(np.int32)], 1, shift=4)
        darkness = 1.0 - _luma(shape.color, tone) / white
        paint: tuple[float, ...] = (darkness, 1.0)
        if in_parts:
            paint = (0.0, 1.0, darkness) if shape.color == pad.ring.color else (darkness, 1.0, 0.0)
        planes[points > 0] = paint
    levels = [planes]
    for _ in range(_LEVELS - 1):
        n = len(levels[-1]) // 2
        levels.append(np.asarray(cv2.resize(levels[-1], (n, n), interpolation=cv2.INTER_AREA), np.float32))
    radius_m = pad.ring.outer * pad.diameter_m / 2.0
    return Print(tuple(levels), texel_m / radius_m, pad.board.side / pad.ring.outer)


def _luma(color: tuple[int, int, int], tone: Tone) -> float:
    """Return the light of a grey that has a colour's luma: what is left of it when its colours are smeared."""
    encoded = encode(srgb_decode(np.array(color) / 255.0), tone)
    return float(decode(encoded @ _LUMA, tone))


@dataclass(frozen=True, eq=False)
class Placed:
    """Where a print is in a patch: pixel (column, row) = axes @ (u, v) + centre, then blurred by a Gaussian.

    axes: (2, 2), centre: (2,), pixels, integer centres. blur: (3,) the variances along x, mixed and along y, px^2;
    the pixel's own area comes on top.
    """

    axes: Array
    centre: Array
    blur: Array


def shown(what: Print, placed: Placed, rows: int, columns: int) -> Plane:
    """Return darkness and coverage (rows f, columns f, 2) with one spare sample on every side; f is `FINE`."""
    scale = math.sqrt(max(abs(float(np.linalg.det(placed.axes))), 1e-6)) * FINE  # samples a radius
    texture, texel = texture_level(what, scale)
    # sample -> pixel -> print -> texel
    inverse = np.linalg.inv(placed.axes)
    kernel = blur_kernel(placed.blur)
    reach = kernel.shape[0] // 2 + 1
    offset = (0.5 - reach) / FINE - 0.5
    matrix = np.empty((2, 3))
    matrix[:, :2] = inverse / (FINE * texel)
    matrix[:, 2] = inverse @ (offset - placed.centre) / texel + (len(texture) / 2.0 - 0.5)
    size = (columns * FINE + 2 * reach, rows * FINE + 2 * reach)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    sharp = cv2.warpAffine(texture, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=(0, 0))
    blurred = cv2.filter2D(sharp, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    cut = reach - 1
    return np.asarray(blurred[cut : blurred.shape[0] - cut, cut : blurred.shape[1] - cut], np.float32)


def texture_level(what: Print, samples_per_radius: float, finer: float = 0.0) -> tuple[Plane, float]:
    """Return the texture (n, n, 2) whose texels are about as large as samples are apart, and their size in radii.

    finer: so many halvings of the texels more.
    """
    apart = math.log2(max(1.0 / (samples_per_radius * what.texel), 1.0))
    level = min(max(math.floor(apart + 0.25 - finer), 0), _LEVELS - 1)
    return what.levels[level], what.texel * 2**level


def blur_kernel(blur: Array) -> Plane:
    """Return the kernel (n, n) of sum 1 of a Gaussian of variances (3,) xx, xy, yy, px^2, in samples."""
    xx, xy, yy = (float(v) * FINE**2 for v in blur)
    reach = min(math.ceil(2.6 * math.sqrt(max(xx, yy))), _MOST_KERNEL // 2)
    step = np.arange(-reach, reach + 1, dtype=np.float64)
    det = xx * yy - xy * xy
    power = (yy * step[None, :] ** 2 - 2.0 * xy * step[None, :] * step[:, None] + xx * step[:, None] ** 2) / det
    values = np.exp(-0.5 * power)
    return np.asarray(values / values.sum(), np.float32)


def to_pixels(fine: Plane) -> Plane:
    """Return the means (h, w) over each pixel's samples (h f, w f)."""
    rows, columns = fine.shape[0] // FINE, fine.shape[1] // FINE
    return np.asarray(cv2.resize(fine, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)


def slopes_of(fine: Plane) -> Plane:
    """Return how a drawn picture changes (5, h w): along x and y, and with its blur's variances along x, mixed, and y.

    fine: (h f + 2, w f + 2) its samples, with one spare on every side.
    """
    mid, f = fine[1:-1, 1:-1], FINE
    left, right, up, down = fine[1:-1, :-2], fine[1:-1, 2:], fine[:-2, 1:-1], fine[2:, 1:-1]
    mixed = fine[2:, 2:] - fine[2:, :-2] - fine[:-2, 2:] + fine[:-2, :-2]
    # a blurred picture changes with its variance by half its second derivative
    planes = [(right - left) * (f / 2), (down - up) * (f / 2)]
    planes += [(right + left - 2 * mid) * (f * f / 2), mixed * (f * f / 4), (down + up - 2 * mid) * (f * f / 2)]
    return np.stack([to_pixels(np.asarray(plane, np.float32)).ravel() for plane in planes])


def limited_blur(blur: Array, least: float, most: float) -> Array:
    """Return a blur's variances (3,) along x, mixed and along y with those along its own axes kept within bounds."""
    xx, xy, yy = blur
    values, vectors = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    limited = (vectors * np.clip(values, least, most)) @ vectors.T
    return np.array([limited[0, 0], limited[0, 1], limited[1, 1]])


def correlation(a: Array, b: Array) -> float:
    """Return the correlation of two (N,), in [0, 1]: what is opposite is as unlike as what is unrelated."""
    if len(a) < 2:
        return 0.0
    a, b = a - a.mean(), b - b.mean()
    return min(max(float(a @ b) / math.sqrt(max(float(a @ a) * float(b @ b), 1e-12)), 0.0), 1.0)
