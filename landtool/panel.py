"""The panel of numbers in the corner of an annotated picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from landtool.geometry import Pose
from landtool.strokes import DARK, GREEN, GREY, ORANGE, PURPLE, SKY, WHITE, YELLOW, Color, Pen, shade
from landtool.types import FrameResult, Image, PadPose, Track

UNKNOWN = "--"
# One colour is one meaning, everywhere in the overlay
MEASURED, TAG, BOX, TRACKED, PREDICTED = GREEN, ORANGE, YELLOW, SKY, PURPLE
STATE_COLORS: dict[str, Color] = {"confirmed": WHITE, "tentative": GREY, "coasting": ORANGE}


@dataclass(frozen=True)
class Line:
    """One line of the panel: a name, a value set to the right, and an optional mark of a colour before the name."""

    name: str
    value: str = ""
    color: Color = WHITE
    mark: Color | None = None


def panel_lines(
    result: FrameResult,
    track: Track | None,
    camera_T_reference: Pose | None,
    frames_per_s: float | None,
    *,
    metric: bool,
) -> list[Line]:
    """Return what the panel says of one frame; `metric` is whether a calibrated camera gives metres."""
    time = UNKNOWN if result.t_ns is None else f"{result.t_ns / 1e9:.3f} s"
    lines = [
        Line(f"#{result.index}", time),
        Line("stage", " / ".join(v for v in (result.stage, result.search) if v) or UNKNOWN),
    ]
    if metric:
        lines += _metric_lines(result.pose, track, camera_T_reference)
    else:
        best = max((box.score for box in result.detections), default=None)
        boxes = str(len(result.detections)) if best is None else f"{len(result.detections)}, best {best:.2f}"
        lines += [Line("boxes", boxes, mark=BOX), Line("tags", str(len(result.tags)), mark=TAG)]
    if result.dehazed and result.haze is not None:
        lines.append(Line("haze", f"{result.haze:.2f}, dehazed"))
    rate = UNKNOWN if frames_per_s is None else f"{frames_per_s:.0f} fps"
    return [*lines, Line("processing", rate)]


def _metric_lines(pose: PadPose | None, track: Track | None, camera_T_reference: Pose | None) -> list[Line]:
    lines = [
        Line("measured by", UNKNOWN if pose is None else pose.method),
        Line("distance", UNKNOWN if pose is None else f"{distance_m(pose):.2f} m", mark=MEASURED),
        Line("lateral", UNKNOWN if pose is None else f"{lateral_m(pose, camera_T_reference):.2f} m"),
    ]
    if track is None:
        return [
            *lines,
            Line("speed", UNKNOWN),
            Line("track", UNKNOWN, mark=TRACKED),
            Line("prediction", UNKNOWN, mark=PREDICTED),
        ]
    # before it is proven, a track's speed is the filter's first guess of it: nothing was measured
    unproven = track.status == "tentative"
    speed = UNKNOWN if unproven else f"{math.hypot(track.state[2], track.state[3]):.2f} m/s"
    # in the body frame the drone's own motion is part of it
    name = "speed" if track.reference == "world" else "rel. speed"
    return [
        *lines,
        Line(name, speed),
        Line(f"track {track.track_id}", track.status, STATE_COLORS[track.status], TRACKED),
        Line("prediction", f"+{track.horizon_s:g} s", mark=PREDICTED),
    ]


def distance_m(pose: PadPose) -> float:
    """Distance from the camera to the pad's centre, metres."""
    return math.hypot(*pose.camera_T_pad.translation)


def lateral_m(pose: PadPose, camera_T_reference: Pose | None) -> float:
    """How far the pad is to the side of straight below the camera, metres.

    Measured across the reference frame's vertical; across the camera's own axis when there is no reference.
    """
    offset = pose.camera_T_pad.translation
    if camera_T_reference is not None:
        offset = camera_T_reference.rotation.T @ offset
    return math.hypot(offset[0], offset[1])


def panel_size(pen: Pen, lines: Sequence[Line]) -> tuple[int, int]:
    """Return width and height, in pixels, of the picture's top-left corner that the panel takes; 0, 0 for none."""
    pad = pen.text_px // 2
    width, count = _panel_width(pen, lines), _panel_rows(pen, lines)
    if width + 2 * pad > pen.width or count < 1:
        return 0, 0
    return pad + width, 2 * pad + count * _row_px(pen)


def draw_panel(image: Image, pen: Pen, lines: Sequence[Line]) -> None:
    """Draw the panel into the top-left corner, in place: as many lines as fit; nothing when it would be too wide."""
    if panel_size(pen, lines) == (0, 0):
        return
    pad, row = pen.text_px // 2, _row_px(pen)
    mark_px = round(0.7 * pen.text_px)
    width, count = _panel_width(pen, lines), _panel_rows(pen, lines)
    left = top = pad
    shade(image, left, top, width, count * row + pad)
    for i, line in enumerate(lines[:count]):
        baseline = top + pad // 2 + (i + 1) * row - (row - pen.text_px)
        if line.mark is not None:
            corner = left + pad, baseline - mark_px
            image[corner[1] : baseline, corner[0] : corner[0] + mark_px] = line.mark
        pen.text(image, line.name, left + 2 * pad + mark_px, baseline, GREY)
        pen.text(image, line.value, left + width - pad - pen.text_width(line.value), baseline, line.color)


def _panel_width(pen: Pen, lines: Sequence[Line]) -> int:
    pad = pen.text_px // 2
    names_px = max(pen.text_width(line.name) for line in lines)
    # wide enough for the usual values, so that the panel keeps its size from frame to frame
    values_px = max([pen.text_width(line.value) for line in lines] + [round(6.5 * pen.text_px)])
    return 4 * pad + round(0.7 * pen.text_px) + names_px + values_px


def _panel_rows(pen: Pen, lines: Sequence[Line]) -> int:
    return min(len(lines), (pen.height - 3 * (pen.text_px // 2)) // _row_px(pen))


def _row_px(pen: Pen) -> int:
    return round(1.35 * pen.text_px)


def draw_banner(image: Image, pen: Pen, text: str, ground: Color) -> None:
    """Draw a strip with one line of text along the bottom, in place, for what must not be overlooked."""
    pad = pen.text_px // 2
    height = pen.text_px + pad
    if height > pen.height:
        return
    image[pen.height - height :] = ground
    pen.text(image, pen.fitted(text, pen.width - 2 * pad), pad, pen.height - round(0.75 * pad), DARK)
