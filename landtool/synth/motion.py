"""A simple landing as a function of time: a platform that drives, a drone that comes down on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.errors import UsageError
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN


@dataclass(frozen=True)
class Approach:
    """A drone that follows a platform and sinks steadily from one height above the pad to another.

    The world is level, z up, its ground at z = 0; at t = 0 the pad is above its origin and drives along x.

    duration_s: time of the descent; afterwards the last height is held. height_start_m, height_end_m: of the body
    above the pad. speed_mps: of the platform along its own heading. turn_rate_radps: its turning, left positive.
    pad_height_m: of the pad above the ground. lateral_start_m: place of the body (forward, left) in the platform's
    heading at t = 0; the error decays to 1/e in lateral_decay_s. sway_rad: amplitude of the body's roll and pitch,
    which swing with sway_period_s and 1.3 times that. yaw_rad: heading of the body relative to the platform's.

    Raises UsageError for times and heights that are not positive.
    """

    duration_s: float
    height_start_m: float
    height_end_m: float
    speed_mps: float
    turn_rate_radps: float = 0.0
    pad_height_m: float = 0.3
    lateral_start_m: tuple[float, float] = (0.0, 0.0)
    lateral_decay_s: float = 3.0
    sway_rad: float = 0.0
    sway_period_s: float = 2.0
    yaw_rad: float = 0.0
    body_T_camera: Pose = STRAIGHT_DOWN

    def __post_init__(self) -> None:
        for name in ("duration_s", "height_start_m", "height_end_m", "lateral_decay_s", "sway_period_s"):
            if not getattr(self, name) > 0.0:
                raise UsageError(f"{name} = {getattr(self, name)} is not positive")

    def pose_at(self, t_s: float) -> tuple[Pose, Pose]:
        """Return (world_T_body, world_T_pad) at a time in seconds."""
        world_T_pad = self.world_T_pad(t_s)
        share = min(max(t_s / self.duration_s, 0.0), 1.0)
        height = self.height_start_m + share * (self.height_end_m - self.height_start_m)
        forward, left = np.array(self.lateral_start_m) * math.exp(-t_s / self.lateral_decay_s)
        phase = 2.0 * math.pi * t_s / self.sway_period_s
        # the second swing is slower, so that roll and pitch do not repeat together
        roll, pitch = self.sway_rad * math.sin(phase), self.sway_rad * math.sin(phase / 1.3 + 1.0)
        # z-y-x order (REP 103): heading first, then pitch, then roll
        turn = _turn(2, self.yaw_rad) @ _turn(1, pitch) @ _turn(0, roll)
        pad_T_body = Pose(turn, np.array([forward, left, height]))
        return world_T_pad @ pad_T_body, world_T_pad

    def world_T_pad(self, t_s: float) -> Pose:
        """Return the pad's pose at a time in seconds; its x axis is the direction of travel."""
        heading = self.turn_rate_radps * t_s
        # x = v/w sin(wt), y = v/w (1 - cos(wt)), as a chord so that w = 0 is a straight line
        chord = self.speed_mps * t_s * float(np.sinc(heading / 2.0 / math.pi))
        place = np.array([chord * math.cos(heading / 2.0), chord * math.sin(heading / 2.0), self.pad_height_m])
        return Pose(_turn(2, heading), place)

    def camera_T_pad(self, t_s: float) -> Pose:
        """Return the pad in the camera frame at a time in seconds."""
        world_T_body, world_T_pad = self.pose_at(t_s)
        return (world_T_body @ self.body_T_camera).inverse() @ world_T_pad

    def camera_T_ground(self, t_s: float) -> Pose:
        """Return the world, whose plane z = 0 is the ground, in the camera frame at a time in seconds."""
        world_T_body, _ = self.pose_at(t_s)
        return (world_T_body @ self.body_T_camera).inverse()

    def pad_velocity_mps(self, t_s: float) -> Array:
        """Return the pad's velocity (3,) in the world."""
        heading = self.turn_rate_radps * t_s
        return self.speed_mps * np.array([math.cos(heading), math.sin(heading), 0.0])


def _turn(axis: int, angle_rad: float) -> Array:
    return rotation_from_rotvec(angle_rad * np.eye(3)[axis])
