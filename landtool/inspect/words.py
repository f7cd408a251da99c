"""Words and lines that the blocks of several kinds share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

from landtool.inspect.advice import READABLE_PX, TagRange
from landtool.inspect.clock import Clock, Gap
from landtool.inspect.facts import CameraFacts

Line = tuple[str, str]  # a label, and what there is to say; further lines of one label have an empty one
SHOWN = 5  # gaps and faults told one by one; JSON has them all
_EPOCH_NS = 10**9 * 10**9  # larger times are taken for a date (this one is in 2001)


def clock_lines(clock: Clock) -> Iterator[Line]:
    """Tell how a recording's times follow each other."""
    yield "time", f"{seconds(clock.span_ns)} from {moment(clock.first_ns)}, by {clock.source}"
    if clock.mean_hz is None or clock.median_interval_ns is None:
        return
    if clock.rate_is_variable:
        low, high = _ms(clock.shortest_interval_ns), _ms(clock.longest_interval_ns)
        kind = f"variable: intervals of {low} to {high}, median {_ms(clock.median_interval_ns)}"
    else:
        kind = f"steady, {_ms(clock.median_interval_ns)} apart"
    yield "rate", f"{clock.mean_hz:.5g} a second on average, {kind}"
    if clock.gaps:
        yield "gaps", f"{counted(len(clock.gaps), 'interval')} of twice the median or more, by the time since the start"
        yield from (("", _gap(gap, clock)) for gap in clock.gaps[:SHOWN])
    if len(clock.gaps) > SHOWN:
        yield "", f"and {len(clock.gaps) - SHOWN} more"
    if clock.repeated or clock.backward:
        back = "" if clock.backward is None else f", {counted(clock.backward, 'step')} back"
        yield "order", f"{counted(clock.repeated, 'time')} equal to the one before{back}"


def _gap(gap: Gap, clock: Clock) -> str:
    return f"{since_start(gap.t_ns, clock)}: {seconds(gap.length_ns)} after frame {gap.after_frame}"


def camera_lines(camera: CameraFacts) -> Iterator[Line]:
    """Tell what a camera is."""
    yield camera.name or "camera", f"{camera.width_px} x {camera.height_px}, {_view(camera)}"
    yield "", f"f {camera.fx_px:.6g} {camera.fy_px:.6g} px, centre {camera.cx_px:.6g} {camera.cy_px:.6g} px"
    zero = camera.model != "equidistant" and not any(camera.distortion)
    coefficients = "all zero" if zero else " ".join(f"{value:.6g}" for value in camera.distortion)
    yield "", f"{camera.model}: {coefficients}"
    if camera.assumed:
        yield "", f"assumed, nobody measured it: {camera.assumed}"


def _view(camera: CameraFacts) -> str:
    if camera.hfov_deg is None or camera.vfov_deg is None:
        return "a field of view beyond what the lens model can invert"
    return f"field of view {camera.hfov_deg:.1f} x {camera.vfov_deg:.1f} degrees"


def range_lines(pad: str, ranges: Sequence[TagRange]) -> Iterator[Line]:
    """Tell from how far a pad's tags can be read."""
    for number, it in enumerate(ranges):
        seen = f"{it.family} id {it.tag_id} readable from {it.nearest_m:.3g} to {it.farthest_m:.3g} m"
        yield ("" if number else "range"), f"{pad}: {seen} ({READABLE_PX:g} px a side)"


def file_size(count: int) -> str:
    """Write a number of bytes."""
    size, unit = float(count), "bytes"
    for larger in ("kB", "MB", "GB"):
        if size >= 1000.0:
            size, unit = size / 1000.0, larger
    return f"{count} bytes" if unit == "bytes" else f"{size:.3g} {unit}"


def counted(count: int, what: str) -> str:
    """Write a number of things."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def seconds(ns: int) -> str:
    """Write nanoseconds as seconds."""
    return f"{ns / 1e9:.3f} s"


def _ms(ns: int | None) -> str:
    return "" if ns is None else f"{ns / 1e6:.4g} ms"


def since_start(t_ns: int, clock: Clock) -> str:
    """Write a time as the seconds since the first."""
    return seconds(t_ns - clock.first_ns)


def moment(t_ns: int) -> str:
    """Write a time as a date where it can be one, else in seconds."""
    if t_ns < _EPOCH_NS:
        return seconds(t_ns)
    whole, rest = divmod(t_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(whole, UTC):%Y-%m-%d %H:%M:%S}.{rest // 1_000_000:03} UTC"
