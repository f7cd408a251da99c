"""Where two lines of a board cross, to a few hundredths of a pixel.

About a crossing of two black-white edges the blurred picture in linear light is

    I(u) = b + g . (u - c) + a erf(n1 . (u - c) / (s sqrt 2)) erf(n2 . (u - c) / (s sqrt 2))

with the unit normals n1, n2 of the lines, blur s, contrast a and a plane of light b, g. Gauss-Newton fits all of it at
all crossings of a picture at once. The product is exact for lines at right angles; for others it keeps the symmetry
about c, which is what the place depends on. A tone curve moves the edges, but those of opposite quadrants alike: the
crossing stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from landtool.geometry import Array
from landtool.tone import linear_lut

RADIUS_PX = 2.2, 6.0  # of the round window: smaller ones hold too few pixels, larger ones know no more
_SPREAD_PX = 0.7  # of blur that strange lines come nearer
_STEPS = 12
_STOP_PX = 0.003
_PARAMETERS = 9  # c, two angles, s, a, b, g
_BLUR_PX = 0.3, 4.0
_NEAREST_LINES_RAD = 0.25
_LEAST_CONTRAST = 0.015  # of full light, half the step
_LEAST_CORRELATION = 0.9
_FLOOR_PX = 0.01


@dataclass(frozen=True, eq=False)
class Crossings:
    """Fitted crossings: pixels (N, 2); of each (N,) its standard deviation px, blur px, contrast, and if it is good."""

    pixels: Array
    sigma_px: Array
    blur_px: Array
    contrast: Array
    good: NDArray[np.bool_]


def refine_crossings(grey: NDArray[np.uint8], start_px: Array, axes_px: Array, clear_px: Array) -> Crossings:
    """Fit the crossings near `start_px` (N, 2) in a grey picture (H, W) uint8.

    axes_px: (N, 2, 2), the directions of the two lines in the picture, one a row. clear_px: (N,), how far around each
    nothing else is seen. What leaves the picture, its start or the model is not good.
    """
    count = len(start_px)
    if not count:
        return Crossings(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_))
    return _Fit(grey, start_px, axes_px, clear_px).run()


class _Fit:
    """All crossings of a picture. Parameters (N, 9): cx, cy, angle 1, angle 2, log s, a, b, gx, gy."""

    def __init__(self, grey: NDArray[np.uint8], start_px: Array, axes_px: Array, clear_px: Array) -> None:
        height, width = grey.shape
        self.start = start_px
        radius = np.clip(clear_px - _SPREAD_PX, *RADIUS_PX)
        reach = int(np.ceil(radius.max()))
        v, u = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
        self.origin = np.rint(start_px)
        # the window's middle is the first guess, not the nearest pixel
        self.u = u + (self.origin - start_px)[:, :1]
        self.v = v + (self.origin - start_px)[:, 1:]
        column, row = (self.origin[:, i : i + 1].astype(np.intp) + w for i, w in ((0, u), (1, v)))
        held = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        # soft at its rim, so that no pixel enters or leaves at once
        self.weight = np.clip(radius[:, None] + 0.5 - np.hypot(self.u, self.v), 0.0, 1.0) * held
        self.enough = self.weight.sum(axis=1) > 0.9 * np.pi * radius**2
        light = linear_lut("srgb")
        self.values = light[grey[row.clip(0, height - 1), column.clip(0, width - 1)]].astype(np.float64)
        # noise is even in encoded values: in light it goes with the curve's slope, about I^(1 - 1 / 2.4)
        smooth = light[cv2.GaussianBlur(grey, (3, 3), 0)[row.clip(0, height - 1), column.clip(0, width - 1)]]
        spread = 0.02 + smooth.astype(np.float64) ** (1.0 - 1.0 / 2.4)
        self.weight /= (spread / spread.mean(axis=1, keepdims=True)) ** 2
        self.radius = radius
        self.axes = axes_px / np.linalg.norm(axes_px, axis=2, keepdims=True)

    def run(self) -> Crossings:
        p = self._begin()
        moved = np.full(len(p), np.inf)
        for _ in range(_STEPS):
            model, jacobian = self._model(p)
            residual = self.values - model
            normal, gradient = self._normal(jacobian, residual)
            step = np.linalg.solve(normal, gradient[..., None])[..., 0]
            step = np.nan_to_num(step, nan=0.0)
            step[:, :2] = np.clip(step[:, :2], -1.5, 1.5)
            step[:, 2:4] = np.clip(step[:, 2:4], -0.3, 0.3)
            step[:, 4] = np.clip(step[:, 4], -0.5, 0.5)
            p += step
            p[:, 4] = np.clip(p[:, 4], *np.log(_BLUR_PX))
            moved = np.abs(step[:, :2]).max(axis=1)
            if (moved < _STOP_PX).all():
                break
        return self._outcome(p, moved)

    def _begin(self) -> Array:
        p = np.zeros((len(self.start), _PARAMETERS))
        for i in (0, 1):
            p[:, 2 + i] = np.arctan2(self.axes[:, i, 1], self.axes[:, i, 0])
        p[:, 4] = np.log(0.8)
        p[:, 5] = 1.0
        shape, _ = self._model(p)  # with b = g = 0 it is the pattern itself
        total = self.weight.sum(axis=1)
        total = np.where(total > 0, total, 1.0)
        mean_value, mean_shape = ((self.weight * x).sum(axis=1) / total for x in (self.values, shape))
        varied = shape - mean_shape[:, None]
        power = (self.weight * varied**2).sum(axis=1)
        p[:, 5] = (self.weight * varied * self.values).sum(axis=1) / np.where(power > 0, power, 1.0)
        p[:, 6] = mean_value - p[:, 5] * mean_shape
        return p

    def _model(self, p: Array) -> tuple[Array, Array]:
        """Return the picture (N, K) and its derivatives (N, 9, K)."""
        x, y = self.u - p[:, 0:1], self.v - p[:, 1:2]
        sigma = np.exp(p[:, 4:5])
        sides = []
        for i in (2, 3):
            cos, sin = np.cos(p[:, i : i + 1]), np.sin(p[:, i : i + 1])
            z = (cos * y - sin * x) / sigma  # from the line along (cos, sin)
            density = np.sqrt(2.0 / np.pi) * np.exp(-0.5 * z * z) / sigma
            along = cos * x + sin * y
            sides.append((erf(z / np.sqrt(2.0)), density, z * sigma, along, cos, sin))
        (e1, d1, z1, l1, c1, s1), (e2, d2, z2, l2, c2, s2) = sides
        a = p[:, 5:6]
        pattern = e1 * e2
        model = p[:, 6:7] + p[:, 7:8] * x + p[:, 8:9] * y + a * pattern
        one, two = a * d1 * e2, a * d2 * e1
        ones = np.ones_like(x)
        jacobian = np.stack([
            one * s1 + two * s2 - p[:, 7:8], -one * c1 - two * c2 - p[:, 8:9],
            -one * l1, -two * l2, -one * z1 - two * z2, pattern, ones, x, y,
        ], axis=1)  # fmt: skip
        return model, jacobian

    def _normal(self, jacobian: Array, residual: Array) -> tuple[Array, Array]:
        weighted = jacobian * self.weight[:, None, :]
        normal = weighted @ jacobian.transpose(0, 2, 1)
        # a parameter that nothing depends on must not stop the others
        diagonal = np.einsum("nii->ni", normal)
        diagonal += 1e-9 * diagonal + 1e-12
        return normal, (weighted @ residual[..., None])[..., 0]

    def _outcome(self, p: Array, moved: Array) -> Crossings:
        model, jacobian = self._model(p)
        residual = self.values - model
        normal, _ = self._normal(jacobian, residual)
        inverse = np.linalg.inv(normal)
        # sandwich: W J' diag(w r)^2 J W, the window's weights are no inverse variances
        spent = jacobian * (self.weight * residual)[:, None, :]
        covariance = inverse @ (spent @ spent.transpose(0, 2, 1)) @ inverse
        used = np.maximum((self.weight > 0.5).sum(axis=1) - _PARAMETERS, 1.0)
        few = (used + _PARAMETERS) / used
        variance = 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1]) * few
        sigma = np.sqrt(np.maximum(variance, 0.0) + _FLOOR_PX**2)
        total = np.maximum(self.weight.sum(axis=1), 1e-9)
        mean = (self.weight * self.values).sum(axis=1) / total
        varied = (self.weight * (self.values - mean[:, None]) ** 2).sum(axis=1)
        explained = 1.0 - (self.weight * residual**2).sum(axis=1) / np.maximum(varied, 1e-12)
        between = np.abs(np.sin(p[:, 2] - p[:, 3]))
        good = self.enough & (moved < 10 * _STOP_PX) & (np.abs(p[:, 5]) > _LEAST_CONTRAST)
        good &= (explained > _LEAST_CORRELATION**2) & (between > np.sin(_NEAREST_LINES_RAD))
        good &= np.hypot(p[:, 0], p[:, 1]) < np.minimum(self.radius, 3.0)
        good &= np.isfinite(p).all(axis=1) & (sigma < 0.5)
        return Crossings(self.start + p[:, :2], sigma, np.exp(p[:, 4]), p[:, 5], good)
