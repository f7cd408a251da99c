"""Pads and boxes as rectangles in a picture: (4,) x_min, y_min, x_max, y_max, OpenCV's pixels."""

from __future__ import annotations

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec

_ALIKE = 1.6  # a box of a pad differs from what is expected by less
_WIDTHS = 1.0  # how many of its own a pad may be from where it is expected, and as many more a second


def outline_px(camera: Camera, pad: PadSpec, camera_T_pad: Pose) -> Array | None:
    """Return the rectangle around a pad's outer edge; None where it is not all in front of the camera."""
    seen = camera.project(camera_T_pad.apply(pad.outline_m[::8] if pad.ring else pad.outline_m))
    if not np.isfinite(seen).all():
        return None
    return np.concatenate([seen.min(axis=0), seen.max(axis=0)])


def may_be_of(own_px: Array | None, box_px: Array, age_s: float) -> bool:
    """Return whether a box may be of a pad expected at a rectangle: of its size, and not farther off than it is wide.

    own_px: None where the expectation says nothing. age_s: since the pad was measured last.
    """
    if own_px is None:
        return True
    apart = np.abs((own_px[:2] + own_px[2:] - box_px[:2] - box_px[2:]) / 2.0).max()
    wide, seen = float((own_px[2:] - own_px[:2]).max()), float((box_px[2:] - box_px[:2]).max())
    return bool(apart < (_WIDTHS + max(age_s, 0.0)) * wide and 1.0 / _ALIKE < seen / wide < _ALIKE)


def is_cut(camera: Camera, box_px: Array) -> bool:
    """Return whether a box ends at the picture's border."""
    return bool((box_px[:2] < 1.0).any() or (box_px[2:] > np.array([camera.width, camera.height]) - 2.0).any())


def shrunk(box_px: Array, share: float) -> Array:
    """Return a rectangle shrunk about its middle."""
    middle, half = (box_px[:2] + box_px[2:]) / 2.0, (box_px[2:] - box_px[:2]) / 2.0
    return np.concatenate([middle - share * half, middle + share * half])
