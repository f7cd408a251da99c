"""Where a pad may be by a box around it: poses to begin the registration of the whole print at.

The ring's ellipse and the letter in it, of small pads the whole print, give an affine map of the print into the
picture; its four points on the ring are seen from two poses, mirror images about the line of sight (IPPE: Collins and
Bartoli, 2014). Half a turn about the pad's normal is left open, as the H looks the same.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.pad import PadSpec
from landtool.target.ellipse import Ellipse
from landtool.target.letter import find_letter
from landtool.target.print_fit import is_sure, register_print
from landtool.target.ring import fit_ring
from landtool.tone import Tone
from landtool.types import Image

_THIN_PX = 26.0  # rings this narrow are found by the whole print first
_MOST_PX = 60.0  # and never beyond, where too little of the blur is left that its fit is made for
_LEAST_LETTER = 0.45
_ON_RING = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])  # u right, v down, in radii


def start_poses(image: Image, camera: Camera, box_px: Array, pad: PadSpec, tone: Tone = "srgb") -> tuple[Pose, ...]:
    """Return one or two poses of the pad at a box (4,) x_min, y_min, x_max, y_max of its ring's outer circle, pixels.

    None of them is refined; both may be half a turn off. Empty where the picture does not show ring and letter.
    image: (H, W, 3) BGR uint8. box_px: its edges may be off by 12 %.
    """
    found = _by_ring(image, box_px, pad, tone) or _by_print(image, box_px, pad, tone)
    return () if found is None else affine_poses(camera, *found, pad)


def affine_poses(camera: Camera, axes: Array, centre_px: Array, pad: PadSpec) -> tuple[Pose, ...]:
    """Return the poses of a pad whose print (u, v), in radii right and down, is seen at axes @ (u, v) + centre.

    axes: (2, 2), centre_px: (2,), pixels. Empty outside what the lens model covers.
    """
    assert pad.ring is not None
    flat = camera.normalize(centre_px + _ON_RING @ axes.T)
    if not np.isfinite(flat).all():
        return ()
    radius_m = pad.ring.outer * pad.diameter_m / 2.0
    # u is the pad's -y, v its -x
    points = np.column_stack([-_ON_RING[:, 1], -_ON_RING[:, 0], np.zeros(4)]) * radius_m
    found = cv2.solvePnPGeneric(points, flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    poses = [
        Pose(rotation_from_rotvec(r.ravel()), np.asarray(t, np.float64))
        for r, t in zip(found[1], found[2], strict=True)
    ]
    return tuple(pose for pose in poses if faces_camera(pose))


def faces_camera(camera_T_pad: Pose) -> bool:
    """Return whether a pad is in front of the camera and shows it its upper side."""
    normal, place = camera_T_pad.rotation[:, 2], camera_T_pad.translation
    return bool(np.isfinite(place).all() and place[2] > 0.0 and normal @ place < 0.0)


def _by_ring(image: Image, box_px: Array, pad: PadSpec, tone: Tone) -> tuple[Array, Array] | None:
    if float((box_px[2:] - box_px[:2]).max()) < _THIN_PX:
        return None
    ring = fit_ring(image, box_px, pad, tone)
    if ring is None:
        return None
    letter = find_letter(image, ring.ellipse, pad)
    if letter is None or letter.likeness < _LEAST_LETTER:
        return None
    c, s = math.cos(letter.turn_rad), math.sin(letter.turn_rad)
    return _root(ring.ellipse) @ np.array([[c, -s], [s, c]]), np.array([ring.ellipse.cx_px, ring.ellipse.cy_px])


def _root(ellipse: Ellipse) -> Array:
    """Return the map (2, 2) of the unit circle onto an ellipse about its middle, as `LetterSight` has it."""
    other = math.sqrt(1.0 - ellipse.slant**2)
    return np.array([[ellipse.sx_px, 0.0], [ellipse.slant * ellipse.sy_px, other * ellipse.sy_px]])


def _by_print(image: Image, box_px: Array, pad: PadSpec, tone: Tone) -> tuple[Array, Array] | None:
    if float((box_px[2:] - box_px[:2]).max()) > _MOST_PX:
        return None
    fitted = register_print(image, box_px, pad, tone)
    if fitted is None or not is_sure(fitted, box_px):
        return None
    return fitted.axes, np.array([fitted.ellipse.cx_px, fitted.ellipse.cy_px])
