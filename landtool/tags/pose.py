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

_ITERATIONS = 8
_SAME_ANGLE_RAD = 2e-3


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


def pad_solutions(observations: Sequence[TagObservation], camera: Camera, pad: PadSpec) -> tuple[Solution, ...]:
    """Return the one or two poses of the pad, the better fit first; none when no tag of the pad was observed.

    All observed tags of the pad are solved jointly; they lie in one plane.
    """
    tags = {(tag.family, tag.id): tag for tag in pad.tags}
    seen = [(tags[o.family, o.tag_id], o) for o in observations if (o.family, o.tag_id) in tags]
    if not seen:
        return ()
    points = np.concatenate([pad.tag_corners_m(tag) for tag, _ in seen])
    corners = np.concatenate([o.corners_px for _, o in seen])
    flat, weight = _normalise(camera, corners, [o.covariance_px2 for _, o in seen])
    if not np.isfinite(flat).all():
        return ()
    _, rotvecs, translations, _ = cv2.solvePnPGeneric(points, flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    starts = [Pose(cv2.Rodrigues(r)[0], t) for r, t in zip(rotvecs, translations, strict=True)]
    found = [_refine(start, points, flat, weight, corners, camera) for start in starts]
    solutions = sorted((s for s in found if s is not None), key=lambda s: s.chi2)
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


def _refine(start: Pose, points: Array, flat: Array, weight: Array, corners: Array, camera: Camera) -> Solution | None:
    """Gauss-Newton on the weighted corner residuals from one start, with Levenberg's damping."""
    pose, damping = start, 1e-6
    residual, jacobian = _linearise(pose, points, flat)
    chi2 = float(residual @ weight @ residual)
    for _ in range(_ITERATIONS):
        normal = jacobian.T @ weight @ jacobian
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), jacobian.T @ weight @ residual)
        moved = Pose(rotation_from_rotvec(step[3:]) @ pose.rotation, pose.translation + step[:3])
        new_residual, new_jacobian = _linearise(moved, points, flat)
        new_chi2 = float(new_residual @ weight @ new_residual)
        if not new_chi2 <= chi2:
            damping = max(10.0 * damping, 1e-3)
            continue
        gained, damping = chi2 - new_chi2, 0.1 * damping
        pose, residual, jacobian, chi2 = moved, new_residual, new_jacobian, new_chi2
        if gained < 1e-6 * chi2 + 1e-9:
            break
    if not np.isfinite(chi2) or pose.translation[2] <= 0:
        return None
    covariance: Array = np.linalg.inv(jacobian.T @ weight @ jacobian)
    distance = camera.project(pose.apply(points)) - corners
    return Solution(pose, covariance, chi2, float(np.sqrt((distance**2).sum(axis=1).mean())))


def _linearise(pose: Pose, points: Array, flat: Array) -> tuple[Array, Array]:
    """Residuals (2N,) in x/z, y/z and the Jacobian (2N, 6) of the projection by (dt, dw)."""
    turned = points @ pose.rotation.T
    x, y, z = (turned + pose.translation).T
    residual = (flat - np.column_stack([x / z, y / z])).ravel()
    # d(x/z, y/z) = [1/z 0 -x/z^2; 0 1/z -y/z^2] (dt + dw x (R p)), and dw x q = -skew(q) dw
    by_point = np.zeros((len(points), 2, 3))
    by_point[:, 0, 0] = by_point[:, 1, 1] = 1.0 / z
    by_point[:, 0, 2], by_point[:, 1, 2] = -x / z**2, -y / z**2
    by_turn = by_point @ np.stack([-skew(q) for q in turned])
    return residual, np.concatenate([by_point, by_turn], axis=2).reshape(-1, 6)
