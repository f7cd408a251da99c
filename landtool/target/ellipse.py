"""Ellipses by the box around them, and their least-squares fit to offsets measured along their normals.

An ellipse is its centre (cx, cy), the half sides (sx, sy) of its box and a slant rho in (-1, 1):

    (x - c)^T S^-1 (x - c) = 1,   S = [[sx^2, rho sx sy], [rho sx sy, sy^2]]

The tangent whose unit normal is n lies h = sqrt(n^T S n) from the centre, so that moving it by o along n is linear in
the parameters to first order: o = n . dc + n^T dS n / (2 h).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array

_MOST_SLANT = 0.93  # of a circle seen at 75 degrees
# The slant and the shape of boxes that tilted circles have, and how far a box's edge may be off, of its side
_SLANT_SIGMA = 0.35
_LOG_SHAPE_SIGMA = 0.35
_BOX_SIGMA = 0.08
# how x_min, y_min, x_max, y_max of the box move with the five parameters
BOX_ROWS = np.array([[1.0, 0, -1, 0, 0], [0, 1, 0, -1, 0], [1, 0, 1, 0, 0], [0, 1, 0, 1, 0]])


@dataclass(frozen=True, eq=False)
class Ellipse:
    """An ellipse in the picture: its centre, the half sides of its box, all in pixels, and its slant."""

    cx_px: float
    cy_px: float
    sx_px: float
    sy_px: float
    slant: float

    @property
    def axes(self) -> tuple[Array, float]:
        """Return the semi-axes (2,) in pixels, longer first, and the angle of the first from +x to +y, radians."""
        mixed = self.slant * self.sx_px * self.sy_px
        values, vectors = np.linalg.eigh(np.array([[self.sx_px**2, mixed], [mixed, self.sy_px**2]]))
        angle = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
        return np.sqrt(np.maximum(values[::-1], 0.0)), angle % np.pi

    @property
    def box_px(self) -> Array:
        """The tight box (4,): x_min, y_min, x_max, y_max, in pixels, not clipped."""
        x, y, a, b = self.cx_px, self.cy_px, self.sx_px, self.sy_px
        return np.array([x - a, y - b, x + a, y + b])

    def moved(self, step: Array) -> Ellipse:
        """Return the ellipse changed by (5,) dcx, dcy, dsx, dsy, dslant; a box never shrinks below half at once."""
        cx, cy, sx, sy, slant = (float(v) for v in step)
        return Ellipse(
            self.cx_px + cx,
            self.cy_px + cy,
            max(self.sx_px + sx, self.sx_px / 2.0),
            max(self.sy_px + sy, self.sy_px / 2.0),
            min(max(self.slant + slant, -_MOST_SLANT), _MOST_SLANT),
        )


@lru_cache(maxsize=4)
def circle(points: int) -> NDArray[np.float64]:
    """Return points (2, N) evenly on the unit circle."""
    angle = (np.arange(points) + 0.5) * (2.0 * np.pi / points)
    return np.stack([np.cos(angle), np.sin(angle)])


@dataclass(frozen=True, eq=False)
class Contour:
    """Points (2, N) on an ellipse, and the outward unit normals (2, N) there.

    reach_px: (N,) the tangents' distance h from the centre. jacobian: (N, 5) how far the ellipse moves along the
    normal by its five parameters.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    reach_px: Array
    jacobian: NDArray[np.float64]


def contour(ellipse: Ellipse, on_circle: NDArray[np.float64]) -> Contour:
    """Return the ellipse at the places (2, N) of a unit circle."""
    sx, sy, slant = ellipse.sx_px, ellipse.sy_px, ellipse.slant
    other = np.sqrt(1.0 - slant**2)
    u, v = on_circle
    # S = L L^T with L = [[sx, 0], [slant sy, other sy]]; a point is c + L u, its normal lies along L^-T u
    x, y = sx * u, sy * (slant * u + other * v)
    nx, ny = (u - slant / other * v) / sx, v / (other * sy)
    h = 1.0 / np.sqrt(nx * nx + ny * ny)
    nx, ny = nx * h, ny * h
    ax, ay = sx * nx, sy * ny
    jacobian = np.empty((len(u), 5))
    jacobian[:, 0], jacobian[:, 1] = nx, ny
    jacobian[:, 2] = nx * (ax + slant * ay) / h
    jacobian[:, 3] = ny * (ay + slant * ax) / h
    jacobian[:, 4] = ax * ay / h
    return Contour(np.stack([x + ellipse.cx_px, y + ellipse.cy_px]), np.stack([nx, ny]), h, jacobian)


@dataclass(frozen=True, eq=False)
class Prior:
    """What is thought of an ellipse before the picture is seen, as a Gaussian about it: information, gradient."""

    information: Array
    gradient: Array


NO_PRIOR = Prior(np.eye(5) * 1e-9, np.zeros(5))


def robust_step(
    jacobian: NDArray[np.float64], offsets_px: Array, weights: Array, scales_px: tuple[float, ...], prior: Prior
) -> tuple[Array, Array, Array]:
    """Return the change (5,) of an ellipse that explains offsets (N,) best, its information, the last weights (N,).

    Weighted as Geman and McClure do, at scales that narrow from step to step; the information (5, 5) is in units of
    the weights.
    """
    step = np.zeros(5)
    for scale in scales_px:
        left = offsets_px - jacobian @ step
        now = weights / (1.0 + (left / scale) ** 2) ** 2
        weighted = jacobian * now[:, None]
        share = scale**2
        information = jacobian.T @ weighted + share * prior.information
        step[:] = np.linalg.solve(information, offsets_px @ weighted + share * prior.gradient)
    return step, information, now


def prior_of_box(now: Ellipse, box_px: Array, free: NDArray[np.bool_]) -> Prior:
    """Return what a box tells of an ellipse near `now`.

    free: (4,) which of its edges x_min, y_min, x_max, y_max are the ellipse's own, not the picture's border.
    """
    side = max(box_px[2] - box_px[0], box_px[3] - box_px[1])
    weight = free / (_BOX_SIGMA * side) ** 2
    information = BOX_ROWS.T @ (BOX_ROWS * weight[:, None])
    gradient = BOX_ROWS.T @ (weight * (box_px - now.box_px))
    # with edges cut some size stays open, which a short arc leaves nearly so
    information[:4, :4] += np.eye(4) / side**2
    information[4, 4] += 1.0 / _SLANT_SIGMA**2
    gradient[4] -= now.slant / _SLANT_SIGMA**2
    # log(sx / sy) about 0
    row = np.array([0.0, 0.0, 1.0 / now.sx_px, -1.0 / now.sy_px, 0.0])
    information += np.outer(row, row) / _LOG_SHAPE_SIGMA**2
    gradient -= row * np.log(now.sx_px / now.sy_px) / _LOG_SHAPE_SIGMA**2
    return Prior(information, gradient)


def start_ellipses(box_px: Array, free: NDArray[np.bool_]) -> list[Ellipse]:
    """Return ellipses that may have a box (4,) when cut by the picture's border where it is not `free`.

    One with all edges free; else circles through the free edges, of the sizes that are possible.
    """
    low, high = box_px[:2], box_px[2:]
    size = high - low
    cut_low, cut_high = ~free[:2], ~free[2:]
    cut = cut_low | cut_high
    if not cut.any():
        return [_upright((low + high) / 2.0, size / 2.0)]
    if cut.all():
        radii = [share * float(size.max()) for share in (0.55, 0.75, 1.1)]
    else:
        along, across = (0, 1) if cut[0] else (1, 0)
        # the whole width is seen, or a chord of it of which the rise is known
        chord, rise = float(size[across]), float(size[along])
        radii = [chord / 2.0 if rise >= chord / 2.0 else (chord**2 / 4.0 + rise**2) / (2.0 * rise)]
    found = []
    for radius in radii:
        half = np.where(cut, radius, np.minimum(size / 2.0, radius) if len(radii) > 1 else radius)
        middle = (low + high) / 2.0
        centre = np.where(cut_low & ~cut_high, high - half, np.where(cut_high & ~cut_low, low + half, middle))
        found.append(_upright(centre, half))
    return found


def _upright(centre: Array, half: Array) -> Ellipse:
    return Ellipse(float(centre[0]), float(centre[1]), float(half[0]), float(half[1]), 0.0)
