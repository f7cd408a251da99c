"""From a pad seen by the camera to a place in the frame the platform is tracked in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose, skew
from landtool.tracking.measurement import PlanarMeasurement
from landtool.types import PadPose


@dataclass(frozen=True)
class EgoNoise:
    """How far the drone's own poses are off, new from pose to pose: standard deviations a direction."""

    position_m: float = 0.0
    attitude_rad: float = 0.0

    def covariance(self, lever_m: Array) -> Array:
        """Return what it adds (3, 3), m^2, to a place `lever_m` (3,) away from the body."""
        # p = t + R l, so dp = dt - [l] dw and C = s_t^2 I + s_w^2 [l] [l]^T = s_t^2 I + s_w^2 (l.l I - l l^T)
        turned = float(lever_m @ lever_m) * np.eye(3) - np.outer(lever_m, lever_m)
        added: Array = self.position_m**2 * np.eye(3) + self.attitude_rad**2 * turned
        return added


def to_reference(
    pose: PadPose,
    body_T_camera: Pose,
    world_T_body: Pose | None = None,
    ego_noise: EgoNoise | None = None,
    ego_share: float = 1.0,
) -> PlanarMeasurement:
    """Return where the pad's centre is in the world's plane, or without the drone's own pose in the body's.

    The covariance is the pose's own, turned, and in the world that of the drone's pose; the mount is taken as exact.
    ego_share: of the variance of the drone's pose, less than 1 between two measured ones.
    """
    reference_T_camera = body_T_camera if world_T_body is None else world_T_body @ body_T_camera
    rotation = reference_T_camera.rotation
    centre = reference_T_camera.apply(pose.camera_T_pad.translation)
    # the translation block belongs to t + dt in the camera frame: it turns with the axes, C' = R C R^T
    covariance = rotation @ pose.covariance[:3, :3] @ rotation.T
    lever_m = np.zeros((3, 3))
    if world_T_body is not None:
        arm = centre - world_T_body.translation
        if ego_noise is not None:
            covariance = covariance + ego_share * ego_noise.covariance(arm)
        # of p = t + R exp(b) l: dp/db = -R [l]
        lever_m = -world_T_body.rotation @ skew(world_T_body.rotation.T @ arm)
    return PlanarMeasurement(centre[:2], covariance[:2, :2], float(centre[2]), float(covariance[2, 2]), lever_m[:2])
