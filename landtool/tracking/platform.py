"""The platform's track: pad poses in, tracks out, in the body frame or, with the drone's own pose, in the world."""

from __future__ import annotations

import math

from landtool.geometry import Pose
from landtool.tracking.ego import EgoTrajectory
from landtool.tracking.reference import EgoNoise, to_reference
from landtool.tracking.tracker import PlanarMeasurement, Tracker, TrackerConfig
from landtool.types import PadPose, Track


class PlatformTracker:
    """Follows the pad through time.

    body_T_camera: the camera's mount. ego: the drone's own motion; with it the reference is the world.
    """

    def __init__(self, config: TrackerConfig, body_T_camera: Pose, ego: EgoTrajectory | None = None) -> None:
        self._tracker = Tracker(config, "world" if ego else "body")
        self._body_T_camera, self._ego = body_T_camera, ego
        self._ego_noise = EgoNoise(config.ego_position_sigma_m, math.radians(config.ego_attitude_sigma_deg))

    def world_T_body(self, t_ns: int | None) -> Pose | None:
        """Return the drone's pose at a time, None where it is not known."""
        return self._ego.at(t_ns) if self._ego is not None and t_ns is not None else None

    def camera_T_reference(self, t_ns: int | None) -> Pose | None:
        """Return the pose of the tracks' reference frame in the camera, None where it is not known."""
        if self._ego is None:
            return self._body_T_camera.inverse()
        world_T_body = self.world_T_body(t_ns)
        return None if world_T_body is None else (world_T_body @ self._body_T_camera).inverse()

    def placed(self, t_ns: int | None, pose: PadPose | None) -> tuple[Pose | None, Pose | None]:
        """Return (body_T_pad, world_T_pad) of a measured pose, None for what is not known."""
        if pose is None:
            return None, None
        body_T_pad = self._body_T_camera @ pose.camera_T_pad
        world_T_body = self.world_T_body(t_ns)
        return body_T_pad, None if world_T_body is None else world_T_body @ body_T_pad

    def step(self, t_ns: int | None, pose: PadPose | None) -> tuple[tuple[Track, ...], str]:
        """Advance to a frame's time with what was measured in it; returns the tracks and what a log should say."""
        if t_ns is None:
            return (), "no clock, so no track" if pose else ""
        world_T_body = self.world_T_body(t_ns)
        measurements: list[PlanarMeasurement] = []
        said = ""
        if pose is not None and self._ego is not None and world_T_body is None:
            said = "the drone's own pose is not known at this time"
        elif pose is not None:
            measurements = [to_reference(pose, self._body_T_camera, world_T_body, self._ego_noise)]
        tracks = self._tracker.step(t_ns, measurements)
        return tracks, "; ".join(filter(None, [said, self._tracker.note]))
