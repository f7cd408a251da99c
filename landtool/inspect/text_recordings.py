"""Lines that tell what a recording holds."""

from __future__ import annotations

from collections.abc import Iterator

from landtool.inspect.clock import Clock
from landtool.inspect.facts import Fault, Log, Recording, Scan, Topic
from landtool.inspect.words import (
    SHOWN,
    Line,
    camera_lines,
    clock_lines,
    counted,
    moment,
    range_lines,
    seconds,
    since_start,
)


def recording_lines(it: Recording) -> Iterator[Line]:
    """Tell what a recording holds."""
    if it.log:
        yield from _log(it.log)
    if it.width_px is not None:
        yield "pictures", _pictures(it)
        yield "frames", _frames(it)
    if it.scan:
        yield from _scan(it.scan, it.clock)
    if it.clock:
        yield from clock_lines(it.clock)
    elif it.width_px is not None:
        yield "time", "none"
    if it.camera:
        yield from camera_lines(it.camera)
        yield from range_lines(it.pad, it.ranges)


def _pictures(it: Recording) -> str:
    codec = f"{it.encoding} ({it.profile})" if it.profile else it.encoding
    parts = [f"{it.width_px} x {it.height_px}", codec, it.pixel_format]
    if it.rotation_deg:
        parts.append(f"turned {it.rotation_deg} degrees clockwise, as the metadata says")
    return ", ".join(part for part in parts if part)


def _frames(it: Recording) -> str:
    text = f"{it.frames_found}"
    if it.frames_declared not in (None, it.frames_found):
        text += f" of {it.frames_declared} declared"
    if it.key_frames is not None:
        text += f", {counted(it.key_frames, 'key frame')}"
    if it.damaged_packets:
        text += f", {it.damaged_packets} show damage"
    return text if it.scan else f"{text} (counted; --scan decodes them)"


def _scan(scan: Scan, clock: Clock | None) -> Iterator[Line]:
    counts = [f"{scan.decoded} decoded, {scan.damaged} of them damaged", f"{scan.lost} lost"]
    counts += [f"{scan.skipped} not to be shown"] if scan.skipped else []
    yield "scan", ", ".join(counts) + (", the data ends early" if scan.truncated else "")
    if len(scan.sizes) > 1:
        sizes = (f"{count} of {width} x {height}" for width, height, count in scan.sizes)
        yield "", f"{len(scan.sizes)} sizes: {', '.join(sizes)}"
    yield from (("", _fault(fault, clock)) for fault in scan.faults[:SHOWN])
    more = scan.damaged + scan.lost - SHOWN
    if more > 0:
        yield "", f"and {more} more"


def _fault(fault: Fault, clock: Clock | None) -> str:
    at = "" if fault.t_ns is None or clock is None else f" at {since_start(fault.t_ns, clock)}"
    name = f" ({fault.file})" if fault.file else ""
    return f"frame {fault.frame}{name}{at}, {'lost' if fault.lost else 'damaged'}: {fault.reason}"


def _log(log: Log) -> Iterator[Line]:
    index = "with an index" if log.indexed else "without an index"
    state = ", cut" if log.cut else ""
    state += f", {counted(log.lost_chunks, 'chunk')} cannot be read" if log.lost_chunks else ""
    profile = f"profile {log.profile}" if log.profile else "no profile"
    yield "log", f"{profile}, written by {log.library or 'an unknown library'}, {index}{state}"
    if log.first_ns is not None and log.last_ns is not None:
        yield "logged", f"{seconds(log.last_ns - log.first_ns)} from {moment(log.first_ns)}"
    width = max((len(topic.name) for topic in log.topics), default=0)
    kinds = max((len(topic.type) for topic in log.topics), default=0)
    for number, topic in enumerate(log.topics):
        text = f"{topic.name:<{width}}  {topic.type:<{kinds}}  {topic.messages:>6}  {_role(topic, log)}"
        yield ("" if number else "topics"), text.rstrip()
    if not log.topics:
        yield "topics", "none"


def _role(topic: Topic, log: Log) -> str:
    if topic.role == "other":
        return ""
    parts = [topic.role]
    if topic.clock and topic.clock.mean_hz and not log.topic:
        parts.append(f"{topic.clock.mean_hz:.5g} frames/s")
    if topic.role == "image":
        parts.append(f"calibration {topic.calibration}" if topic.calibration else "no calibration")
    return ", ".join(parts) + (" <- read" if topic.name == log.topic else "")
