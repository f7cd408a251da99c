"""How a pad is turned, over time: a filter of its orientation for each of the poses a plane far away may have.

A single picture of a small pad leaves its tilt open by some degrees and may show its mirror image as well. The platform
tips slowly, in the world, and its mirror image does not. Each hypothesis is a random walk on the rotations,

    R_t = exp(w) R_t-1,  w ~ N(0, Q dt),

in the frame the platform is tracked in, drawn back to level; what it predicts is known to the next registration.
Costs are negative log likelihoods and add up (Viterbi, 1967), until one of them is left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose, rotation_from_rotvec, rotvec_from_rotation

# Variance a second, rad^2/s, of the tilt and the heading: of a platform in the world, and seen from a drone that tilts
_TILT_WORLD, _TILT_BODY = math.radians(2.5) ** 2, math.radians(9.0) ** 2
_HEADING = math.radians(30.0) ** 2
# What is thought of the tilt before the pad was seen, standard deviations, and how often anew: platforms stay level
_LEVEL_WORLD_RAD, _LEVEL_BODY_RAD = math.radians(2.5), math.radians(8.0)
_LEVEL_EVERY_S = 1.5
_LEAST_RAD = math.radians(0.3)  # pictures err alike from frame to frame
NEW_START_S = 2.0
SAME_RAD = math.radians(1.0)
DECIDED = 7.0  # of the costs: one in a thousand


@dataclass(frozen=True, eq=False)
class Turn:
    """One hypothesis. reference_R_pad: (3, 3). covariance: (3, 3) of a left perturbation, reference frame, rad^2."""

    reference_R_pad: Array
    covariance: Array
    cost: float = 0.0

    def after(self, dt_s: float, *, in_world: bool) -> Turn:
        """Return what is known of it `dt_s` later."""
        walk, level_rad = (_TILT_WORLD, _LEVEL_WORLD_RAD) if in_world else (_TILT_BODY, _LEVEL_BODY_RAD)
        grown = self.covariance + dt_s * np.diag([walk, walk, _HEADING])
        share = min(dt_s / _LEVEL_EVERY_S, 1.0)
        known = np.diag([1.0, 1.0, 0.0]) * share / level_rad**2
        upright = _to_level(self.reference_R_pad)
        covariance = np.linalg.inv(np.linalg.inv(grown) + known)
        cost = self.cost + 0.5 * float(upright @ known @ upright)
        rotation = rotation_from_rotvec(covariance @ known @ upright) @ self.reference_R_pad
        return Turn(rotation, np.asarray(covariance), cost)

    def known(self, reference_R_camera: Array) -> Array:
        """Return its inverse covariance (3, 3) in the camera frame."""
        covariance = reference_R_camera.T @ self.covariance @ reference_R_camera
        return np.asarray(np.linalg.inv(covariance))

    def surprise(self, reference_R_pad: Array) -> float:
        """Return the negative log likelihood of a measured orientation (3, 3), which knew this one."""
        off = rotvec_from_rotation(reference_R_pad @ self.reference_R_pad.T)
        return 0.5 * float(off @ np.linalg.solve(self.covariance, off))


def measured(camera_T_pad: Pose, covariance: Array, reference_R_camera: Array, cost: float) -> Turn:
    """Return the hypothesis of a pose with the covariance (6, 6) of a left perturbation in the camera frame."""
    spread = reference_R_camera @ covariance[3:, 3:] @ reference_R_camera.T
    return Turn(reference_R_camera @ camera_T_pad.rotation, spread + _LEAST_RAD**2 * np.eye(3), cost)


def level(camera_T_pad: Pose, reference_R_camera: Array, *, in_world: bool) -> Turn:
    """Return what is thought of a pad's orientation before it is measured: level, and headed as a pose has it."""
    rotation = reference_R_camera @ camera_T_pad.rotation
    tilt = _LEVEL_WORLD_RAD if in_world else _LEVEL_BODY_RAD
    return Turn(rotation_from_rotvec(_to_level(rotation)) @ rotation, np.diag([tilt**2, tilt**2, math.pi**2]))


def _to_level(reference_R_pad: Array) -> Array:
    """Return the shortest turn (3,) that brings a pad's normal upright, rad."""
    normal = reference_R_pad[:, 2]
    axis = np.array([normal[1], -normal[0], 0.0])  # normal x up
    length = float(np.linalg.norm(axis))
    return np.zeros(3) if length < 1e-9 else axis / length * math.atan2(length, float(normal[2]))
