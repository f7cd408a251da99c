"""What a perfect observer would say about a rendered picture: corners, boxes, and how much of the target is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec, PadTag
from landtool.synth.scene import Target
from landtool.synth.view import View

_RIM_POINTS = 720


def sees_upper_side(camera_T_plane: Pose) -> bool:
    """Return whether the camera's centre is above the plane z = 0, where its z axis points."""
    return bool(camera_T_plane.rotation[:, 2] @ camera_T_plane.translation < 0.0)


def tag_corners_px(camera: Camera, camera_T_pad: Pose, pad: PadSpec, tag: PadTag) -> Array:
    """Return a tag's corners (4, 2) in pixels, in the image or not; NaN for those not in front of the camera.

    Order: the upright tag's top-left, top-right, bottom-right, bottom-left.
    """
    return camera.project(camera_T_pad.apply(pad.tag_corners_m(tag)))


def ring_box_px(camera: Camera, camera_T_pad: Pose, pad: PadSpec, *, clip: bool = True) -> Array | None:
    """Return the tight box (4,) around the outer circle of the pad's ring: x_min, y_min, x_max, y_max in pixels.

    clip: the box of the part inside the image [-0.5, W - 0.5], [-0.5, H - 0.5], else of the whole circle. None when
    the pad has no ring, is seen from behind, is not wholly in front of the camera, or nothing of it is in the image.
    """
    rim = _rim_px(camera, camera_T_pad, pad)
    return None if rim is None else box_of_rim(camera, rim, clip=clip)


def box_of_rim(camera: Camera, rim_px: Array, *, clip: bool = True) -> Array | None:
    """Return the box (4,) as above around a convex outline (N, 2) in pixels; None when the image holds none of it."""
    part = _clipped(rim_px, camera)
    if not len(part):
        return None
    if not clip:
        return np.concatenate([rim_px.min(axis=0), rim_px.max(axis=0)])
    # rounding in the clipping must not carry the box over the border
    end = np.array([camera.width, camera.height]) - 0.5
    return np.concatenate([np.maximum(part.min(axis=0), -0.5), np.minimum(part.max(axis=0), end)])


def visible_of_rim(camera: Camera, rim_px: Array) -> float:
    """Return the part of a convex outline (N, 2) in pixels that the image holds, by area, in [0, 1]."""
    return float(np.clip(_area(_clipped(rim_px, camera)) / _area(rim_px), 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class SeenTarget:
    """How a pad is seen in a picture, rolling shutter and bent sheet in it.

    visible_fraction: share of the disc inside the ring's outer circle that is in the picture and not hidden. box_px:
    (4,) as `box_of_rim`, None where the picture holds none of the ring's outer circle. tag_corners_px: (4, 2) of its
    first tag, in the picture or not, in the order of `tag_corners_px`; None for a pad without a tag.
    """

    visible_fraction: float
    box_px: Array | None
    tag_corners_px: Array | None


def seen_target(target: Target, view: View, hidden: float) -> SeenTarget:
    """Return how a view sees the pad. hidden: share of the disc, of its part in the picture, that something hides.

    Raises UsageError for a pad without a ring.
    """
    rim = view.project(target.on_sheet(rim_m(target.pad)), target.velocity_mps)
    corners = None
    if target.pad.tags:
        corners = view.project(target.on_sheet(target.pad.tag_corners_m(target.pad.tags[0])), target.velocity_mps)
    if not np.isfinite(rim).all():  # a part of it is where the lens sees nothing
        return SeenTarget(0.0, None, corners)
    share = visible_of_rim(view.camera, rim) * (1.0 - hidden)
    return SeenTarget(share, box_of_rim(view.camera, rim), corners)


def rim_m(pad: PadSpec) -> Array:
    """Return the outer circle of the pad's ring, (N, 3) in the pad frame. Raises UsageError when it has none."""
    if pad.ring is None:
        raise UsageError("the pad has no ring to draw a box around", hint="give a pad with [ring]")
    angle = np.arange(_RIM_POINTS) * (2.0 * np.pi / _RIM_POINTS)
    radius = pad.ring.outer * pad.diameter_m / 2.0
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])


def visible(camera: Camera, camera_T_pad: Pose, pad: PadSpec) -> float:
    """Return the part of the disc inside the ring's outer circle that the image holds, by area in pixels, in [0, 1].

    0 where `ring_box_px` is None.
    """
    rim = _rim_px(camera, camera_T_pad, pad)
    if rim is None:
        return 0.0
    return visible_of_rim(camera, rim)


def _rim_px(camera: Camera, camera_T_pad: Pose, pad: PadSpec) -> Array | None:
    if pad.ring is None or not sees_upper_side(camera_T_pad):
        return None
    rim = camera.project(camera_T_pad.apply(rim_m(pad)))
    return rim if np.isfinite(rim).all() else None


def _clipped(polygon: Array, camera: Camera) -> Array:
    """Return the part (M, 2) of a convex polygon (N, 2) inside the image (Sutherland and Hodgman's clipping)."""
    for axis, limit in ((0, camera.width - 0.5), (1, camera.height - 0.5)):
        for sign, bound in ((1.0, -0.5), (-1.0, -limit)):
            polygon = kept_half(polygon, sign * polygon[:, axis] - bound)
    return polygon


def kept_half(polygon: Array, inside: Array) -> Array:
    """Return the part (M, D) of a polygon (N, D) where `inside` (N,), linear along its edges, is not negative."""
    before, a = np.concatenate([polygon[-1:], polygon[:-1]]), np.concatenate([inside[-1:], inside[:-1]])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = before + (a / (a - inside))[:, None] * (polygon - before)
    # of each edge the point where it crosses, then its end: those that exist
    points = np.stack([crossing, polygon], axis=1)
    kept: Array = points[np.stack([(a < 0.0) != (inside < 0.0), inside >= 0.0], axis=1)]
    return kept


def _area(polygon: Array) -> float:
    x, y = polygon[:, 0], polygon[:, 1]
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
