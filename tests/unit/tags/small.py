"""Small rendered pictures with one tag in the middle, quick enough to make hundreds of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.synth.truth import tag_corners_px
from landtool.types import Image
from tests.scenes import PAD, photograph, view

FOCAL_PX = 554.0


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, the camera it was taken with, and what is true of it."""

    image: Image
    camera: Camera
    camera_T_pad: Pose
    corners_px: Array


def small_camera(side_px: float, distortion: tuple[float, ...] = (0.0,) * 5) -> Camera:
    """A camera whose picture is about twice as wide as the tag."""
    n = int(2.4 * side_px) + 24
    return Camera(n, n, FOCAL_PX, FOCAL_PX, (n - 1) / 2.0, (n - 1) / 2.0, "plumb_bob", distortion)


def shoot(
    side_px: float,
    rng: np.random.Generator,
    *,
    tilt_deg: tuple[float, float] = (0.0, 35.0),
    pad: PadSpec = PAD,
    distortion: tuple[float, ...] = (0.0,) * 5,
    **how: float,
) -> Shot:
    """Photograph the pad's first tag at a side of `side_px`, tilted and turned at random; how: as in `photograph`."""
    camera = small_camera(side_px, distortion)
    distance_m = FOCAL_PX * pad.tag_size_m(pad.tags[0]) / side_px
    off = tuple(rng.uniform(-2.0, 2.0, 2) / FOCAL_PX)
    pose = view(distance_m, rng.uniform(*tilt_deg), rng.uniform(0.0, 6.28), rng.uniform(0.0, 6.28), (off[0], off[1]))
    image = photograph(pose, rng, camera=camera, pad=pad, **how)
    return Shot(image, camera, pose, tag_corners_px(camera, pose, pad, pad.tags[0]))
