"""The pad's pose from its tags' corners: both solutions, refined, with their covariance.

A plane seen from afar fits two poses, mirror images about the line of sight. Both are found (IPPE: Collins and
Bartoli, "Infinitesimal plane-based pose estimation", 2014), both refined on the corners' own covariance, and both
returned; landtool.tags.choose decides over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotation_from_rotvec, skew
from landtool.pad import PadSpec
from landtool.types import TagObservation

_CHANCE = 5.0
_ITERATIONS = 8
_SAME_ANGLE_RAD = 2e-3
_SETTLED = 1e-3  # of chi-square: the pose is within a thirtieth of its own uncertainty
# (2, 3): what x and y do to x/z and y/z at z = 1, and z's share; (3, 9): q to the rows of -[q]x, as dw x q = -[q]x dw
_FLAT_BY_PLACE = np.eye(2, 3)
_ALONG_Z = np.array([0.0, 0.0, 1.0])
_MINUS_SKEW = -np.stack([skew(axis) for axis in np.eye(3)]).reshape(3, 9)


@dataclass(frozen=True, eq=False)
class Solution:
    """One pose that explains the corners.

    covariance: (6, 6) of (dt, dw): t + dt in m, exp(dw) R in rad, both in the camera frame. chi2: weighted sum of
    squared residuals; 2 n - 6 degrees of freedom for n corners. reproj_px: RMS distance over the corners.
    """

    camera_T_pad: Pose
    covariance: Array
    chi2: float
    reproj_px: float


@dataclass(frozen=True, eq=False)
class Corners:
    """The corners of all the pad's tags read in one picture, ready to be fitted.

    points_m: (N, 3) pad frame. pixels: (N, 2) measured. flat: (N, 2) the same as undistorted x/z, y/z. weight:
    (2N, 2N), the inverse covariance of `flat`.
    """

    points_m: Array
    pixels: Array
    flat: Array
    weight: Array
    camera: Camera

    def linearise(self, pose: Pose) -> tuple[Array, Array]:
        """Residuals (2N,) in x/z, y/z at a pose and the Jacobian (2N, 6) of the projection by (dt, dw)."""
        q = self.points_m @ pose.rotation.T
        seen = q + pose.translation
        flat = seen[:, :2] / seen[:, 2:]
        # d(x/z, y/z) = r (dt + dw x q), q = R p, r = (1/z, 0, -x/z^2) and (0, 1/z, -y/z^2), and dw x q = -[q]x dw
        by_place = _FLAT_BY_PLACE - flat[:, :, None] * _ALONG_Z
        by_place /= seen[:, 2, None, None]
        by_turn = by_place @ (q @ _MINUS_SKEW).reshape(-1, 3, 3)
        jacobian = np.concatenate([by_place, by_turn], axis=2)
        return (self.flat - flat).ravel(), jacobian.reshape(-1, 6)

    def terms(self, pose: Pose) -> tuple[Array, Array, float]:
        """Normal matrix (6, 6), gradient (6,) and chi-square of the corners at a pose."""
        residual, jacobian = self.linearise(pose)
        weighted = self.weight @ jacobian
        return jacobian.T @ weighted, weighted.T @ residual, float(residual @ self.weight @ residual)

    def reproj_px(self, pose: Pose) -> float:
        """RMS distance of the corners from where a pose has them, pixels."""
        distance = self.camera.project(pose.apply(self.points_m)) - self.pixels
        return float(np.sqrt((distance**2).sum(axis=1).mean()))


def pad_corners(observations: Sequence[TagObservation], camera: Camera, pad: PadSpec) -> Corners | None:
    """Gather the corners of the pad's tags; None when none was observed, or outside what the lens model covers."""
    tags = {(tag.family, tag.id): tag for tag in pad.tags}
    seen = [(tags[o.family, o.tag_id], o) for o in observations if (o.family, o.tag_id) in tags]
    if not seen:
        return None
    points = np.concatenate([pad.tag_corners_m(tag) for tag, _ in seen])
    pixels = np.concatenate([o.corners_px for _, o in seen])
    flat, weight = _normalise(camera, pixels, [o.covariance_px2 for _, o in seen])
    return Corners(points, pixels, flat, weight, camera) if np.isfinite(flat).all() else None


def pad_solutions(corners: Corners) -> tuple[Solution, ...]:
    """Return the one or two poses that fit the corners, the better fit first.

    All tags are solved jointly; they lie in one plane.
    """
    found = cv2.solvePnPGeneric(corners.points_m, corners.flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    starts = [
        Pose(rotation_from_rotvec(r.ravel()), np.asarray(t, np.float64))
        for r, t in zip(found[1], found[2], strict=True)
    ]
    refined = [_refine(start, corners) for start in starts]
    solutions = sorted((s for s in refined if s is not None), key=lambda s: s.chi2)
    if len(solutions) == 2 and solutions[0].camera_T_pad.angle_to(solutions[1].camera_T_pad) < _SAME_ANGLE_RAD:
        return (solutions[0],)
    return tuple(solutions)


def _normalise(camera: Camera, corners: Array, covariances: list[Array]) -> tuple[Array, Array]:
    """Take corners (N, 2) and their covariances to undistorted x/z, y/z (N, 2) and the inverse covariance there."""
    step = 0.25  # pixels; the lens is straight at this scale
    shifted = np.concatenate([corners, corners + (step, 0.0), corners + (0.0, step)])
    flat, by_u, by_v = np.split(camera.normalize(shifted), 3)
    weight = np.zeros((2 * len(corners), 2 * len(corners)))
    for i, covariance in enumerate(covariances):
        jacobian = np.zeros((8, 8))
        for k in range(4):
            n = 4 * i + k
            jacobian[2 * k : 2 * k + 2, 2 * k] = (by_u[n] - flat[n]) / step
            jacobian[2 * k : 2 * k + 2, 2 * k + 1] = (by_v[n] - flat[n]) / step
        block = slice(8 * i, 8 * i + 8)
        weight[block, block] = np.linalg.inv(jacobian @ covariance @ jacobian.T)
    return flat, weight


def _refine(start: Pose, corners: Corners) -> Solution | None:
    """Gauss-Newton on the weighted corner residuals from one start, with Levenberg's damping."""
    pose, damping = start, 1e-6
    normal, gradient, chi2 = corners.terms(pose)
    for _ in range(_ITERATIONS):
        damped = normal.copy()
        damped.flat[::7] *= 1.0 + damping
        step = np.linalg.solve(damped, gradient)
        moved = pose.perturbed(step)
        new_normal, new_gradient, new_chi2 = corners.terms(moved)
        if not new_chi2 <= chi2:
            damping = max(10.0 * damping, 1e-3)
            continue
        gained, damping = chi2 - new_chi2, 0.1 * damping
        pose, normal, gradient, chi2 = moved, new_normal, new_gradient, new_chi2
        if gained < _SETTLED:
            break
    if not np.isfinite(chi2) or pose.translation[2] <= 0:
        return None
    reproj_px = corners.reproj_px(pose)
    if not np.isfinite(reproj_px):  # beyond what the lens model covers
        return None
    # corners that miss their places by far more than their noise speak of a wrong calibration or layout: the pose is
    # as uncertain as they say (Birge's ratio); what noise does by chance in one case of a hundred is left alone
    excess = max(1.0, chi2 / (2.0 * len(corners.pixels) - 6.0) / _CHANCE)
    return Solution(pose, np.asarray(excess * np.linalg.inv(normal)), chi2, reproj_px)
