"""Sub-pixel corners of a decoded tag, by registering the tag's own picture to the image.

AprilTag fits lines to the four outer edges. Once the tag is decoded its whole picture is known, and every edge of
every module can be used. In linear light the picture is blurred by the camera and lit by a plane of light:

    I(u) = (g0 + g1 x + g2 y) M(m; blur) + b,    m = H^-1 u,    (x, y) = m / half width

Gauss-Newton fits the homography H, the light g0 g1 g2, the black level b and the blur, so nothing has to be assumed
about where a blurred edge "is". The blur is round in the image, so on a tilted tag it is an ellipse. Method: Lucas
and Kanade, 1981; the plane of light follows the intensity model of AprilTag 2 (Wang and Olson, 2016). The corners'
covariance comes from the residuals themselves (White, 1980; MacKinnon and White's HC3, 1985), because noise that is
even in encoded values is far from even in linear light.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.tags.template import Template, edge_places, template
from landtool.tone import Tone, encode_with_slope, linear_lut

ALL_PIXELS_MODULE_PX = 3.0  # tags smaller than this use every pixel, larger ones those about their edges
ACROSS_EDGE_PX = (-1.0, 0.0, 1.0)
ITERATIONS = 8
STOP_PX = 0.03  # Gauss-Newton's next step would be far smaller
START_BLUR_PX = 0.7
BLUR_RANGE_PX = (0.3, 4.0)
# Model and camera never agree exactly (demosaicing, sharpening, a bent sheet): a floor for each corner coordinate.
FLOOR_PX = 0.003
NOISE = 2.0 / 255.0
MODEL_ERROR = 0.02
SMALLEST_MODULE_PX = 0.5
_PARAMETERS = 13
_FEWEST_PIXELS = 60


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
    fit = _Fit(image, family, tag_id, corners_px, tone)
    if not fit.module_px > SMALLEST_MODULE_PX:  # NaN too
        return None
    try:
        return fit.run()
    except np.linalg.LinAlgError:  # the homography or the normal matrix fell together
        return None


class _Fit:
    """One registration. Parameters: 8 homography entries, g0 g1 g2, black level, blur in pixels.

    Pixels are counted from the tag's middle, so that the homography's entries are of like size.
    """

    def __init__(self, image: NDArray[np.uint8], family: str, tag_id: int, corners_px: Array, tone: Tone) -> None:
        self.image, self.tag, self.tone = image, (family, tag_id), tone
        self.origin = np.rint(corners_px.mean(axis=0))
        self.start = corners_px - self.origin
        half = template(family, tag_id, 1.0).half
        self.square = np.array([[-half, half, half, -half], [-half, -half, half, half], [1.0, 1.0, 1.0, 1.0]])
        self.module_px = float(np.sqrt(max(_area(self.start), 1e-6))) / (2.0 * half)

    def run(self) -> Registration | None:
        p = self._begin()
        if p is None:
            return None
        for left in reversed(range(ITERATIONS)):
            residual, jacobian, weight = self._linearise(p)
            weighted = jacobian * weight
            inverse = _inverse(weighted @ jacobian.T)
            before = self._corners(p)
            step = inverse @ (weighted @ residual)
            p = p + step
            p[12] = min(max(p[12], BLUR_RANGE_PX[0]), BLUR_RANGE_PX[1])
            moved = np.abs(self._corners(p) - before).max()
            if not moved < 3.0 * self.module_px:  # NaN too
                return None
            if moved < STOP_PX or left == 0:
                # residuals follow the last, tiny step linearly
                return self._outcome(p, residual - step @ jacobian, jacobian, weighted, inverse)
        return None

    def _begin(self) -> Array | None:
        """Choose the pixels and set the light by linear least squares; None where there is no contrast."""
        homography = cv2.getPerspectiveTransform(self.square[:2].T.astype(np.float32), self.start.astype(np.float32))
        p = np.concatenate([homography.ravel()[:8] / homography[2, 2], np.zeros(4), [START_BLUR_PX]])
        if not np.isfinite(p).all():
            return None
        self.pixels = self._every_pixel(p) if self.module_px < ALL_PIXELS_MODULE_PX else self._edge_pixels(p)
        if self.pixels.shape[1] < _FEWEST_PIXELS:
            return None
        column, row = (self.pixels[:2] + self.origin[:, None]).astype(np.intp)
        self.values = linear_lut(self.tone)[self.image[row, column]].astype(np.float64)
        level = self._picture(p).look_up(_unwarp(p, self.pixels))[0][0]
        mean = float(level.mean())
        varied = level - mean
        gain = float(varied @ self.values) / max(float(varied @ varied), 1e-9)
        p[8], p[11] = gain, self.values.mean() - gain * mean
        # noise is even in encoded values, so in linear light it goes with the inverse slope of the curve; a blur
        # that is no Gaussian errs in proportion to the contrast, and must not let the dark foot of an edge decide
        _, slope = encode_with_slope(np.clip(gain * level + p[11], 0.0, 0.999), self.tone)
        self.noise = (NOISE / slope) ** 2 + (MODEL_ERROR * gain) ** 2
        return p if gain > 0 else None

    def _every_pixel(self, p: Array) -> Array:
        """Return the pixels (3, N) u, v, 1 that see the tag and its border."""
        low, high = self.start.min(axis=0), self.start.max(axis=0)
        margin = 2.0 * self.module_px + 1.0
        u, v = (np.arange(np.floor(a - margin), np.ceil(b + margin) + 1) for a, b in zip(low, high, strict=True))
        grid = np.stack(np.meshgrid(u, v)).reshape(2, -1)
        rim = self._picture(p).reach - 0.3
        grid = np.concatenate([grid, np.ones((1, grid.shape[1]))])
        seen = (np.abs(_unwarp(p, grid)) < rim).all(axis=0)
        return self._in_image(grid[:, seen])

    def _edge_pixels(self, p: Array) -> Array:
        """Return pixels (3, N) u, v, 1 on and beside the edges, and one in the middle of each module."""
        places, normals, centres = edge_places(*self.tag)
        homography = np.append(p[:8], 1.0).reshape(3, 3)
        on_edge, beside = (_project(homography, q) for q in (places, places + 0.1 * normals))
        across = (beside - on_edge) / np.linalg.norm(beside - on_edge, axis=0)
        chosen = [on_edge + k * across for k in ACROSS_EDGE_PX] + [_project(homography, centres)]
        key = np.rint(np.concatenate(chosen, axis=1))
        _, first = np.unique(key[0] * 1e5 + key[1], return_index=True)
        return self._in_image(np.concatenate([key, np.ones((1, key.shape[1]))])[:, first])

    def _in_image(self, pixels: Array) -> Array:
        height, width = self.image.shape
        u, v = pixels[0] + self.origin[0], pixels[1] + self.origin[1]
        return pixels[:, (u >= 0) & (u < width) & (v >= 0) & (v < height)]

    def _picture(self, p: Array) -> Template:
        return template(*self.tag, p[12] / self.module_px)

    def _linearise(self, p: Array) -> tuple[Array, Array, Array]:
        """Residuals (N,), Jacobian (13, N) and weights (N,) in linear light."""
        u, v, _ = self.pixels
        picture = self._picture(p)
        places = _unwarp(p, self.pixels)
        (level, by_x, by_y), (by_xx, by_xy, by_yy) = picture.look_up(places)
        mx, my = places
        # dm/du = [d -b; -c a] / (a d - b c), the inverse of du/dm
        w = 1.0 / (p[6] * mx + p[7] * my + 1.0)
        a, b = (p[0] - u * p[6]) * w, (p[1] - u * p[7]) * w
        c, d = (p[3] - v * p[6]) * w, (p[4] - v * p[7]) * w
        shrink = 1.0 / (a * d - b * c)
        # a blur of 1 px in the image is dm/du dm/du^T on the tag, and dM/dblur^2 = (Mxx, Mxy, Myy) : half of that
        bend = 0.5 * (by_xx * (b * b + d * d) + by_yy * (a * a + c * c)) - by_xy * (a * b + c * d)
        bend *= shrink * shrink
        level = level + p[12] ** 2 * bend - 0.5 * picture.blur**2 * (by_xx + by_yy)
        x, y = mx / picture.half, my / picture.half
        light = p[8] + p[9] * x + p[10] * y
        model = light * level + p[11]
        # u = H(m) with u fixed to the pixel: dm = -(du/dm)^-1 du/dh, and dI = light grad M . dm
        gain = -light * shrink * w
        gu, gv = gain * (by_x * d - by_y * c), gain * (by_y * a - by_x * b)
        gw = -(gu * u + gv * v)
        jacobian = np.stack([
            gu * mx, gu * my, gu, gv * mx, gv * my, gv, gw * mx, gw * my,
            level, level * x, level * y, np.ones_like(x), (2.0 * p[12]) * light * bend,
        ])  # fmt: skip
        residual = self.values - np.minimum(model, 1.0)
        # what stands beyond the picture is unknown and is blurred into its rim: Phi(-d) of it, about a logistic curve
        depth = (picture.reach - np.abs(places).max(axis=0)) * (1.702 * self.module_px / p[12])
        self.strange = p[8] / (1.0 + np.exp(depth))
        variance = self.noise + self.strange**2
        return residual, jacobian, (model < 1.0) * _huber(residual / np.sqrt(variance)) / variance

    def _outcome(
        self, p: Array, residual: Array, jacobian: Array, weighted: Array, inverse: Array
    ) -> Registration | None:
        corners = self._corners(p)
        if not np.isfinite(p).all() or p[8] <= 0 or np.abs(corners - self.start).max() > 1.0 + 0.6 * self.module_px:
            return None
        # HC3: (J W J')^-1 J W diag(r / (1 - h))^2 W J' (J W J')^-1, h the pixel's own pull on its model; what the
        # unknown surroundings may do counts like a residual
        pull = inverse @ weighted
        leverage = np.minimum((pull * jacobian).sum(axis=0), 0.9)
        to_corners = (
            self._corner_jacobian(p, corners) @ pull[:8] * (np.hypot(residual, self.strange) / (1.0 - leverage))
        )
        # estimated from few pixels, the covariance itself is uncertain; the mean of e' C^-1 e grows by n / (n - 2 k)
        few = len(residual) / max(len(residual) - 2.0 * _PARAMETERS, 1.0)
        covariance = few * to_corners @ to_corners.T + FLOOR_PX**2 * np.eye(8)
        model = self.values - residual
        m, v = model - model.mean(), self.values - self.values.mean()
        correlation = float(m @ v) / max(float(np.sqrt((m @ m) * (v @ v))), 1e-12)
        return Registration(corners + self.origin, covariance, float(p[12]), correlation)

    def _corners(self, p: Array) -> Array:
        q = np.append(p[:8], 1.0).reshape(3, 3) @ self.square
        corners: Array = (q[:2] / q[2]).T
        return corners

    def _corner_jacobian(self, p: Array, corners: Array) -> Array:
        """Derivative (8, 8) of x0 y0 ... x3 y3 by the homography's first eight entries."""
        rows = np.zeros((8, 8))
        q = (self.square / (p[6] * self.square[0] + p[7] * self.square[1] + 1.0)).T
        rows[0::2, 0:3], rows[1::2, 3:6] = q, q
        rows[:, 6:] = -corners.reshape(8, 1) * np.repeat(q[:, :2], 2, axis=0)
        return rows


def _unwarp(p: Array, pixels: Array) -> Array:
    """Take pixels (3, N) u, v, 1 to places (2, N) on the tag, modules from its centre."""
    q = np.linalg.inv(np.append(p[:8], 1.0).reshape(3, 3)) @ pixels
    places: Array = q[:2] / q[2]
    return places


def _project(homography: Array, places: Array) -> Array:
    """Take places (2, N) on the tag to pixels (2, N)."""
    q = homography[:, :2] @ places + homography[:, 2:]
    pixels: Array = q[:2] / q[2]
    return pixels


def _area(corners: Array) -> float:
    x, y = corners.T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def _huber(residual: Array) -> Array:
    """Weights (N,) that bound the pull of pixels the model cannot explain: glare, dirt, an occluder."""
    size = np.abs(residual)
    spread = 1.4826 * float(np.median(size)) + 1e-3
    weight: Array = np.minimum(1.0, 2.0 * spread / np.maximum(size, 1e-12))
    return weight


def _inverse(matrix: Array) -> Array:
    """Invert a normal matrix whose entries span many decades: scaled to a unit diagonal first."""
    d = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scale = np.outer(d, d)
    inverse: Array = np.linalg.inv(matrix * scale) * scale
    return inverse
