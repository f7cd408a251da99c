"""One pad measured in one picture: by its tags and large edges, by its whole print, or by the box around it.

What no picture tells is added to every covariance: paper is not flat and no lens exactly as calibrated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.pad import PadSpec
from landtool.tags.pose import Solution, pad_corners, pad_solutions
from landtool.target.refine import refine_on_edges
from landtool.target.register import Registered, register_target
from landtool.target.start import faces_camera, start_poses
from landtool.tone import Tone
from landtool.types import Image, TagObservation

HALF_TURN = Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))

# What a print must look like: where it is expected, and where it is seen for the first time
_LIKE_EXPECTED, _LIKE_NEW = 0.6, 0.72
_LEAST_SHARE = 0.35
_COARSE_PX, _LIKE_COARSE = 26.0, 0.5
# Of pads so narrow every pixel of the print counts more than the tag's corners and the few edges that are long enough
PRINT_PX = 90.0
_FEW_STEPS = 6
_WELL_PX = 0.7  # corners nearer to their places, RMS: the start was no worse than another
# What is not known of any pad and lens: of the distance along the ray and across it, and of the orientation
_RANGE_SHARE, _ACROSS_SHARE, _TURN_RAD = 0.0008, 0.0001, math.radians(0.35)


@dataclass(frozen=True)
class PadMeasurer:
    """Measures pads in pictures (H, W, 3) BGR uint8 of the camera's size. tone: the pictures' curve."""

    camera: Camera
    pad: PadSpec
    tone: Tone

    @property
    def has_print(self) -> bool:
        """Whether the pad has what its whole print is registered by."""
        return self.pad.ring is not None and self.pad.board is not None

    def size_px(self, camera_T_pad: Pose) -> float:
        """Return about how wide a pad is seen, pixels."""
        return self.camera.fx * self.pad.diameter_m / max(float(camera_T_pad.translation[2]), 1e-6)

    def by_tags(
        self, image: Image, tags: Sequence[TagObservation], expected: Pose | None = None
    ) -> tuple[Solution, ...]:
        """Return the poses that fit the tags' corners, refined on the large edges; the better fit first.

        The edges decide where the tags leave the orientation open; without them both solutions remain. expected: where
        the pad should be, a start that spares the two of the tags.
        """
        corners = pad_corners(tags, self.camera, self.pad)
        if corners is None:
            return ()
        if expected is not None:
            start = Solution(expected, np.eye(6), 0.0, 0.0)
            refined = refine_on_edges(image, corners, start, self.pad, self.tone)
            if refined is not None and refined.reproj_px < _WELL_PX:
                return (refined,)
        solutions = pad_solutions(corners)
        # from either of the two the edges lead to the one true pose, so the second is tried only if the first fails
        for solution in solutions:
            refined = refine_on_edges(image, corners, solution, self.pad, self.tone)
            if refined is not None:
                return (refined,)
        return solutions

    def by_print(
        self,
        image: Image,
        start: Pose,
        turn_known: Array | None = None,
        *,
        is_new: bool = False,
        before: Registered | None = None,
    ) -> Registered | None:
        """Return the pose near one that explains the whole print; None where it is not seen.

        turn_known: (3, 3) inverse covariance of what is known of the start's orientation, as `register_target` has it.
        before: the same pad's in the last picture.
        """
        if not self.has_print:
            return None
        least = _LIKE_NEW if is_new else _LIKE_EXPECTED
        found = self._registered(image, start, turn_known, least, before)
        if found is None and not is_new:
            coarse = register_target(image, self.camera, start, self.pad, self.tone, most_px=_COARSE_PX)
            if coarse is not None and coarse.likeness >= _LIKE_COARSE and faces_camera(coarse.camera_T_pad):
                nearer = Pose(start.rotation, coarse.camera_T_pad.translation)
                found = self._registered(image, nearer, turn_known, least, None)
        return found

    def _registered(
        self, image: Image, start: Pose, turn_known: Array | None, least: float, before: Registered | None
    ) -> Registered | None:
        found = register_target(image, self.camera, start, self.pad, self.tone, turn_known=turn_known, before=before)
        if found is None or not found.at_rest or found.likeness < least or found.share < _LEAST_SHARE:
            return None
        return found if faces_camera(found.camera_T_pad) else None

    def starts(self, image: Image, box_px: Array) -> tuple[Pose, ...]:
        """Return poses the print behind a box (4,) of its ring may have, each as likely half a turn on."""
        return start_poses(image, self.camera, box_px, self.pad, self.tone) if self.has_print else ()

    def half_turn_odds(self, image: Image, found: Registered) -> float | None:
        """Return how much likelier a pose is than half a turn from it, as a log ratio; None if that is no fit."""
        start = found.camera_T_pad @ HALF_TURN
        other = register_target(image, self.camera, start, self.pad, self.tone, steps=_FEW_STEPS, before=found)
        return None if other is None else 0.5 * (other.chi2 - found.chi2)


def mirrored(camera_T_pad: Pose) -> Pose:
    """Return the pose whose normal is mirrored about the line of sight: what a plane from afar looks like as well."""
    ray = camera_T_pad.translation / np.linalg.norm(camera_T_pad.translation)
    normal = camera_T_pad.rotation[:, 2]
    other = 2.0 * float(normal @ ray) * ray - normal
    axis = np.cross(normal, other)
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return camera_T_pad
    turn = axis / length * math.atan2(length, float(normal @ other))
    return Pose(rotation_from_rotvec(turn) @ camera_T_pad.rotation, camera_T_pad.translation)


def with_doubt(camera_T_pad: Pose, covariance: Array) -> Array:
    """Return a pose's covariance (6, 6) with what no picture tells added."""
    place = camera_T_pad.translation
    distance = float(np.linalg.norm(place))
    along = np.outer(place, place) / distance**2
    added = np.zeros((6, 6))
    added[:3, :3] = distance**2 * (_ACROSS_SHARE**2 * np.eye(3) + (_RANGE_SHARE**2 - _ACROSS_SHARE**2) * along)
    added[3:, 3:] = _TURN_RAD**2 * np.eye(3)
    return np.asarray(covariance + added)
