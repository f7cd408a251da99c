"""The camera as a value: intrinsics, lens distortion, and what cropping, scaling and turning do to them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from landtool.errors import InputError, UsageError
from landtool.geometry import Array

DistortionModel = Literal["plumb_bob", "rational_polynomial", "equidistant"]
# Coefficients in OpenCV's order: k1 k2 p1 p2 k3 | k1 k2 p1 p2 k3 k4 k5 k6 | k1 k2 k3 k4 (cv2.fisheye)
COEFFICIENTS: dict[DistortionModel, int] = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}
_UNDISTORT_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with lens distortion, for images of width x height pixels.

    fx, fy, cx, cy in pixels, OpenCV's convention (integer pixel centres). distortion: coefficients in the order of
    `COEFFICIENTS`. assumed: how the values were guessed when nobody measured them (outputs repeat it), else empty.

    Raises InputError for values no camera can have.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: DistortionModel = "plumb_bob"
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    assumed: str = ""

    def __post_init__(self) -> None:
        if self.model not in get_args(DistortionModel):
            known = ", ".join(get_args(DistortionModel))
            raise InputError(f"unknown distortion model '{self.model}'", hint=f"known: {known}")
        if len(self.distortion) != COEFFICIENTS[self.model]:
            need = COEFFICIENTS[self.model]
            raise InputError(f"{self.model} needs {need} distortion coefficients, got {len(self.distortion)}")
        if not all(map(math.isfinite, (self.fx, self.fy, self.cx, self.cy, *self.distortion))):
            raise InputError("a camera parameter is not a finite number", hint="calibrate the camera again")
        if self.fx <= 0 or self.fy <= 0:
            raise InputError(
                f"focal length {self.fx:g}, {self.fy:g} is not positive", hint="calibrate the camera first"
            )
        if self.width < 1 or self.height < 1:
            raise InputError(f"image size {self.width}x{self.height} is not positive")

    @classmethod
    def from_hfov(cls, width: int, height: int, hfov_deg: float) -> Camera:
        """Guess a distortion-free camera from its horizontal field of view; `assumed` says so.

        Raises UsageError when the angle is outside 1 to 170 degrees.
        """
        if not 1.0 <= hfov_deg <= 170.0:
            raise UsageError(f"a horizontal field of view of {hfov_deg:g} degrees is outside 1 to 170")
        f = width / 2.0 / math.tan(math.radians(hfov_deg) / 2.0)
        centre = (width - 1) / 2.0, (height - 1) / 2.0
        return cls(width, height, f, f, *centre, assumed=f"pinhole of {hfov_deg:g} degrees horizontal field of view")

    @property
    def matrix(self) -> Array:
        """The camera matrix (3, 3), pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def has_distortion(self) -> bool:
        """Whether any distortion coefficient differs from zero; an equidistant lens always bends."""
        return self.model == "equidistant" or any(self.distortion)

    def project(self, points_m: ArrayLike) -> Array:
        """Project points (N, 3) of the camera frame, in metres, to pixels (N, 2).

        NaN for points not in front, and for points so far to the side that the lens model folds them back inwards.
        """
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
        pixels = np.full((len(points), 2), np.nan)
        with np.errstate(invalid="ignore"):
            front = points[:, 2] > 1e-9
            front &= np.hypot(points[:, 0], points[:, 1]) < self._reach * points[:, 2]
        if front.any():
            pixels[front] = self._distort(points[front, :2] / points[front, 2:])
        return pixels

    def normalize(self, pixels: ArrayLike) -> Array:
        """Return undistorted coordinates x/z, y/z (N, 2) of pixels (N, 2); the inverse of `project` at z = 1.

        NaN where the lens model has no inverse (a fisheye beyond 90 degrees).
        """
        points = np.asarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if not len(points):
            return np.zeros((0, 2))
        if self.model == "equidistant":
            flat = cv2.fisheye.undistortPoints(
                points, self.matrix, np.array(self.distortion), criteria=_UNDISTORT_UNTIL
            )
            rays = flat.reshape(-1, 2)
            rays[(np.abs(rays) > 1e5).any(axis=1)] = np.nan  # OpenCV's mark for "not converged"
            return np.asarray(rays, dtype=np.float64)
        if not self.has_distortion:
            return (points[:, 0] - (self.cx, self.cy)) / (self.fx, self.fy)
        flat = cv2.undistortPoints(points, self.matrix, np.array(self.distortion), criteria=_UNDISTORT_UNTIL)
        return np.asarray(flat, dtype=np.float64).reshape(-1, 2)

    def unproject(self, pixels: ArrayLike) -> Array:
        """Return unit rays (N, 3) in the camera frame through pixels (N, 2)."""
        flat = self.normalize(pixels)
        rays = np.column_stack([flat, np.ones(len(flat))])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True), dtype=np.float64)

    def scaled(self, width: int, height: int) -> Camera:
        """Return the camera of the same images resized to width x height."""
        sx, sy = width / self.width, height / self.height
        # a pixel's area scales about the image's corner at (-0.5, -0.5), not about its first centre
        cx, cy = (self.cx + 0.5) * sx - 0.5, (self.cy + 0.5) * sy - 0.5
        return replace(self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy, cx=cx, cy=cy)

    def cropped(self, x_px: int, y_px: int, width: int, height: int) -> Camera:
        """Return the camera of the width x height part whose first pixel is (x_px, y_px)."""
        return replace(self, width=width, height=height, cx=self.cx - x_px, cy=self.cy - y_px)

    def rotated(self, quarter_turns: int) -> Camera:
        """Return the camera of the images turned clockwise by `quarter_turns` times 90 degrees."""
        camera = self
        for _ in range(quarter_turns % 4):
            camera = camera._rotated_once()
        return camera

    def of_turned(self, quarter_turns: int, width: int, height: int) -> Camera:
        """Return the camera of width x height pictures that were turned clockwise on reading.

        A calibration that has the size of pictures turned on their side was made from them, and is returned as it is.
        """
        if quarter_turns % 2 and (self.width, self.height) == (width, height):
            return self
        return self.rotated(quarter_turns)

    def _rotated_once(self) -> Camera:
        # pixel (u, v) moves to (H - 1 - v, u), so the new axes are x' = -y, y' = x
        d = list(self.distortion)
        if self.model != "equidistant":
            d[2], d[3] = d[3], -d[2]
        turned = replace(self, width=self.height, height=self.width, fx=self.fy, fy=self.fx, distortion=tuple(d))
        return replace(turned, cx=self.height - 1 - self.cy, cy=self.cx)

    @cached_property
    def _reach(self) -> float:
        """The distance from the axis, at z = 1, up to which the lens model is one-to-one; inf when it always is."""
        if self.model == "equidistant":
            # theta (1 + k1 s + k2 s^2 + k3 s^3 + k4 s^4), s = theta^2, stops growing where its derivative is 0
            slope = Polynomial([1.0, *(k * (2 * i + 3) for i, k in enumerate(self.distortion))])
            theta = math.sqrt(_first_root(slope))
            return math.tan(theta) if theta < math.pi / 2 else math.inf
        k1, k2, _, _, k3, *below = self.distortion
        if not any(self.distortion):
            return math.inf
        n, d = Polynomial([1.0, k1, k2, k3]), Polynomial([1.0, *below])
        # r n(s) / d(s), s = r^2, stops growing where n d + 2 s (n' d - n d') = 0, and jumps where d = 0
        slope = n * d + Polynomial([0.0, 2.0]) * (n.deriv() * d - n * d.deriv())
        return math.sqrt(min(_first_root(slope), _first_root(d)))

    def _distort(self, flat: Array) -> Array:
        """Take undistorted coordinates (N, 2) to pixels (N, 2)."""
        if not self.has_distortion:
            return flat * (self.fx, self.fy) + (self.cx, self.cy)
        coefficients = np.array(self.distortion)
        if self.model == "equidistant":
            bent = cv2.fisheye.distortPoints(flat.reshape(-1, 1, 2), self.matrix, coefficients)
        elif self.model == "plumb_bob":
            return self._plumb_bob(flat)
        else:
            points = np.column_stack([flat, np.ones(len(flat))])
            bent, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), self.matrix, coefficients)
        return np.asarray(bent, dtype=np.float64).reshape(-1, 2)

    def _plumb_bob(self, flat: Array) -> Array:
        """Take undistorted coordinates (N, 2) through Brown's lens model to pixels (N, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = flat.T
        xx, yy, xy = x * x, y * y, x * y
        s = xx + yy
        radial = 1.0 + s * (k1 + s * (k2 + s * k3))
        # x' = x (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 x y + p2 (s + 2 x^2),  y' likewise with p1 and p2 exchanged
        u = x * radial + 2.0 * p1 * xy + p2 * (s + 2.0 * xx)
        v = y * radial + p1 * (s + 2.0 * yy) + 2.0 * p2 * xy
        return np.column_stack([self.fx * u + self.cx, self.fy * v + self.cy])


def _first_root(polynomial: Polynomial) -> float:
    """Return the smallest real root above zero, inf when there is none."""
    roots = polynomial.trim().roots()
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(real.min(initial=np.inf))
