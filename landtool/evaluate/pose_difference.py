"""How far a pose is from the true one, and whether it is one of its look-alikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose, rotvec_from_rotation
from landtool.types import PadPose

MIRROR_MARGIN_DEG = 4.0  # by which the mirror image must fit better: nearer than that the two can hardly be told apart
HALF_TURN_DEG = 90.0
TOLD_RAD = 0.3  # a turn about the normal less certain than this says itself that it may be half a turn off


@dataclass(frozen=True)
class PoseDifference:
    """Errors of one pose: of place altogether, along and across the true line of sight, m; of normal and turn, deg."""

    place_m: float
    along_m: float
    across_m: float
    normal_deg: float
    rotation_deg: float


def pose_difference(found: Pose, true: Pose) -> PoseDifference:
    """Return how far `camera_T_pad` is from the true one."""
    ray = true.translation / np.linalg.norm(true.translation)
    off = found.translation - true.translation
    along = float(off @ ray)
    across = float(np.linalg.norm(off - along * ray))
    normal = _between_deg(found.rotation[:, 2], true.rotation[:, 2])
    return PoseDifference(
        float(np.linalg.norm(off)), abs(along), across, normal, float(np.degrees(found.angle_to(true)))
    )


def mirrored(found: Pose, true: Pose) -> bool:
    """Whether the normal is nearer to the mirror image of the true one about the line of sight, by 4 degrees."""
    ray = true.translation / np.linalg.norm(true.translation)
    normal = true.rotation[:, 2]
    # n' = 2 (n . r) r - n: the other plane that looks the same from afar (Collins and Bartoli, 2014)
    image = 2.0 * float(normal @ ray) * ray - normal
    seen = found.rotation[:, 2]
    return _between_deg(seen, image) < _between_deg(seen, normal) - MIRROR_MARGIN_DEG


def half_turned(found: Pose, true: Pose) -> bool:
    """Whether the pose is nearer to the one turned by 180 degrees, as an H looks the same."""
    return bool(np.degrees(found.angle_to(true)) > HALF_TURN_DEG)


def turn_told(pose: PadPose) -> bool:
    """Whether the pose's own covariance says that the turn about the normal is not known."""
    normal = pose.camera_T_pad.rotation[:, 2]
    return float(normal @ pose.covariance[3:, 3:] @ normal) > TOLD_RAD**2


def place_nees(pose: PadPose, true: Pose) -> float | None:
    """Return the normalised error squared of the place, 3 degrees of freedom."""
    return normalised(pose.camera_T_pad.translation - true.translation, pose.covariance[:3, :3])


def rotation_nees(pose: PadPose, true: Pose) -> float | None:
    """Return the normalised error squared of the rotation, 3 degrees of freedom."""
    # R = exp(dw) R_true, as the covariance has it
    off = rotvec_from_rotation(pose.camera_T_pad.rotation @ true.rotation.T)
    return normalised(off, pose.covariance[3:, 3:])


def normalised(off: Array, covariance: Array) -> float | None:
    """Return e^T P^-1 e of an error (n,) and its covariance (n, n); None where the covariance has no inverse."""
    try:
        value = float(off @ np.linalg.solve(covariance, off))
    except np.linalg.LinAlgError:
        return None
    return value if np.isfinite(value) else None


def _between_deg(a: Array, b: Array) -> float:
    return float(np.degrees(np.arccos(np.clip(float(a @ b), -1.0, 1.0))))
