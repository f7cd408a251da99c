"""Whether the letter stands inside a ring: what tells the pad from round signs with a red border.

The disc inside the ring is read along circles, on which turning the pad is a shift; the letter's own circles are laid
over it at every angle, and the best correlation counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.target.ellipse import Ellipse
from landtool.types import Image

_ANGLES = 72
_CIRCLES = 12
_TILTS, _SIDES = (
    (0.08, 0.16),
    8,
)  # how far off its ellipse's middle a circle's centre may be seen, in how many directions
_FINE = 4  # samples of the letter a step in either direction


@dataclass(frozen=True)
class LetterSight:
    """The letter inside a ring: its correlation in [-1, 1] with the picture at its best turn.

    turn_rad: of the print's right within the ellipse: the letter's (u, v), right and down, in radii, is seen at
    (x, y) = (sx p, sy (slant p + sqrt(1 - slant^2) q)) about the ellipse's middle, (p, q) = (u, v) turned by it.
    Half a turn more fits as well.
    """

    likeness: float
    turn_rad: float


def letter_likeness(image: Image, ring: Ellipse, pad: PadSpec) -> float | None:
    """Return the likeness of `find_letter`."""
    seen = find_letter(image, ring, pad)
    return None if seen is None else seen.likeness


def find_letter(image: Image, ring: Ellipse, pad: PadSpec) -> LetterSight | None:
    """Return how the pad's letter is seen inside a ring.

    image: (H, W, 3) BGR uint8. ring: the outer circle. None for a pad without a letter or ring, where less than half
    of the disc is in the picture, and where it is all of one brightness.
    """
    pattern, radii = _pattern(pad)
    if pattern is None:
        return None
    u, v = _views(radii.tobytes())
    across = np.sqrt(1.0 - ring.slant**2)
    x = ring.cx_px + ring.sx_px * u
    y = ring.cy_px + ring.sy_px * (ring.slant * u + across * v)
    height, width = image.shape[:2]
    weight = ((x > 0.0) & (x < width - 1.0) & (y > 0.0) & (y < height - 1.0)) * radii[:, None]
    if weight[0].sum() < 0.5 * _ANGLES * radii.sum():
        return None
    return _best_correlation(_smoothed(image, ring, x, y), weight, pattern)


@lru_cache(maxsize=8)
def _views(radii: bytes) -> tuple[Array, Array]:
    """Return places (views, circles, angles) on circles of these radii in the unit disc, as seen from several sides.

    An ellipse does not say where in it the circle's centre is seen: towards b a view maps (u, v), u along b,
    to (u + b, v sqrt(1 - b^2)) / (1 + b u), which leaves the unit circle where it is and lines straight.
    """
    angle = (np.arange(_ANGLES) + 0.5) * (2.0 * np.pi / _ANGLES)
    radius = np.frombuffer(radii)[:, None]
    views = [(radius * np.cos(angle), radius * np.sin(angle))]
    for b in _TILTS:
        for turn in np.arange(_SIDES) * (2.0 * np.pi / _SIDES):
            u, v = radius * np.cos(angle - turn), radius * np.sin(angle - turn)
            u, v = (u + b) / (1.0 + b * u), v * np.sqrt(1.0 - b * b) / (1.0 + b * u)
            views.append((np.cos(turn) * u - np.sin(turn) * v, np.sin(turn) * u + np.cos(turn) * v))
    return np.stack([u for u, _ in views]), np.stack([v for _, v in views])


def _smoothed(image: Image, ring: Ellipse, x: Array, y: Array) -> Array:
    """Sample the brightness at places of any shape, blurred where rings are so large that pixels would be skipped."""
    step = max(1, int(min(ring.sx_px, ring.sy_px) / 24.0))
    left, top = (max(0, int(np.floor(v.min())) - step) for v in (x, y))
    right, bottom = (int(np.ceil(v.max())) + step + 1 for v in (x, y))
    grey = image[top:bottom, left:right, 1]  # green: the letter is dark in it, and so is a red one
    if step > 1:
        grey = np.asarray(cv2.blur(grey, (step, step)), np.uint8)
    columns, rows = ((v - start).astype(np.float32).reshape(len(x), -1) for v, start in ((x, left), (y, top)))
    sampled = cv2.remap(grey, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, np.float64).reshape(x.shape)


def _best_correlation(seen: Array, weight: Array, pattern: Array) -> LetterSight | None:
    """Return the largest weighted correlation of `seen` (views, circles, angles) with the pattern at any angle.

    r = (<w s p> - <w s><w p> / <w>) / sqrt((<w s s> - <w s>^2 / <w>) (<w p p> - <w p>^2 / <w>)), all shifts at once.
    """
    total = weight.sum(axis=(1, 2), keepdims=True)
    centred = seen - (weight * seen).sum(axis=(1, 2), keepdims=True) / total
    energy = (weight * centred**2).sum(axis=(1, 2))[:, None]
    total = total[:, :, 0]
    if (energy < total).all():  # less than one grey level of contrast
        return None
    product = _over_shifts(weight * centred, pattern)
    sums, squares = _over_shifts(weight, pattern), _over_shifts(weight, pattern**2)
    spread = np.maximum(squares - sums**2 / total, 1e-9)
    alike = product / np.sqrt(np.maximum(energy, 1e-9) * spread)
    best = int(alike.argmax())
    # the pattern begins at the print's top, a quarter turn before its right
    turn = (best % _ANGLES + _ANGLES // 4) * 2.0 * float(np.pi) / _ANGLES
    return LetterSight(float(alike.ravel()[best]), turn % float(np.pi))


def _over_shifts(fixed: Array, shifted: Array) -> Array:
    """Return (views, angles) sums of fixed * shifted over all places, for every shift of the latter."""
    spectrum = np.fft.rfft(fixed, axis=2) * np.conj(np.fft.rfft(shifted, axis=1))
    return np.asarray(np.fft.irfft(spectrum.sum(axis=1), _ANGLES))


@lru_cache(maxsize=8)
def _pattern(pad: PadSpec) -> tuple[NDArray[np.float64] | None, Array]:
    """Return how white the print is on circles (circles, angles), and their radii (circles,) for a ring of radius 1."""
    if pad.ring is None or pad.letter is None:
        return None, np.zeros(0)
    outline = pad.letter_outline_m / (pad.ring.outer * pad.diameter_m / 2.0)
    inner = pad.quiet_zone.side / pad.ring.outer if pad.quiet_zone else 0.0
    outer = 0.96 * pad.ring.inner / pad.ring.outer
    edges = np.linspace(inner * 1.1, outer, _CIRCLES + 1)
    radii = (edges[1:] + edges[:-1]) / 2.0
    fine_r = edges[0] + (np.arange(_CIRCLES * _FINE) + 0.5) * (outer - edges[0]) / (_CIRCLES * _FINE)
    fine_a = (np.arange(_ANGLES * _FINE) + 0.5) * (2.0 * np.pi / (_ANGLES * _FINE))
    x, y = (fine_r[:, None] * f(fine_a)[None, :] for f in (np.cos, np.sin))
    white = 1.0 - _inside(x, y, outline)
    return white.reshape(_CIRCLES, _FINE, _ANGLES, _FINE).mean(axis=(1, 3)), radii


def _inside(x: Array, y: Array, outline: Array) -> Array:
    """Return 1 where a place lies in a polygon (N, 2), by how often a ray from it crosses the sides."""
    odd = np.zeros(x.shape, np.bool_)
    for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if ay != by:
            odd ^= ((ay > y) != (by > y)) & (x < (bx - ax) * (y - ay) / (by - ay) + ax)
    return odd.astype(np.float64)
