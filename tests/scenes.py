"""Rendered views of the pad with exact truth, for tests and benchmarks."""

from __future__ import annotations

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.render import encode, render_pad
from landtool.types import Image

CAMERA = Camera(640, 480, 554.0, 554.0, 319.5, 239.5)
PAD = PadSpec()
# Noise of the mean grey level this many times that of a single channel: sqrt(0.299^2 + 0.587^2 + 0.114^2)
_GREY_SHARE = 0.669
# pictures in which nothing but geometry and a good camera is at work
CLEAN_DOMAIN = Domain(
    height_m=(0.6, 5.0), absent=0.0, cut=0.0, least_visible=1.0, small_print=0.0, occlusion=0.0, dirt=(0.0, 0.0),
    curl=0.0, gloss=0.0, light=(0.6, 0.9), shadow=0.0, drone_shadow=0.0, fog=0.0, defocus=0.0, motion_blur=0.0,
    rolling_shutter=0.0, shot_noise=(0.0, 0.0), read_noise=(0.0, 0.0), bayer=0.0, rescaled=0.0, sharpen=(0.0, 0.0),
    tone=0.0, white_balance=0.0, vignette=(0.0, 0.0), jpeg_quality=(100.0, 100.0),
)  # fmt: skip


def view(
    distance_m: float, tilt_deg: float, azimuth_rad: float, yaw_rad: float, off: tuple[float, float] = (0.0, 0.0)
) -> Pose:
    """Return camera_T_pad of a camera that looks down on the pad, tilted, with the pad at `off` times the distance."""
    tilt = np.radians(tilt_deg) * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    turn = rotation_from_rotvec(tilt) @ STRAIGHT_DOWN.rotation.T @ rotation_from_rotvec([0.0, 0.0, yaw_rad])
    return Pose(turn, distance_m * np.array([off[0], off[1], 1.0]))


def photograph(
    camera_T_pad: Pose,
    rng: np.random.Generator,
    *,
    camera: Camera = CAMERA,
    pad: PadSpec = PAD,
    grey_noise: float = 3.0,
    light: float = 0.8,
    blur_px: float = 0.6,
) -> Image:
    """Render the pad over a plain ground as a camera would store it; grey_noise: of the grey picture, levels."""
    ground = np.full((camera.height, camera.width, 3), 0.2, np.float32)
    scene = light * render_pad(camera, camera_T_pad, pad, background=ground)
    return encode(scene, blur_sigma_px=blur_px, noise_sigma=grey_noise / _GREY_SHARE, rng=rng)


def mirrored(estimate: Pose, truth: Pose) -> bool:
    """Whether a pose's normal is nearer to the mirror image of the true one, about the line of sight, than to it.

    Where the two are less than 4 degrees apart they are one within the noise.
    """
    sight = truth.translation / np.linalg.norm(truth.translation)
    normal, found = truth.rotation[:, 2], estimate.rotation[:, 2]
    mirror = 2.0 * (normal @ sight) * sight - normal
    apart = np.degrees(np.arccos(np.clip(normal @ mirror, -1.0, 1.0)))
    return bool(apart > 4.0 and found @ mirror > found @ normal)
