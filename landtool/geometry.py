"""Rigid transforms as values.

A variable that holds a `Pose` says both frames in its name: `camera_T_pad` takes points of the pad frame to the
camera frame, so `camera_T_pad @ pad_T_tag` is `camera_T_tag` and a mistake can be read off the names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def skew(v: ArrayLike) -> Array:
    """Return the (3, 3) matrix with `skew(v) @ w == cross(v, w)`."""
    x, y, z = np.asarray(v, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_from_rotvec(rotvec: ArrayLike) -> Array:
    """Return the (3, 3) rotation about `rotvec` (3,) by its length in radians."""
    x, y, z = np.asarray(rotvec, dtype=np.float64).tolist()
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared)
    if not math.isfinite(angle):
        return np.full((3, 3), np.nan)
    # Rodrigues: R = I + sin(a)/a K + (1 - cos(a))/a^2 K^2, with K = skew(w), a = |w| and K^2 = w w^T - a^2 I; written
    # out, as in numbers it takes a quarter of the time it takes in arrays
    s, c = (1.0, 0.5) if angle < 1e-8 else (math.sin(angle) / angle, 2.0 * (math.sin(0.5 * angle) / angle) ** 2)
    cx, cy, cz, d = c * x, c * y, c * z, 1.0 - c * squared
    return np.array(
        [
            [d + cx * x, cx * y - s * z, cx * z + s * y],
            [cx * y + s * z, d + cy * y, cy * z - s * x],
            [cx * z - s * y, cy * z + s * x, d + cz * z],
        ]
    )


def rotvec_from_rotation(rotation: ArrayLike) -> Array:
    """Return the rotation vector (3,) in radians, of length at most pi."""
    w, x, y, z = quaternion_from_rotation(rotation)
    v = np.array([x, y, z])
    s = float(np.linalg.norm(v))
    # angle = 2 atan2(|v|, w), axis = v / |v|; near zero v is half the rotation vector
    scale = 2.0 if s < 1e-12 else 2.0 * float(np.arctan2(s, w)) / s
    return scale * v


def rotation_from_quaternion(wxyz: ArrayLike) -> Array:
    """Return the (3, 3) rotation of a quaternion (4,), w first; it is normalised here.

    Raises ValueError for a quaternion of length zero or with values that are not finite.
    """
    q = np.asarray(wxyz, dtype=np.float64)
    norm = float(np.linalg.norm(q))
    if not np.isfinite(norm) or norm < 1e-12:
        raise ValueError("a quaternion needs a finite length above zero")
    w, x, y, z = q / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: ArrayLike) -> Array:
    """Return the unit quaternion (4,), w first and not negative."""
    r = np.asarray(rotation, dtype=np.float64)
    # Bar-Itzhack's symmetric form: the quaternion is the eigenvector of the largest eigenvalue
    k = np.array(
        [
            [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [0.0, r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2]],
            [0.0, 0.0, r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2]],
            [0.0, 0.0, 0.0, r[2, 2] - r[0, 0] - r[1, 1]],
        ]
    )
    q: Array = np.linalg.eigh(k, UPLO="U")[1][:, -1]
    return q if q[0] >= 0.0 else -q


def rotation_angle(rotation: ArrayLike) -> float:
    """Return the angle of a (3, 3) rotation in radians, in [0, pi]."""
    return float(np.linalg.norm(rotvec_from_rotation(rotation)))


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform `a_T_b`: p_a = rotation @ p_b + translation.

    rotation: (3, 3) float64, orthonormal, determinant 1. translation: (3,) float64, metres, in frame a.
    """

    rotation: Array
    translation: Array

    def __post_init__(self) -> None:
        for name, shape in (("rotation", (3, 3)), ("translation", (3,))):
            value = np.array(getattr(self, name), dtype=np.float64).reshape(shape)
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def identity(cls) -> Pose:
        """Return the transform that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_quaternion(cls, translation_m: ArrayLike, wxyz: ArrayLike) -> Pose:
        """Build from a translation (3,) in metres and a quaternion (4,), w first. Raises ValueError as above."""
        return cls(rotation_from_quaternion(wxyz), np.asarray(translation_m, dtype=np.float64))

    @classmethod
    def from_rotvec(cls, translation_m: ArrayLike, rotvec: ArrayLike) -> Pose:
        """Build from a translation (3,) in metres and a rotation vector (3,) in radians."""
        return cls(rotation_from_rotvec(rotvec), np.asarray(translation_m, dtype=np.float64))

    @property
    def quaternion_wxyz(self) -> Array:
        """The rotation as a unit quaternion (4,), w first and not negative."""
        return quaternion_from_rotation(self.rotation)

    @property
    def rotvec(self) -> Array:
        """The rotation as a vector (3,) in radians."""
        return rotvec_from_rotation(self.rotation)

    def inverse(self) -> Pose:
        """Return `b_T_a` of `a_T_b`."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def __matmul__(self, other: Pose) -> Pose:
        """Return `a_T_c = a_T_b @ b_T_c`."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def apply(self, points_m: ArrayLike) -> Array:
        """Take points (..., 3) of frame b, in metres, to frame a."""
        points: Array = np.asarray(points_m, dtype=np.float64) @ self.rotation.T + self.translation
        return points

    def perturbed(self, step: ArrayLike) -> Pose:
        """Return the pose moved by a left perturbation (dt, dw) (6,): t + dt in m, exp(dw) R in rad, in frame a."""
        d = np.asarray(step, dtype=np.float64)
        return Pose(rotation_from_rotvec(d[3:]) @ self.rotation, self.translation + d[:3])

    def angle_to(self, other: Pose) -> float:
        """Return the angle in radians between this rotation and another's."""
        return rotation_angle(self.rotation.T @ other.rotation)
