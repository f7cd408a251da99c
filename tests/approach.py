"""A plain landing as a function of time, for tests: a platform that drives straight on, a drone that sinks over it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN

PAD_HEIGHT_M = 0.3


@dataclass(frozen=True)
class Approach:
    """The world is level, z up, its ground at z = 0; at t = 0 the pad is above its origin and drives along x.

    duration_s: time of the descent. height_start_m, height_end_m: of the body above the pad. speed_mps: of the
    platform. lateral_start_m: place of the body (forward, left) over the pad at t = 0; it decays to 1/e in 3 s.
    sway_rad: amplitude of the body's roll and pitch, which swing with sway_period_s and 1.3 times that. yaw_rad:
    heading of the body.
    """

    duration_s: float
    height_start_m: float
    height_end_m: float
    speed_mps: float
    lateral_start_m: tuple[float, float] = (0.0, 0.0)
    sway_rad: float = 0.0
    sway_period_s: float = 2.0
    yaw_rad: float = 0.0

    def pose_at(self, t_s: float) -> tuple[Pose, Pose]:
        """Return (world_T_body, world_T_pad) at a time in seconds."""
        world_T_pad = Pose(np.eye(3), np.array([self.speed_mps * t_s, 0.0, PAD_HEIGHT_M]))
        height = self.height_start_m + t_s / self.duration_s * (self.height_end_m - self.height_start_m)
        forward, left = np.array(self.lateral_start_m) * math.exp(-t_s / 3.0)
        phase = 2.0 * math.pi * t_s / self.sway_period_s
        # the second swing is slower, so that roll and pitch do not repeat together
        roll, pitch = self.sway_rad * math.sin(phase), self.sway_rad * math.sin(phase / 1.3 + 1.0)
        turn = _turn(2, self.yaw_rad) @ _turn(1, pitch) @ _turn(0, roll)
        return world_T_pad @ Pose(turn, np.array([forward, left, height])), world_T_pad

    def camera_T_pad(self, t_s: float) -> Pose:
        """Return the pad in the frame of a camera that looks straight down, at a time in seconds."""
        world_T_body, world_T_pad = self.pose_at(t_s)
        return (world_T_body @ STRAIGHT_DOWN).inverse() @ world_T_pad


def _turn(axis: int, angle_rad: float) -> Array:
    return rotation_from_rotvec(angle_rad * np.eye(3)[axis])
