"""One pad measured in one picture: by its tags and large edges, by its whole print, or by the box around it.

What no picture tells is added to every covariance: paper is not flat and no lens exactly as calibrated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.pad import PadSpec
from landtool.tags.pose import Solution, pad_corners, pad_solutions
from landtool.target.refine import refine_on_edges
from landtool.target.register import Registered, half_turn_odds, register_target
from landtool.target.start import faces_camera, start_poses
from landtool.tone import Tone
from landtool.types import Image, TagObservation

HALF_TURN = Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))

# What a print must look like: where it is expected, and where it is seen for the first time
_LIKE_EXPECTED, _LIKE_NEW = 0.6, 0.78  # another letter in a ring like ours comes to 0.73
_LEAST_SHARE = 0.35
_COARSE_PX, _LIKE_COARSE = 26.0, 0.5
# Of pads so narrow every pixel of the print counts more than the tag's corners and the few edges that are long enough
PRINT_PX = 90.0
_PROVEN_FOCAL_PX = 554.0  # of the clips these widths were found on
_FAR_OFF_PX, _MOST_AGAIN = 2.0, 3
_MOST_RESIDUAL = 0.45  # of the contrast: what explains the pixels no better is no print
_WELL_PX = 0.7  # corners nearer to their places, RMS: the start was no worse than another
# What is not known of any pad and lens: of the distance along the ray and across it, of the tilt and the heading
_RANGE_SHARE, _ACROSS_SHARE = 0.0008, 0.00011
_TILT_RAD, _HEADING_RAD = math.radians(0.14), math.radians(0.035)
# How long a rolling shutter takes for rows that are one focal length apart, and how a landing drone moves meanwhile
_READOUT_S, _CLOSING_PER_S, _RATE_RADPS = 0.012, 0.33, 0.06
_CORNER_SHARE = 0.001  # of a tag's side


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

    def is_flat(self, camera_T_pad: Pose, most_px: float) -> bool:
        """Return whether a pad is seen with no more perspective than one of `most_px` by a camera of f = 554 px.

        Tilted by a, its near half is wider than its far one by about s^2 / f sin a pixels: that alone tells a tilt from
        its mirror image, so that a longer lens needs more pixels. Fewer than `most_px` are never enough.
        """
        size_px = self.size_px(camera_T_pad)
        return size_px < most_px or size_px**2 / self.camera.fx < most_px**2 / _PROVEN_FOCAL_PX

    def by_tags(
        self, image: Image, tags: Sequence[TagObservation], expected: Pose | None = None
    ) -> tuple[Solution, ...]:
        """Return the poses that fit the tags' corners, refined on the large edges; the better fit first.

        The edges decide where the tags leave the orientation open; without them both solutions remain. expected: where
        the pad should be, a start that spares the two of the tags.
        """
        corners = pad_corners([_with_own_doubt(tag) for tag in tags], self.camera, self.pad)
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
        # so near that few large edges are left in the picture
        whole = self.by_print(image, solutions[0].camera_T_pad) if solutions else None
        if whole is not None:
            pose = whole.camera_T_pad
            return (Solution(pose, whole.covariance, corners.terms(pose)[2], corners.reproj_px(pose)),)
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
        # most pixels lie off the print's edges and agree anyhow: from a start far off it comes to rest too early
        for _ in range(_MOST_AGAIN):
            if found is None or not self._is_far_off(start, found.camera_T_pad):
                break
            start = Pose(start.rotation, found.camera_T_pad.translation)
            found = register_target(image, self.camera, start, self.pad, self.tone, turn_known=turn_known)
        if found is None or not found.at_rest or found.likeness < least or found.share < _LEAST_SHARE:
            return None
        return found if found.residual < _MOST_RESIDUAL and faces_camera(found.camera_T_pad) else None

    def _is_far_off(self, start: Pose, found: Pose) -> bool:
        moved_m = float(np.linalg.norm(found.translation[:2] - start.translation[:2]))
        return self.camera.fx * moved_m / float(found.translation[2]) > _FAR_OFF_PX

    def starts(self, image: Image, box_px: Array) -> tuple[Pose, ...]:
        """Return poses the print behind a box (4,) of its ring may have, each as likely half a turn on."""
        return start_poses(image, self.camera, box_px, self.pad, self.tone) if self.has_print else ()

    def half_turn_odds(self, image: Image, found: Registered) -> float | None:
        """Return how much likelier a pose is than half a turn from it, as a log ratio."""
        return half_turn_odds(image, self.camera, found, self.pad, self.tone)


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


def _with_own_doubt(tag: TagObservation) -> TagObservation:
    """Return a tag whose corners are no better known than blur and tone leave the edges of its size."""
    sigma_px = _CORNER_SHARE * float(np.ptp(tag.corners_px, axis=0).max())
    return replace(tag, covariance_px2=tag.covariance_px2 + sigma_px**2 * np.eye(8))


def with_doubt(camera_T_pad: Pose, covariance: Array) -> Array:
    """Return a pose's covariance (6, 6) with what no picture tells added.

    Rows are read one after the other while the drone comes down and turns. A row y / z away from the middle one is
    late by t = T y / z, so that with a closing speed a z and a rate w of the drone

        dz / z = a t,  dx / z = w t,  and the pad seems tilted by a T about the camera's x.
    """
    x, y, z = (float(v) for v in camera_T_pad.translation)
    distance = math.sqrt(x * x + y * y + z * z)
    ray = camera_T_pad.translation / distance
    late_s = _READOUT_S * y / max(z, 1e-6)
    ranging = _RANGE_SHARE**2 + (_CLOSING_PER_S * late_s) ** 2
    across = _ACROSS_SHARE**2 + (_RATE_RADPS * late_s) ** 2
    normal = camera_T_pad.rotation[:, 2]
    heading = np.outer(normal, normal)
    added = np.zeros((6, 6))
    added[:3, :3] = distance**2 * (across * np.eye(3) + (ranging - across) * np.outer(ray, ray))
    added[3:, 3:] = _TILT_RAD**2 * (np.eye(3) - heading) + _HEADING_RAD**2 * heading
    added[3, 3] += (_CLOSING_PER_S * _READOUT_S) ** 2
    return np.asarray(covariance + added)
