"""From a pad seen by the camera to a place in the frame the platform is tracked in."""

from __future__ import annotations

from landtool.geometry import Pose
from landtool.tracking.tracker import PlanarMeasurement
from landtool.types import PadPose


def to_reference(pose: PadPose, body_T_camera: Pose, world_T_body: Pose | None = None) -> PlanarMeasurement:
    """Return where the pad's centre is in the world's plane, or without the drone's own pose in the body's.

    The covariance is the pose's own, turned; the drone's pose and the mount are taken as exact.
    """
    reference_T_camera = body_T_camera if world_T_body is None else world_T_body @ body_T_camera
    rotation = reference_T_camera.rotation
    centre = reference_T_camera.apply(pose.camera_T_pad.translation)
    # the translation block belongs to t + dt in the camera frame: it turns with the axes, C' = R C R^T
    covariance = rotation @ pose.covariance[:3, :3] @ rotation.T
    return PlanarMeasurement(centre[:2], covariance[:2, :2])
