"""A pad's pose from nothing but the box around its ring: the bearing of its middle, the distance by its size."""

from __future__ import annotations

import math

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose, skew
from landtool.pad import PadSpec
from landtool.target.ring import fit_ring
from landtool.tone import Tone
from landtool.types import Detection, Image, PadPose

# How far a network's box may be off, of its longer side and in pixels; one moved onto the ring is far better
_BOX_SHARE, _BOX_PX = 0.04, 0.7
# A pad this wide whose print is not seen is covered, or cut by something: its box may be of a part of it
_WIDE_PX, _COVERED_SHARE = 36.0, 0.15
_RING_SHARE, _RING_PX = 0.006, 0.2
_CUT_PX = 1.5  # a box that ends this near to the picture's border is cut by it
_TILT_RAD = math.radians(12.0)  # of a platform under a camera whose attitude is roughly known
_HEADING_RAD = math.pi / math.sqrt(3.0)  # any heading is as likely
_RING_LEAST_PX = 26.0


def box_edges(box: Detection) -> Array:
    """Return a box's edges (4,) x_min, y_min, x_max, y_max, pixels."""
    return np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px])


def ring_box(image: Image, box_px: Array, pad: PadSpec, tone: Tone) -> Array | None:
    """Return a box (4,) moved onto the ring's outer circle; None where the ring is not seen.

    Where the picture's border cuts the ring the box goes on beyond it.
    """
    if float((box_px[2:] - box_px[:2]).max()) < _RING_LEAST_PX:
        return None
    ring = fit_ring(image, box_px, pad, tone)
    return None if ring is None else ring.ellipse.box_px


def box_pose(
    camera: Camera,
    pad: PadSpec,
    box_px: Array,
    reference_R_camera: Array,
    *,
    on_ring: bool = False,
    last: Pose | None = None,
) -> PadPose | None:
    """Return where a pad is by a box (4,) of its ring's outer circle; None for a pad without a ring.

    Of a circle seen at a slant the longer side of the box is its diameter. reference_R_camera: (3, 3), z up: the pad is
    taken for level. on_ring: the box is one of `ring_box`. last: the pad's pose when it was last measured, of which the
    heading is kept.
    """
    if pad.ring is None:
        return None
    end = np.array([camera.width, camera.height]) - 0.5
    cut = not on_ring and bool((box_px[:2] < _CUT_PX - 0.5).any() or (box_px[2:] > end - _CUT_PX).any())
    side = float((box_px[2:] - box_px[:2]).max())
    share, px = (_RING_SHARE, _RING_PX) if on_ring else (_BOX_SHARE, _BOX_PX)
    if side > _WIDE_PX and not on_ring:
        share = _COVERED_SHARE
    edges = camera.normalize(np.stack([box_px[:2], box_px[2:], (box_px[:2] + box_px[2:]) / 2.0]))
    if not np.isfinite(edges).all():
        return None
    low, high, middle = edges
    sides = high - low
    diameter_m = pad.ring.outer * pad.diameter_m
    ray = np.array([*middle, 1.0])
    # off the axis a circle across the line of sight is seen larger by 1 / cos in its radial direction
    z = diameter_m / float(sides.max()) * math.sqrt(float(ray @ ray)) ** 0.5
    sigma_px = share * side + px
    # a tilt of up to 12 degrees shortens both sides by 2 %
    sigma_z = z * math.hypot(1.5 * sigma_px / side, 0.02)
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
