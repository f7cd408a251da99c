"""The camera from views of a board: least squares over its lens and all poses, with uncertainties.

Minimise sum_i rho(r_i / s_i), r_i = u_i - pi(K, d, R_v X_i + t_v), over the intrinsics a and the poses b_v, by
Levenberg and Marquardt's steps. The normal equations

    [ A  E ] [da]   [ga]        A = sum J_a' W J_a,   B_v = J_v' W J_v,   E_v = J_a' W J_v
    [ E' B ] [db] = [gb]

fall apart into (A - sum E_v B_v^-1 E_v') da = ga - sum E_v B_v^-1 g_v, the Schur complement, whose inverse times the
residuals' variance is the covariance of the intrinsics (Triggs et al., Bundle Adjustment, 2000; Zhang, 2000).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.calibrate.board import Board
from landtool.calibrate.corners import BoardView
from landtool.calibrate.start import first_camera, first_pose
from landtool.camera import COEFFICIENTS, Camera, DistortionModel
from landtool.errors import InputError
from landtool.geometry import Array, Pose, rotation_from_rotvec

LEAST_VIEWS = 3
_FLOOR_PX = 0.03  # no model of a lens and no print is better than this
_ROUNDS = 40
_STOP = 1e-9
_TUKEY = 4.685
_DETERMINED = 2.0  # standard deviations a coefficient must be from zero to be kept


@dataclass(frozen=True, eq=False)
class Solution:
    """A calibrated camera.

    poses: camera_T_board of each view. pose_covariances: (6, 6) a view, of rotation vector and place. covariance:
    (4 + n, 4 + n) of fx, fy, cx, cy and the coefficients; rows of those held at 0 are 0. free: which of them were
    solved for. residuals_px: (N, 2) a view, measured minus modelled. weights: (N,) a view, in [0, 1]; 0 takes no part.
    scale: standard deviation of residuals over what was expected.
    """

    camera: Camera
    poses: tuple[Pose, ...]
    covariance: Array
    free: NDArray[np.bool_]
    residuals_px: tuple[Array, ...]
    weights: tuple[Array, ...]
    scale: float
    pose_covariances: tuple[Array, ...]

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the corners that take part, pixels."""
        squares, count = 0.0, 0.0
        for residual, weight in zip(self.residuals_px, self.weights, strict=True):
            squares += float((residual[weight > 0] ** 2).sum())
            count += float((weight > 0).sum())
        return float(np.sqrt(squares / max(count, 1.0)))

    @property
    def view_rms_px(self) -> Array:
        """Root mean square distance (V,) over all corners of each view, pixels."""
        return np.array([np.sqrt((r**2).sum(axis=1).mean()) for r in self.residuals_px])

    @property
    def sigmas(self) -> Array:
        """Standard deviations (4 + n,) of fx, fy, cx, cy and the coefficients."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def solve(
    board: Board, views: Sequence[BoardView], size: tuple[int, int], model: DistortionModel, start: Camera | None = None
) -> Solution:
    """Calibrate a camera of pictures of `size` (width, height) from views of a board.

    Coefficients the data does not determine are held at 0. start: a camera to begin with.
    Raises InputError for fewer than LEAST_VIEWS, and when nothing fits.
    """
    if len(views) < LEAST_VIEWS:
        plural = "view" if len(views) == 1 else "views"
        hint = "film the whole board from more sides, slowly and sharp"
        raise InputError(f"{len(views)} {plural} of the board, {LEAST_VIEWS} are needed", hint=hint)
    camera = start if start is not None and start.model == model else first_camera(board, views, size, model)
    free = np.ones(4 + COEFFICIENTS[model], np.bool_)
    solution = _Problem(board, views, free).run(camera)
    for coefficient in _dispensable(model):
        value = solution.camera.distortion[coefficient]
        if abs(value) >= _DETERMINED * solution.sigmas[4 + coefficient]:
            break  # what stands before it is wanted, too
        free[4 + coefficient] = False
        kept = tuple(0.0 if i == coefficient else v for i, v in enumerate(solution.camera.distortion))
        solution = _Problem(board, views, free).run(_with(solution.camera, solution.camera, kept))
    return solution


def _dispensable(model: DistortionModel) -> tuple[int, ...]:
    """The coefficients that may be left out, the first one first."""
    return {"plumb_bob": (4, 1), "rational_polynomial": (7, 6), "equidistant": (3, 2)}[model]


def _with(like: Camera, values: Camera, distortion: tuple[float, ...]) -> Camera:
    return Camera(like.width, like.height, values.fx, values.fy, values.cx, values.cy, like.model, distortion)


def _floats(*arrays: Any) -> tuple[Array, Array, Array]:
    one, two, three = (np.asarray(array, np.float64) for array in arrays)
    return one, two, three


def _widened(covariance: Array, pulls: Array) -> Array:
    """Widen a covariance (n, n) where the views disagree by more than it says.

    pulls: (n, V), what each view moves the parameters by. sum_v pull pull' V / (V - n) is their covariance when the
    errors within a view go together, as those of a bent board or a rolling shutter do (Liang and Zeger, 1986).
    """
    count, views = pulls.shape
    if views <= 2 * count:
        return covariance
    together = (pulls**2).sum(axis=1) * views / (views - count)
    wider = np.sqrt(np.maximum(together / np.maximum(np.diag(covariance), 1e-300), 1.0))
    widened: Array = covariance * np.outer(wider, wider)
    return widened


class _Problem:
    """One least squares fit. Unknowns: the free ones of fx fy cx cy d..., and a rotation vector and place a view."""

    def __init__(self, board: Board, views: Sequence[BoardView], free: NDArray[np.bool_]) -> None:
        self.points = [np.ascontiguousarray(board.points_m[view.ids]) for view in views]
        self.seen = [view.pixels for view in views]
        self.sigma = [np.hypot(view.sigma_px, _FLOOR_PX) for view in views]
        self.board, self.views = board, views
        self.free = free.copy()

    def run(self, camera: Camera) -> Solution:
        self.like = camera
        a = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])
        poses = [first_pose(self.board, view, camera) for view in self.views]
        if any(pose is None for pose in poses):
            poses = [pose or Pose(np.eye(3), np.array([0.0, 0.0, 10.0 * self.board.square_m])) for pose in poses]
        b = np.array([[*pose.rotvec, *pose.translation] for pose in poses if pose is not None])
        spread = None
        damping = 1e-3
        for robust in (False, True):
            if robust:
                spread = self._spread(a, b)
            cost = self._cost(a, b, spread)
            for _ in range(_ROUNDS):
                step_a, step_b, _ = self._step(a, b, spread, damping)
                tried = self._cost(a + step_a, b + step_b, spread)
                if np.isfinite(tried) and tried <= cost:
                    gain = (cost - tried) / max(cost, 1e-12)
                    a, b, cost = a + step_a, b + step_b, tried
                    damping = max(damping / 5.0, 1e-12)
                    if gain < _STOP:
                        break
                else:
                    damping *= 10.0
                    if damping > 1e8:
                        break
        return self._outcome(a, b, spread if spread is not None else 1.0)

    def _project(self, a: Array, pose: Array, points: Array) -> tuple[Array, Array, Array]:
        """Return pixels (N, 2) and their derivatives by all intrinsics (2N, 4 + n) and by the pose (2N, 6)."""
        matrix = np.array([[a[0], 0.0, a[2]], [0.0, a[1], a[3]], [0.0, 0.0, 1.0]])
        turn, place = pose[:3].copy(), pose[3:].copy()
        if self.like.model == "equidistant":
            pixels, j = cv2.fisheye.projectPoints(points[:, None], turn, place, matrix, a[4:].copy())
            # OpenCV's order: f, c, k, rotation, translation, skew
            return _floats(pixels.reshape(-1, 2), j[:, :8], j[:, 8:14])
        pixels, j = cv2.projectPoints(points, turn, place, matrix, a[4:].copy())
        return _floats(pixels.reshape(-1, 2), j[:, 6 : 6 + len(a)], j[:, :6])

    def _weights(self, residual: Array, sigma: Array, spread: float | None) -> Array:
        """Weights (N,) of corners: 1 at first, then Tukey's."""
        if spread is None:
            return np.ones(len(residual))
        # of two numbers a corner, so that the distance is a Rayleigh's
        z = np.linalg.norm(residual, axis=1) / (sigma * spread * _TUKEY * 1.2)
        weight: Array = np.where(z < 1.0, (1.0 - z * z) ** 2, 0.0)
        return weight

    def _spread(self, a: Array, b: Array) -> float:
        """How much larger residuals are than expected, from their median."""
        parts = []
        for pose, points, seen, sigma in zip(b, self.points, self.seen, self.sigma, strict=True):
            parts.append(np.linalg.norm(seen - self._project(a, pose, points)[0], axis=1) / sigma)
        # the median of a Rayleigh's variable is 1.1774
        return max(float(np.median(np.concatenate(parts))) / 1.1774, 1e-3)

    def _cost(self, a: Array, b: Array, spread: float | None) -> float:
        total = 0.0
        for pose, points, seen, sigma in zip(b, self.points, self.seen, self.sigma, strict=True):
            if a[0] <= 0 or a[1] <= 0 or pose[5] <= 0:
                return np.inf
            residual = seen - self._project(a, pose, points)[0]
            squares = (residual**2).sum(axis=1) / sigma**2
            if spread is not None:
                # Tukey: c^2 / 3 (1 - (1 - z^2)^3), scaled to fit the squares near 0
                c2 = (spread * _TUKEY * 1.2) ** 2
                squares = c2 / 3.0 * (1.0 - np.maximum(1.0 - squares / c2, 0.0) ** 3)
            total += float(squares.sum())
        return total

    def _step(self, a: Array, b: Array, spread: float | None, damping: float) -> tuple[Array, Array, Array]:
        """Return the steps of the intrinsics and the poses, and the Schur complement of the free intrinsics."""
        free = self.free
        n = int(free.sum())
        A, ga = np.zeros((n, n)), np.zeros(n)
        reduced, gradient = np.zeros((n, n)), np.zeros(n)
        back = []
        for pose, points, seen, sigma in zip(b, self.points, self.seen, self.sigma, strict=True):
            pixels, by_a, by_b = self._project(a, pose, points)
            residual = seen - pixels
            weight = np.repeat(self._weights(residual, sigma, spread) / sigma**2, 2)
            ja = by_a[:, free]
            wa, wb = ja * weight[:, None], by_b * weight[:, None]
            A += wa.T @ ja
            ga += wa.T @ residual.ravel()
            B = wb.T @ by_b
            B[np.diag_indices(6)] *= 1.0 + damping + 1e-9  # a view may have lost its corners
            B[np.diag_indices(6)] += 1e-12
            E = wa.T @ by_b
            g = wb.T @ residual.ravel()
            solved = np.linalg.solve(B, np.column_stack([E.T, g]))
            reduced += E @ solved[:, :-1]
            gradient += E @ solved[:, -1]
            back.append(solved)
        A[np.diag_indices(n)] *= 1.0 + damping
        schur = A - reduced
        d = 1.0 / np.sqrt(np.maximum(np.diag(schur), 1e-300))
        scaled = schur * np.outer(d, d)
        try:
            step = d * np.linalg.solve(scaled, d * (ga - gradient))
        except np.linalg.LinAlgError:
            step = np.zeros(n)
        step_a = np.zeros(len(a))
        step_a[free] = step
        step_b = np.array([solved[:, -1] - solved[:, :-1] @ step for solved in back])
        return step_a, step_b, schur

    def _outcome(self, a: Array, b: Array, spread: float) -> Solution:
        residuals, weights, scores = [], [], []
        squares, count = 0.0, 0.0
        for pose, points, seen, sigma in zip(b, self.points, self.seen, self.sigma, strict=True):
            pixels, by_a, _ = self._project(a, pose, points)
            residual = seen - pixels
            weight = self._weights(residual, sigma, spread)
            # at the minimum the poses' own gradients are zero, and this is all a view pulls at the intrinsics
            scores.append(by_a[:, self.free].T @ (np.repeat(weight / sigma**2, 2) * residual.ravel()))
            squares += float((weight * (residual**2).sum(axis=1) / sigma**2).sum())
            count += 2.0 * float(weight.sum())
            residuals.append(residual)
            weights.append(weight)
        unknowns = int(self.free.sum()) + 6 * len(b)
        variance = squares / max(count - unknowns, 1.0)
        _, _, schur = self._step(a, b, spread, 0.0)
        covariance = np.zeros((len(a), len(a)))
        d = 1.0 / np.sqrt(np.maximum(np.diag(schur), 1e-300))
        try:
            inverse = np.linalg.inv(schur * np.outer(d, d)) * np.outer(d, d)
        except np.linalg.LinAlgError:
            inverse = np.full(schur.shape, np.nan)
        covariance[np.ix_(self.free, self.free)] = _widened(inverse * variance, inverse @ np.array(scores).T)
        if not np.isfinite(covariance).all() or (np.diag(covariance) < 0).any():
            hint = "film the board tilted, and at different distances"
            raise InputError("the views do not determine the camera", hint=hint)
        like = self.like
        fx, fy, cx, cy, *distortion = a.tolist()
        camera = Camera(like.width, like.height, fx, fy, cx, cy, like.model, tuple(distortion))
        poses = tuple(Pose(rotation_from_rotvec(pose[:3]), pose[3:].copy()) for pose in b)
        return Solution(
            camera,
            poses,
            covariance,
            self.free.copy(),
            tuple(residuals),
            tuple(weights),
            float(np.sqrt(variance)),
            tuple(self._pose_covariances(a, b, weights, covariance[np.ix_(self.free, self.free)], variance)),
        )

    def _pose_covariances(
        self, a: Array, b: Array, weights: list[Array], covariance: Array, variance: float
    ) -> Iterator[Array]:
        """Yield B^-1 s^2 + K C K' of each view, K = B^-1 E' its pose's answer to the intrinsics."""
        for pose, points, sigma, weight in zip(b, self.points, self.sigma, weights, strict=True):
            _, by_a, by_b = self._project(a, pose, points)
            wb = by_b * np.repeat(weight / sigma**2, 2)[:, None]
            inverse = np.linalg.pinv(wb.T @ by_b, hermitian=True)  # a view may have lost its corners
            answer = inverse @ wb.T @ by_a[:, self.free]
            yield inverse * variance + answer @ covariance @ answer.T
