"""Views and scenes that the tests of the renderer share."""

from __future__ import annotations

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.synth.grounds import ground
from landtool.synth.scene import Scene, Sun, Target
from landtool.synth.sheet import clean_sheet
from landtool.synth.view import View

PAD = PadSpec()
PINHOLE = Camera(320, 240, 260.0, 261.0, 158.3, 121.4)
BENT = Camera(320, 240, 200.0, 201.0, 158.3, 121.4, distortion=(-0.22, 0.09, 0.001, -0.0007, 0.0))
# light from straight above, half of it from the sky
NOON = Sun((0.0, 0.0, 1.0), (0.4, 0.4, 0.4), (0.4, 0.4, 0.4))


def over(height_m: float, tilt_rad: float = 0.0, yaw_rad: float = 0.0, off_m: tuple[float, float] = (0.0, 0.0)) -> Pose:
    """Return world_T_camera of a camera that looks down from a height, tilted, beside the origin."""
    lean = rotation_from_rotvec([0.6 * tilt_rad, 0.8 * tilt_rad, 0.0])
    turn = lean @ rotation_from_rotvec([0.0, 0.0, yaw_rad]) @ STRAIGHT_DOWN.rotation
    return Pose(turn, np.array([*off_m, height_m]))


def moving(camera: Camera, world_T_camera: Pose) -> View:
    """Return a view with all the motion a landing may have, and a slow rolling shutter."""
    velocity, rate = np.array([2.0, -1.5, -0.8]), np.array([0.4, -0.3, 0.6])
    return View(camera, world_T_camera, velocity, rate, 0.004, 0.03)


def scene_of(world_T_pad: Pose | None, **parts: object) -> Scene:
    """Return a plain scene: concrete, noon, and a clean pad at a pose."""
    target = None if world_T_pad is None else Target(PAD, clean_sheet(PAD), world_T_pad)
    return Scene(ground("concrete", 0, 7), NOON, target, **parts)  # type: ignore[arg-type]
