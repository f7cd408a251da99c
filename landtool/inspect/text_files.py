"""Lines that tell what the files of a run hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from landtool.inspect.facts import Calibration, Ego, Mount, Pad, Settings
from landtool.inspect.words import Line, camera_lines, clock_lines, range_lines


def calibration_lines(it: Calibration) -> Iterator[Line]:
    """Tell what a calibration holds."""
    for camera in it.cameras:
        yield from camera_lines(camera)


def pad_lines(pad: Pad) -> Iterator[Line]:
    """Tell what a target is."""
    yield "name", f"{pad.name}, D = {pad.diameter_mm:.6g} mm, {pad.extent_mm:.6g} mm over all"
    if pad.board_mm is not None:
        yield "board", f"{pad.board_mm:.6g} mm square"
    if pad.ring_outer_mm is not None:
        yield "ring", f"{pad.ring_outer_mm:.6g} mm outside, {pad.ring_inner_mm:.6g} mm inside"
    if pad.letter_height_mm is not None:
        size = f"{pad.letter_height_mm:.6g} mm high, {pad.letter_width_mm:.6g} mm wide"
        yield "H", f"{size}, strokes {pad.letter_stroke_mm:.6g} mm"
    if pad.quiet_zone_mm is not None:
        yield "quiet zone", f"{pad.quiet_zone_mm:.6g} mm square"
    for number, tag in enumerate(pad.tags):
        place = f"at x {tag.x_mm:.6g}, y {tag.y_mm:.6g} mm" if tag.x_mm or tag.y_mm else "in the middle"
        turn = f", turned {tag.yaw_deg:g} degrees" if tag.yaw_deg else ""
        yield ("" if number else "tags"), f"{tag.family} id {tag.tag_id}: {tag.size_mm:.6g} mm, {place}{turn}"
    if not pad.tags:
        yield "tags", "none"
    if pad.camera:
        yield from camera_lines(pad.camera)
        yield from range_lines(pad.name, pad.ranges)
        yield "", f"the whole of it in view from {pad.whole_from_m:.3g} m"
    elif pad.tags:
        yield "range", "from how far its tags can be read: add --camera FILE, or --hfov DEG --size WxH"


def mount_lines(mount: Mount) -> Iterator[Line]:
    """Tell where a camera is on the body and where it looks."""
    x, y, z = mount.translation_m
    yield "camera", f"{x:g} m forward, {y:g} m left, {z:g} m up of the body's origin"
    tilt = "straight down" if mount.off_down_deg < 0.05 else f"{mount.off_down_deg:.1f} degrees off straight down"
    yield "looks", f"{tilt}, along {_direction(mount.axis_body)}"
    yield "image top", f"points along {_direction(mount.image_top_body)}"


def _direction(vector: Sequence[float]) -> str:
    """Name a body axis where the direction is one, else give its parts."""
    names = ("forward", "left", "up"), ("back", "right", "down")
    for axis, value in enumerate(vector):
        if abs(value) > 0.9999:
            return f"{names[value < 0][axis]} ({'-' if value < 0 else '+'}{'xyz'[axis]})"
    return " ".join(f"{value:.3f}" for value in vector) + " (forward, left, up)"


def ego_lines(ego: Ego) -> Iterator[Line]:
    """Tell where the drone was and when."""
    yield "poses", f"{ego.poses}, a way of {ego.path_m:.3g} m"
    for axis, low, high in zip("xyz", ego.low_m, ego.high_m, strict=True):
        yield axis, f"{low:.3f} to {high:.3f} m"
    if ego.clock:
        yield from clock_lines(ego.clock)
        yield "", "the recording's clock has to be the same"


def settings_lines(settings: Settings) -> Iterator[Line]:
    """Tell the settings."""
    yield from ((name, str(value)) for name, value in settings.values.items())
    if not settings.values:
        yield "settings", "none"
