"""A pad's pose from nothing but the box around its ring: the bearing of its middle, the distance by its size."""

from __future__ import annotations

import math

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose, skew
from landtool.pad import PadSpec
from landtool.types import Detection, PadPose

# How far the middle and the size of a network's box may be off, of its longer side and in pixels: a bright board, or
# what it lies on, is easily taken for a part of the pad
_MIDDLE_SHARE, _SIZE_SHARE, _BOX_PX = 0.04, 0.12, 0.7
# A pad this wide whose print is not seen is covered, or cut by something: its box may be of a part of it
_WIDE_PX, _COVERED_SHARE = 36.0, 0.15
_CUT_PX = 1.5  # a box that ends this near to the picture's border is cut by it
_TILT_RAD = math.radians(12.0)  # of a platform under a camera whose attitude is roughly known
_HEADING_RAD = math.pi / math.sqrt(3.0)  # any heading is as likely


def box_edges(box: Detection) -> Array:
    """Return a box's edges (4,) x_min, y_min, x_max, y_max, pixels."""
    return np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px])


def box_pose(
    camera: Camera, pad: PadSpec, box_px: Array, reference_R_camera: Array, last: Pose | None = None
) -> PadPose | None:
    """Return where a pad is by a box (4,) of its ring's outer circle; None for a pad without a ring.

    Of a circle seen at a slant the longer side of the box is its diameter. reference_R_camera: (3, 3), z up: the pad is
    taken for level. last: the pad's pose when it was last measured, of which the heading is kept.
    """
    if pad.ring is None:
        return None
    end = np.array([camera.width, camera.height]) - 0.5
    cut = bool((box_px[:2] < _CUT_PX - 0.5).any() or (box_px[2:] > end - _CUT_PX).any())
    side = float((box_px[2:] - box_px[:2]).max())
    covered = _COVERED_SHARE if side > _WIDE_PX else 0.0
    edges = camera.normalize(np.stack([box_px[:2], box_px[2:], (box_px[:2] + box_px[2:]) / 2.0]))
    if not np.isfinite(edges).all():
        return None
    low, high, middle = edges
    sides = high - low
    diameter_m = pad.ring.outer * pad.diameter_m
    ray = np.array([*middle, 1.0])
    # a level circle below a camera that looks down is seen as a circle of D f / z wherever it is in the picture
    z = diameter_m / float(sides.max())
    sigma_px = max(_MIDDLE_SHARE, covered) * side + _BOX_PX
    sigma_z = z * (max(_SIZE_SHARE, 1.5 * covered) + _BOX_PX / side)
    across = sigma_px / camera.fx * z
    if cut:  # what is out of the picture is not known: the middle, nor the size
        across, sigma_z = 0.5 * diameter_m, 0.5 * z
    place = z * ray
    unit = ray / np.linalg.norm(ray)
    along = np.outer(unit, unit)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = across**2 * (np.eye(3) - along) + sigma_z**2 * float(ray @ ray) * along
    normal = reference_R_camera.T @ np.array([0.0, 0.0, 1.0])
    upright = np.outer(normal, normal)
    heading = _HEADING_RAD if last is None else math.radians(20.0)
    covariance[3:, 3:] = _TILT_RAD**2 * (np.eye(3) - upright) + heading**2 * upright
    return PadPose(Pose(_level(normal, last), place), covariance, "box", 1.0, sigma_px)


def _level(normal: Array, last: Pose | None) -> Array:
    """Return a rotation (3, 3) whose z is the normal and whose x is as near as can be to the last one's."""
    forward = np.array([0.0, -1.0, 0.0]) if last is None else last.rotation[:, 0]
    y = skew(normal) @ forward
    if float(np.linalg.norm(y)) < 1e-6:
        y = skew(normal) @ np.array([1.0, 0.0, 0.0])
    y = y / np.linalg.norm(y)
    return np.column_stack([skew(y) @ normal, y, normal])
