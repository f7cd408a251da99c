"""One generated picture and everything that is true of it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.types import Image


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true of a generated picture. Where no pad is in it, what is said of the pad is None, 0 or empty.

    visible_fraction: share of the disc inside the ring's outer circle that is in the picture and not hidden.
    box_px: (4,) the ring's tight box x_min, y_min, x_max, y_max, clipped to the picture, OpenCV's pixels.
    tag_corners_px: (4, 2) of the pad's first tag, upright top-left, top-right, bottom-right, bottom-left; in the
    picture or not. size_px: diameter of the ring if it faced the camera where it is. height_m: camera over the pad.
    tilt_rad: of the optical axis against straight down. yaw_rad: of the pad about its own normal against the camera.
    hidden: share of the disc hidden by things in front of it. beta_per_m, airlight: of the fog (linear light, blue
    first), 0 and None for clear air. light: of a white level surface, before the camera's exposure. shadow: share of
    the disc in shadow. ground, carrier, signs: names. applied: what else was done to the picture, by name.
    """

    camera: Camera
    present: bool
    visible_fraction: float = 0.0
    box_px: Array | None = None
    camera_T_pad: Pose | None = None
    tag_corners_px: Array | None = None
    size_px: float = 0.0
    height_m: float = 0.0
    distance_m: float = 0.0
    tilt_rad: float = 0.0
    yaw_rad: float = 0.0
    hidden: float = 0.0
    beta_per_m: float = 0.0
    airlight: tuple[float, float, float] | None = None
    light: float = 1.0
    shadow: float = 0.0
    ground: str = ""
    carrier: str = ""
    signs: tuple[str, ...] = ()
    applied: tuple[tuple[str, float | str], ...] = ()


@dataclass(frozen=True, eq=False)
class Sample:
    """A picture as the content of its .jpg file, and its truth.

    clear: of a picture in fog the same in clear air without noise, a .jpg file, too; None elsewhere, or not asked for.
    """

    jpeg: bytes
    truth: Truth
    clear: bytes | None = None

    @property
    def image(self) -> Image:
        """The picture (H, W, 3) BGR uint8 that the file decodes to."""
        return np.asarray(cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR), dtype=np.uint8)
