"""Sub-pixel corners of a decoded tag, by registering the tag's own picture to the image.

AprilTag fits lines to the four outer edges. Once the tag is decoded its whole picture is known, and every edge of
every module can be used. In linear light the picture is blurred by the camera and lit by a plane of light:

    I(u) = (g0 + g1 x + g2 y) M(m; blur) + b,    m = H^-1 u,    (x, y) = m / half width

Gauss-Newton fits the homography H, the light g0 g1 g2, the black level b and the blur, so nothing has to be assumed
about where a blurred edge "is". The normal matrix gives the corners' covariance. Method: Lucas and Kanade, 1981; the
plane of light follows the intensity model of AprilTag 2 (Wang and Olson, 2016).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.tags.template import Template, template
from landtool.tone import Tone, encode_with_slope, linear_lut

MAX_SIDE_PX = 64.0  # larger tags are binned: their corners are at the 0.01 px level all the same
EDGE_PIXELS = 600
FLAT_STRIDE = 6  # of the pixels away from edges one in so many is kept: they only carry the light
ITERATIONS = 5
STOP_PX = 0.01  # Gauss-Newton's next step would be far smaller
START_BLUR_PX = 0.7
BLUR_RANGE_PX = (0.3, 4.0)
# Model and camera never agree exactly (demosaicing, sharpening, a bent sheet): a floor for each corner coordinate.
FLOOR_PX = 0.006
NOISE = 2.0 / 255.0
MODEL_ERROR = 0.02
_PARAMETERS = 13


@dataclass(frozen=True, eq=False)
class Registration:
    """The outcome of a fit.

    corners_px: (4, 2), upright tag's top-left, top-right, bottom-right, bottom-left. covariance_px2: (8, 8) of
    x0 y0 ... x3 y3. blur_px: standard deviation of the edge blur. correlation: of the image with the fitted model,
    in [-1, 1]; a wrongly decoded patch stays low.
    """

    corners_px: Array
    covariance_px2: Array
    blur_px: float
    correlation: float


def register(image: NDArray[np.uint8], family: str, tag_id: int, corners_px: Array, tone: Tone) -> Registration | None:
    """Fit a decoded tag to a grey image (H, W) uint8, starting from its corners (4, 2) in that image's pixels.

    Returns None when the fit leaves its start, finds no contrast, or has too few pixels to say anything.
    """
    patch, origin, binning = _patch(image, corners_px, tone)
    start = (corners_px + 0.5 - origin) / binning - 0.5
    found = _Fit(patch, family, tag_id, start, tone).run()
    if found is None:
        return None
    corners = (found.corners_px + 0.5) * binning + origin - 0.5
    return Registration(corners, found.covariance_px2 * binning**2, found.blur_px * binning, found.correlation)


def _patch(image: NDArray[np.uint8], corners_px: Array, tone: Tone) -> tuple[NDArray[np.float32], Array, int]:
    """Cut out the tag with some surroundings, in linear light; returns its first pixel and the binning factor."""
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    side = float((high - low).max())
    binning = max(1, round(side / MAX_SIDE_PX))
    pad = 0.2 * side + 2.0
    x0, y0 = np.maximum(np.floor(low - pad), 0).astype(int)
    x1, y1 = np.ceil(high + pad).astype(int) + 1
    cut = image[y0:y1, x0:x1]
    height, width = (n // binning * binning for n in cut.shape)
    linear = linear_lut(tone)[cut[:height, :width]]
    if binning > 1:
        size = (width // binning, height // binning)
        linear = cv2.resize(linear, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return linear, np.array([x0, y0], dtype=np.float64), binning


class _Fit:
    """One registration in a patch. Parameters: 8 homography entries, g0 g1 g2, black level, blur in modules."""

    def __init__(self, patch: NDArray[np.float32], family: str, tag_id: int, start: Array, tone: Tone) -> None:
        self.start, self.tone = start, tone
        scale = np.sqrt(abs(_area(start)))
        sharpest = template(family, tag_id, 1.0)
        self.module_px = float(scale) / (2.0 * sharpest.half)
        self.tag = (family, tag_id)
        h = sharpest.half
        self.square = np.array([[-h, -h], [h, -h], [h, h], [-h, h]])
        self.patch = patch

    def run(self) -> Registration | None:
        blur_range = np.array(BLUR_RANGE_PX) / self.module_px
        picture = template(*self.tag, START_BLUR_PX / self.module_px)
        p = self._start(picture)
        if p is None:
            return None
        for _ in range(ITERATIONS):
            residual, jacobian, weight = self._linearise(p, picture)
            step = _solve(jacobian.T @ (jacobian * weight[:, None]), jacobian.T @ (weight * residual))
            if step is None or not np.isfinite(step).all():
                return None
            before = self._corners(p)
            p = p + step
            p[12] = np.clip(p[12], *blur_range)
            picture = template(*self.tag, p[12])
            moved = np.abs(self._corners(p) - before).max()
            if moved < STOP_PX:
                break
        return self._outcome(p, picture)

    def _start(self, picture: Template) -> Array | None:
        """Choose the pixels, most of them at edges, and set the light by linear least squares."""
        corners = self.start.astype(np.float32)
        homography = cv2.getPerspectiveTransform(self.square.astype(np.float32), corners)
        p = np.concatenate([homography.ravel()[:8] / homography[2, 2], np.zeros(4), [picture.blur]])
        v, u = (axis.ravel().astype(np.float64) for axis in np.indices(self.patch.shape))
        x, y = _unwarp(p, u, v)
        # half a module at the picture's rim is left out: what is beyond it is blurred into it
        rim = picture.reach - 0.4
        inside = np.flatnonzero((np.abs(x) < rim) & (np.abs(y) < rim))
        if len(inside) < 60:
            return None
        found = picture.look_up(x[inside], y[inside])
        if len(inside) > EDGE_PIXELS:
            steepness = np.abs(found[:, 1]) + np.abs(found[:, 2])
            order = np.argsort(-steepness, kind="stable")
            keep = np.concatenate([order[:EDGE_PIXELS], order[EDGE_PIXELS::FLAT_STRIDE]])
            inside, found = inside[keep], found[keep]
        self.u, self.v, self.values = u[inside], v[inside], self.patch.ravel()[inside].astype(np.float64)
        gain, black = np.polyfit(found[:, 0], self.values, 1)
        p[8], p[11] = gain, black
        return p if gain > 0 else None

    def _linearise(self, p: Array, picture: Template) -> tuple[Array, Array, Array]:
        """Residuals (N,), Jacobian (N, 13) and weights (N,) in linear light."""
        u, v = self.u, self.v
        mx, my = _unwarp(p, u, v)
        level, by_x, by_y, by_blur = picture.look_up(mx, my).T
        level = level + by_blur * (p[12] - picture.blur)
        x, y = mx / picture.half, my / picture.half
        light = p[8] + p[9] * x + p[10] * y
        model = light * level + p[11]
        # u = H(m) with u fixed to the pixel: dm = -(du/dm)^-1 du/dh, and dI = light grad M . dm
        w = p[6] * mx + p[7] * my + 1.0
        a, b = (p[0] - u * p[6]) / w, (p[1] - u * p[7]) / w
        c, d = (p[3] - v * p[6]) / w, (p[4] - v * p[7]) / w
        gain = -light / ((a * d - b * c) * w)
        gu, gv = gain * (by_x * d - by_y * c), gain * (by_y * a - by_x * b)
        gw = -(gu * u + gv * v)
        columns = (
            gu * mx, gu * my, gu, gv * mx, gv * my, gv, gw * mx, gw * my,
            level, level * x, level * y, np.ones_like(x), light * by_blur,
        )  # fmt: skip
        residual = self.values - np.minimum(model, 1.0)
        # noise is even in encoded values, so in linear light it goes with the inverse slope of the curve; a blur
        # that is no Gaussian errs in proportion to the contrast, and must not let the dark foot of an edge decide
        _, slope = encode_with_slope(np.clip(model, 0.0, 0.999), self.tone)
        spread = np.hypot(NOISE / slope, MODEL_ERROR * light)
        return residual, np.stack(columns, axis=1), (model < 1.0) * _huber(residual / spread) / spread**2

    def _outcome(self, p: Array, picture: Template) -> Registration | None:
        corners = self._corners(p)
        if not np.isfinite(p).all() or p[8] <= 0 or np.abs(corners - self.start).max() > 1.0 + 0.6 * self.module_px:
            return None
        residual, jacobian, weight = self._linearise(p, picture)
        inverse = _solve(jacobian.T @ (jacobian * weight[:, None]), np.eye(_PARAMETERS))
        if inverse is None:
            return None
        variance = float(weight @ residual**2) / max(len(residual) - _PARAMETERS, 1)
        by_h = self._corner_jacobian(p, corners)
        covariance = variance * by_h @ inverse[:8, :8] @ by_h.T + FLOOR_PX**2 * np.eye(8)
        model = self.values - residual
        correlation = float(np.corrcoef(model, self.values)[0, 1])
        return Registration(corners, covariance, float(p[12]) * self.module_px, correlation)

    def _corners(self, p: Array) -> Array:
        q = np.column_stack([self.square, np.ones(4)]) @ np.append(p[:8], 1.0).reshape(3, 3).T
        return np.asarray(q[:, :2] / q[:, 2:])

    def _corner_jacobian(self, p: Array, corners: Array) -> Array:
        """Derivative (8, 8) of x0 y0 ... x3 y3 by the homography's first eight entries."""
        rows = []
        for (mx, my), (u, v) in zip(self.square, corners, strict=True):
            w = p[6] * mx + p[7] * my + 1.0
            rows.append([mx / w, my / w, 1 / w, 0, 0, 0, -u * mx / w, -u * my / w])
            rows.append([0, 0, 0, mx / w, my / w, 1 / w, -v * mx / w, -v * my / w])
        return np.array(rows)


def _unwarp(p: Array, u: Array, v: Array) -> tuple[Array, Array]:
    """Take pixels u, v (N,) to places x, y (N,) on the tag, modules from its centre."""
    inverse = np.linalg.inv(np.append(p[:8], 1.0).reshape(3, 3))
    x, y, w = (row[0] * u + row[1] * v + row[2] for row in inverse)
    return x / w, y / w


def _area(corners: Array) -> float:
    x, y = corners.T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def _huber(residual: Array) -> Array:
    """Weights (N,) that bound the pull of pixels the model cannot explain: glare, dirt, an occluder."""
    spread = 1.4826 * float(np.median(np.abs(residual))) + 1e-3
    weight: Array = np.minimum(1.0, 2.0 * spread / np.maximum(np.abs(residual), 1e-12))
    return weight


def _solve(matrix: Array, right: Array) -> Array | None:
    """Solve a normal equation whose entries span many decades: scaled to a unit diagonal first."""
    d = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    try:
        scaled = np.linalg.solve(matrix / np.outer(d, d), (right.T / d).T)
    except np.linalg.LinAlgError:
        return None
    return np.asarray((scaled.T / d).T)
