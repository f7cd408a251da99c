"""The overlay of the annotated video: what was measured, tracked and predicted, drawn over the picture."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.panel import BOX, MEASURED, PREDICTED, TAG, TRACKED, draw_banner, draw_panel, panel_lines, panel_size
from landtool.strokes import BLUE, GREEN, VERMILLION, Color, Pen
from landtool.types import Detection, Frame, FrameResult, Image, PadPose, Track

TRAIL_NS = 2_000_000_000
RATE_FRAMES = 30  # the processing rate is a mean over this many frames
_AXES: tuple[tuple[str, Color], ...] = (("x", VERMILLION), ("y", GREEN), ("z", BLUE))
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)


@dataclass(frozen=True)
class _View:
    """The camera at one moment: takes points (N, 3) of the reference frame to pixels (N, 2)."""

    camera: Camera
    camera_T_reference: Pose

    def pixels(self, *lines_m: Array) -> list[Array]:
        """Project some lines (N, 3) at once: most of a projection's time is the same for any number of points."""
        return _split(self.camera.project(self.camera_T_reference.apply(np.concatenate(lines_m))), lines_m)


class Overlay:
    """Draws one recording's results over its pictures, in the order of the frames.

    Without a camera or a pad only what is known in pixels is drawn: boxes, tags, the panel. It remembers the trail
    of the last two seconds, the pad's height in the reference frame and the processing rate.
    """

    def __init__(self, camera: Camera | None = None, pad: PadSpec | None = None) -> None:
        self._camera = camera
        self._outlines = [] if pad is None else _outlines(pad)
        self._diameter_m = 0.0 if pad is None else pad.diameter_m
        self._trail: deque[tuple[int, Array]] = deque()
        self._trail_of: int | None = None
        self._height_m: float | None = None
        self._seconds: deque[float] = deque(maxlen=RATE_FRAMES)
        self._pen: Pen | None = None

    def draw(self, frame: Frame, result: FrameResult, camera_T_reference: Pose | None = None) -> Image:
        """Return a copy of the frame's image (H, W, 3) BGR with the result drawn over it.

        camera_T_reference: where the tracks' reference frame is seen from now; without it no track is drawn.
        """
        image = frame.image.copy()
        pen = self._pen_for(image)
        track = main_track(result.tracks)
        view = None
        if self._camera is not None and camera_T_reference is not None:
            view = _View(self._camera, camera_T_reference)
            self._remember_height(result.pose, camera_T_reference)
        self._remember(result, track)
        for box in reversed(result.detections):  # the best last, over the others
            pen.line(image, box_corners(box, pen), BOX, closed=True)
        if self._camera is not None and result.pose is not None:
            self._draw_target(image, pen, self._camera, result.pose)
        for tag in result.tags:
            pen.line(image, tag.corners_px, TAG, closed=True)
        if view is not None:
            self._draw_tracks(image, pen, view, result.tracks)
        if self._camera is not None and result.pose is not None:
            self._draw_axes(image, pen, self._camera, result.pose)
        rate = len(self._seconds) / sum(self._seconds) if any(self._seconds) else None
        lines = panel_lines(result, track, camera_T_reference, rate, metric=self._camera is not None)
        self._draw_labels(image, pen, result, panel_size(pen, lines))
        draw_panel(image, pen, lines)
        if damage := frame.damage or (result.status == "damaged" and (result.reason or "unknown")):
            draw_banner(image, pen, f"DAMAGED FRAME: {damage}", VERMILLION)
        return image

    def _pen_for(self, image: Image) -> Pen:
        height, width = image.shape[:2]
        if self._pen is None or (self._pen.width, self._pen.height) != (width, height):
            self._pen = Pen.of_image(width, height)
        return self._pen

    def _remember_height(self, pose: PadPose | None, camera_T_reference: Pose) -> None:
        if pose is not None:
            reference_T_pad = camera_T_reference.inverse() @ pose.camera_T_pad
            self._height_m = float(reference_T_pad.translation[2])

    def _remember(self, result: FrameResult, track: Track | None) -> None:
        if result.stage_seconds:
            self._seconds.append(sum(result.stage_seconds.values()))
        if track is None or track.track_id != self._trail_of:
            self._trail.clear()
        self._trail_of = None if track is None else track.track_id
        if track is None or result.t_ns is None or self._height_m is None:
            return
        self._trail.append((result.t_ns, np.array([track.state[0], track.state[1], self._height_m])))
        while self._trail[0][0] < result.t_ns - TRAIL_NS:
            self._trail.popleft()

    def _is_distant(self, pen: Pen, camera: Camera, pose: PadPose) -> bool:
        """Whether the target is so small in the image that details drawn on it would hide it."""
        return camera.fx * self._diameter_m < 3 * pen.text_px * float(pose.camera_T_pad.translation[2])

    def _draw_target(self, image: Image, pen: Pen, camera: Camera, pose: PadPose) -> None:
        outlines = self._outlines[: 1 if self._is_distant(pen, camera, pose) else None]
        if not outlines:
            return
        for line in _View(camera, pose.camera_T_pad).pixels(*outlines):
            pen.line(image, line, MEASURED, closed=True)

    def _draw_axes(self, image: Image, pen: Pen, camera: Camera, pose: PadPose) -> None:
        if self._is_distant(pen, camera, pose):
            return
        along = np.linspace(0.0, 0.42 * self._diameter_m, 6)[:, None]
        lines = _View(camera, pose.camera_T_pad).pixels(*(along * axis for axis in np.eye(3)))
        for (name, color), line in zip(_AXES, lines, strict=True):
            pen.line(image, line, color)
            start, tip = line[0], line[-1]
            # an axis that points at the camera is a dot, and a letter would cover the others
            if pen.sees(tip) and np.hypot(*(tip - start)) > pen.text_px:
                pen.label(image, name, tip[0], tip[1] + pen.text_px / 2, color, "centre")

    def _draw_tracks(self, image: Image, pen: Pen, view: _View, tracks: tuple[Track, ...]) -> None:
        if len(self._trail) > 1:
            (trail,) = view.pixels(np.array([place for _, place in self._trail]))
            pen.line(image, trail, TRACKED)
        if self._height_m is None:
            return
        for track in tracks:
            now = np.append(track.state[:2], self._height_m)
            later = np.append(track.predicted_xy_m, self._height_m)
            way, ellipse = view.pixels(np.linspace(now, later, 8), _sigma_ellipse(track, self._height_m))
            pen.line(image, way, PREDICTED)
            pen.line(image, ellipse, TRACKED, closed=True)
            pen.disc(image, way[0], 1.5 * pen.line_px, TRACKED)
            _draw_diamond(image, pen, way[-1])

    def _draw_labels(self, image: Image, pen: Pen, result: FrameResult, panel_px: tuple[int, int]) -> None:
        """Write last, so that no line crosses a text."""
        for box in reversed(result.detections):
            text = f"{box.label} {box.score:.2f}"
            x, y = label_place(box, pen, pen.text_width(text) + 6, panel_px)
            pen.label(image, text, x, y, BOX)
        for tag in result.tags:
            right, bottom = tag.corners_px.max(axis=0)
            pen.label(image, str(tag.tag_id), right + 3, bottom + pen.text_px + 6, TAG)


def _split(points: Array, like: Sequence[Array]) -> list[Array]:
    """Cut points (N, 2) into lines as long as the given ones."""
    ends = np.cumsum([len(line) for line in like])
    return [points[end - len(line) : end] for line, end in zip(like, ends, strict=True)]


def main_track(tracks: tuple[Track, ...]) -> Track | None:
    """Return the track that matters most: confirmed before coasting before tentative, then the oldest."""
    order = {"confirmed": 0, "coasting": 1, "tentative": 2}
    return min(tracks, key=lambda track: (order[track.status], track.track_id), default=None)


def _outlines(pad: PadSpec) -> list[Array]:
    """Return closed lines (N, 3) of the target, outermost edge first, dense enough to bend with the lens."""
    lines = [pad.outline_m if pad.ring else _dense(pad.outline_m)]
    if pad.board:
        half = pad.board.side * pad.diameter_m / 2.0
        lines.append(_dense(half * np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]])))
    return lines + [_dense(pad.tag_corners_m(tag)) for tag in pad.tags]


def _dense(corners: Array) -> Array:
    """Put 8 points on every edge of a closed polygon (N, D)."""
    along = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    edges = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([start + along * (end - start) for start, end in edges])


def _sigma_ellipse(track: Track, height_m: float) -> Array:
    """Return the 1-sigma ellipse (48, 3) of a track's place, reference frame, metres."""
    # points c + V sqrt(L) u of the unit circle u, with the covariance V L V^T
    values, vectors = np.linalg.eigh(track.covariance[:2, :2])
    circle = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])
    points = track.state[:2] + circle * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    return np.column_stack([points, np.full(len(points), height_m)])


def box_corners(box: Detection, pen: Pen) -> Array:
    """Return the corners (4, 2) of a line around a box: beside its edges, so that a small target is not covered."""
    out = pen.line_px
    x0, y0, x1, y1 = box.x_min_px - out, box.y_min_px - out, box.x_max_px + out, box.y_max_px + out
    # where the box ends with the picture its line stays in the picture
    x0, x1 = (float(v) for v in np.clip([x0, x1], 0, pen.width - 1))
    y0, y1 = (float(v) for v in np.clip([y0, y1], 0, pen.height - 1))
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def label_place(box: Detection, pen: Pen, width_px: int, panel_px: tuple[int, int]) -> tuple[float, float]:
    """Return left and bottom of a box's label: where it covers neither the box nor the panel, if there is such a place.

    panel_px: width and height of the panel in the picture's top-left corner.
    """
    height, gap = pen.text_px + 3, 2 * pen.line_px
    corners = box_corners(box, pen)
    (left, top), (right, bottom) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    above, below, beside = top - gap, bottom + gap + height, min(top + height, pen.height - 1.0)
    outside = [(left, above), (left, below), (right + gap, beside), (left - gap - width_px, beside)]
    outside += [(right - width_px, above), (right - width_px, below)]
    inside = [(right - gap - width_px, top + gap + height), (left + gap, bottom - gap)]
    for x, y in outside + inside:
        in_picture = x >= 0 and x + width_px <= pen.width and y >= height and y <= pen.height
        if in_picture and (x >= panel_px[0] or y - height >= panel_px[1]):
            return x, y
    return outside[0]


def _draw_diamond(image: Image, pen: Pen, centre_px: Array) -> None:
    radius = 2.0 + 3.0 * pen.line_px
    corners = centre_px + radius * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    pen.line(image, corners, PREDICTED, closed=True)
