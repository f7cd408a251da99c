"""The whole print of a small pad in a picture, registered to a fraction of a pixel.

Where the ring is only a pixel or two wide, all that is printed is fitted at once: an affine map, a Gaussian blur with a
direction (lens, motion), white, black and the ground's light on each side of the board, by Gauss-Newton steps on linear
light with Tukey's weights. What is well beyond the board takes no part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.target.ellipse import Ellipse
from landtool.target.print_model import (
    Placed,
    Plane,
    Print,
    correlation,
    limited_blur,
    print_of,
    shown,
    slopes_of,
    to_pixels,
)
from landtool.target.print_start import find_starts
from landtool.tone import Tone, linear_lut
from landtool.types import Image

_LEAST_SIDE_PX, _MOST_SIDE_PX = 7.0, 64.0
_MARGIN, _MARGIN_PX = 0.35, 2.0  # of the patch around the box
_LEAST_COVER = 0.35  # of a pixel by the board, to take part
_LEAST_PIXELS = 40
_FIRST_STEPS, _MOST_STEPS = 3, 9
_STOP = 0.005  # of the radius: the next step would be several times smaller
_LONGEST_STEP = 0.25
_TUKEY = 4.5
_LEAST_SCALE = 0.012  # of white: what no model explains
_DISC = 1.1  # squared radius of what counts for the likeness
_ALIKE = 5.0  # how many neighbouring pixels' errors are one
_SURE = 0.9  # likeness at which no other start is tried
_ROOM, _ROOM_PX = 1.25, 2.0  # about the print, of its radii, in what is fitted
# What is thought before the picture is seen: standard deviations, and the means of blur (px^2) and ground (of white)
_MAP_SIGMA = 0.12  # of one step, radii
_BLUR, _BLUR_SIGMA = np.array([0.45, 0.0, 0.45]), 0.5
_GROUND, _LIGHT_SIGMA = 0.4, 0.3
_LEAST_BLUR, _MOST_BLUR = 0.08, 6.0  # variances, px^2

# What a print must show, or it is none: found on generated pictures as what parts good fits from bad
_LEAST_LIKENESS = 0.65
_LEAST_SHARE = 0.55
_MOST_SIGMA = 0.032  # of the box's longer side
_MOST_CHANGE, _MOST_CHANGE_PX = 0.15, 2.0
_MOST_LAST_STEP = 0.02


@dataclass(frozen=True, eq=False)
class PrintFit:
    """The outer circle of a print's ring as an ellipse in the picture, OpenCV's pixels.

    axes: (2, 2) pixels a radius, right and down on the print; half a turn more may be as right. likeness: correlation
    of the fitted print with the pixels within the ring, in [0, 1]. share: weight of the pixels there that agree.
    residual: robust standard deviation of the pixels about the print, of its contrast. sigma_px: standard error of the
    edges of the ellipse's box, the largest of them.
    """

    ellipse: Ellipse
    axes: Array
    likeness: float
    share: float
    residual: float
    sigma_px: float

    def box_px(self, width: int, height: int) -> Array:
        """Return the tight box (4,) x_min, y_min, x_max, y_max, clipped to a picture of this size."""
        return np.clip(self.ellipse.box_px, -0.5, np.array([width, height] * 2) - 0.5)


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A print placed in a patch. light: (6,) of white, of black below white, of the ground on four sides."""

    placed: Placed
    light: Array
    likeness: float
    share: float
    scale: float
    information: Array  # (15, 15), of pixels with errors of standard deviation 1
    moved: float  # by the last step, radii


def fit_print(image: Image, box_px: Array, pad: PadSpec, tone: Tone = "srgb") -> PrintFit | None:
    """Find the ring's outer circle near a box (4,) x_min, y_min, x_max, y_max by all that is printed in and around it.

    None when the picture does not show the print, when the box is cut by the picture's border or longer than 64
    pixels, and for a pad without a ring or a board. image: (H, W, 3) BGR uint8. box_px: its edges may be off by 12 %
    and 1.5 pixels.
    """
    fitted = register_print(image, box_px, pad, tone)
    return fitted if fitted is not None and is_sure(fitted, box_px) else None


def is_sure(fitted: PrintFit, box_px: Array) -> bool:
    """Return whether a fit that began at a box is to be trusted more than the box."""
    box = np.asarray(box_px, dtype=np.float64)
    side = float((box[2:] - box[:2]).max())
    change = float(np.abs(fitted.ellipse.box_px - box).max())
    return (
        fitted.likeness >= _LEAST_LIKENESS
        and fitted.share >= _LEAST_SHARE
        and fitted.sigma_px <= _MOST_SIGMA * side
        and change <= _MOST_CHANGE * side + _MOST_CHANGE_PX
    )


def register_print(image: Image, box_px: Array, pad: PadSpec, tone: Tone = "srgb") -> PrintFit | None:
    """Return the best fit near a box, however poor; None where none is possible or none comes to rest.

    Arguments as `fit_print`. Its likeness tells whether the pad is there at all.
    """
    box, what = np.asarray(box_px, dtype=np.float64), print_of(pad, tone)
    size = box[2:] - box[:2]
    if what is None or not (size.min() >= _LEAST_SIDE_PX and size.max() <= _MOST_SIDE_PX):
        return None
    end = np.array([image.shape[1], image.shape[0]]) - 0.5
    if (box[:2] <= 0.0).any() or (box[2:] >= end - 0.5).any():
        return None
    light, red, corner = _patch(image, box, tone)
    best, most = None, 0.0
    for start in find_starts(-light, red, box - np.tile(corner, 2), pad, tone):
        now = _fit(light, what, Placed(start.axes, start.centre, np.array([0.6, 0.0, 0.6])), None, _FIRST_STEPS)
        if now is not None:
            area = abs(float(np.linalg.det(now.placed.axes)))
            told = -area * math.log(1.0 - min(max(now.likeness, 0.0), 0.999) ** 2)
            if told > most:
                best, most = now, told
            if now.likeness > _SURE:
                break
    if best is not None:
        best = _fit(light, what, best.placed, best.light, _MOST_STEPS)
    if best is None or best.moved > _MOST_LAST_STEP:
        return None
    return _result(best, corner)


def _patch(image: Image, box: Array, tone: Tone) -> tuple[Plane, Plane, Array]:
    """Return light and redness (h, w) around a box, and the pixel (2,) they begin at."""
    margin = _MARGIN * float((box[2:] - box[:2]).max()) + _MARGIN_PX
    x0, y0 = (max(0, math.floor(v - margin)) for v in box[:2])
    x1, y1 = (math.ceil(v + margin) + 1 for v in box[2:])
    part = image[y0:y1, x0:x1]
    table = linear_lut(tone)
    # the luma is what codecs keep sharp
    light, green, red = table[cv2.cvtColor(part, cv2.COLOR_BGR2GRAY)], table[part[:, :, 1]], table[part[:, :, 2]]
    redness = red - green * (red.sum() / max(float(green.sum()), 1e-6))
    return light, redness, np.array([x0, y0], np.float64)


@dataclass(frozen=True, eq=False)
class _Pixels:
    """The N pixels of a patch that take part. u, v: on the print. lights: (6, N) how the light adds up in each."""

    index: NDArray[np.int64]
    u: Array
    v: Array
    cover: Array
    lights: Array


def _pixels(placed: Placed, flat: Plane) -> _Pixels:
    columns = flat.shape[1]
    index = np.flatnonzero(flat[:, :, 1] > _LEAST_COVER)
    values = flat.reshape(-1, 2)[index].astype(np.float64)
    dark, cover = values.T
    place = np.stack([index % columns, index // columns]) - placed.centre[:, None]
    u, v = np.linalg.inv(placed.axes) @ place
    side = np.where(np.abs(u) > np.abs(v), np.where(u > 0.0, 0, 1), np.where(v > 0.0, 2, 3))
    lights = np.zeros((6, len(index)))
    lights[0], lights[1] = cover, -dark
    lights[2 + side, np.arange(len(index))] = 1.0 - cover
    return _Pixels(index, u, v, cover, lights)


def _first_light(lights: Array, seen: Array, cover: Array) -> Array:
    white = float(np.percentile(seen, 85))
    weights = cover / (0.2 + 0.8 * np.clip(seen / max(white, 1e-6), 0.0, 1.2))
    weak = np.diag([1e-6, 1e-6, 0.5, 0.5, 0.5, 0.5])
    right = (lights * weights) @ seen + weak @ np.full(6, _GROUND * white)
    return np.linalg.solve((lights * weights) @ lights.T + weak, right)


def _fit(patch: Plane, what: Print, placed: Placed, light: Array | None, most_steps: int) -> _Fitted | None:
    """Fit the print to the part of a patch that is about it; None when it leaves it or turns inside out."""
    half = _ROOM * np.linalg.norm(placed.axes, axis=1) + _ROOM_PX
    first = np.maximum(np.floor(placed.centre - half), 0.0).astype(int)
    last = np.ceil(placed.centre + half).astype(int) + 1
    part = patch[first[1] : max(last[1], 0), first[0] : max(last[0], 0)]
    if not part.size:
        return None
    fitted = _rested(part, what, replace(placed, centre=placed.centre - first), light, most_steps)
    return fitted and replace(fitted, placed=replace(fitted.placed, centre=fitted.placed.centre + first))


def _rested(seen_at: Plane, what: Print, placed: Placed, light: Array | None, most_steps: int) -> _Fitted | None:
    """Take Gauss-Newton steps until the print rests."""
    rows, columns = seen_at.shape
    fitted = None
    for _ in range(most_steps):
        fine = shown(what, placed, rows, columns)
        pixels = _pixels(placed, to_pixels(np.ascontiguousarray(fine[1:-1, 1:-1])))
        if len(pixels.index) < _LEAST_PIXELS:
            return None
        seen = seen_at.ravel()[pixels.index].astype(np.float64)
        if light is None:
            light = _first_light(pixels.lights, seen, pixels.cover)
        white, black = float(light[0]), float(light[1])
        if not (white > 1e-3 and black > 1e-3):
            return None
        slopes = _slopes(fine, light)[:, pixels.index]
        x, y = slopes[:2]
        # a print moved by d is seen changed by -gradient . d
        moves = [-pixels.u * x, -pixels.v * x, -pixels.u * y, -pixels.v * y, -x, -y]
        jacobian = np.concatenate([np.stack(moves), slopes[2:], pixels.lights])
        model = light @ pixels.lights
        left = seen - model
        base = pixels.cover**2 / (0.15 + 0.85 * np.clip(model / white, 0.0, 1.2))
        scale = max(1.4826 * float(np.median(np.abs(left) * np.sqrt(base))), _LEAST_SCALE * white)
        agree = np.maximum(1.0 - base * (left / (_TUKEY * scale)) ** 2, 0.0) ** 2
        weighted = jacobian * (base * agree)
        radius = math.sqrt(abs(float(np.linalg.det(placed.axes))))
        prior, pull = _prior(placed, light, radius)
        information = weighted @ jacobian.T + np.diag(prior) * scale**2
        step = np.linalg.solve(information, weighted @ left + pull * scale**2)
        moved = float(np.abs(step[:6]).max()) / radius
        disc = pixels.u**2 + pixels.v**2 < _DISC
        share = float((base * agree)[disc].sum()) / max(float(base[disc].sum()), 1e-9)
        fitted = _Fitted(placed, light, correlation(model[disc], seen[disc]), share, scale, information, moved)
        if moved < _STOP:
            break
        step *= min(1.0, _LONGEST_STEP / moved)
        placed, light = _stepped(placed, step), light + step[9:]
    return fitted


def _slopes(fine: Plane, light: Array) -> Array:
    """Return how the picture changes (5, h w): along x and y, and with the blur's variances along x, mixed, and y."""
    ground = float(light[2:].mean())
    weights = np.array([-light[1], light[0] - ground], np.float32)
    return slopes_of(fine[:, :, 0] * weights[0] + fine[:, :, 1] * weights[1]).astype(np.float64)


def _prior(placed: Placed, light: Array, radius: float) -> tuple[Array, Array]:
    """Return the information (15,) of what is thought before, and its pull (15,) on the step from here."""
    white = float(light[0])
    prior = np.repeat([(_MAP_SIGMA * radius) ** -2, _BLUR_SIGMA**-2, (_LIGHT_SIGMA * white) ** -2], (6, 3, 6))
    pull = np.zeros(15)
    pull[6:9] = (_BLUR - placed.blur) * prior[6:9]
    pull[11:] = (_GROUND * white - light[2:]) * prior[11:]
    return prior, pull


def _stepped(placed: Placed, step: Array) -> Placed:
    blur = limited_blur(placed.blur + step[6:9], _LEAST_BLUR, _MOST_BLUR)
    axes = placed.axes + step[:4].reshape(2, 2)
    return Placed(axes, placed.centre + step[4:6], blur)


def _result(fitted: _Fitted, corner: Array) -> PrintFit:
    axes, (cx, cy) = fitted.placed.axes, fitted.placed.centre + corner
    shape = axes @ axes.T
    half = np.sqrt(np.diag(shape))
    covariance = np.linalg.inv(fitted.information) * fitted.scale**2 * _ALIKE
    variances = []
    for row in (0, 1):
        for sign in (-1.0, 1.0):
            gradient = np.zeros(15)
            gradient[2 * row : 2 * row + 2] = sign * axes[row] / half[row]
            gradient[4 + row] = 1.0
            variances.append(float(gradient @ covariance @ gradient))
    ellipse = Ellipse(float(cx), float(cy), float(half[0]), float(half[1]), float(shape[0, 1] / half.prod()))
    residual = fitted.scale / float(fitted.light[1])
    return PrintFit(ellipse, axes, fitted.likeness, fitted.share, residual, math.sqrt(max(0.0, *variances)))
