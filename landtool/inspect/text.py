"""Facts as aligned lines for people to read, and as plain values for JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from landtool.inspect.advice import TrackAdvice
from landtool.inspect.facts import Calibration, Ego, Facts, Mount, Pad, Recording, Settings
from landtool.inspect.text_files import calibration_lines, ego_lines, mount_lines, pad_lines, settings_lines
from landtool.inspect.text_recordings import recording_lines
from landtool.inspect.words import Line, file_size

LINES: dict[type, Callable[[Any], Iterator[Line]]] = {
    Recording: recording_lines,
    Calibration: calibration_lines,
    Pad: pad_lines,
    Mount: mount_lines,
    Ego: ego_lines,
    Settings: settings_lines,
}
_MARGIN = "  "


def as_text(facts: Facts) -> str:
    """Return a block of lines that tells everything worth reading."""
    lines = [*LINES[type(facts.facts)](facts.facts), *(("note", note) for note in facts.notes)]
    lines += _track(facts.track)
    width = max((len(label) for label, _ in lines), default=0)
    title = f"{facts.path}: {_title(facts)}, {file_size(facts.bytes)}"
    return "\n".join([title, *(f"{_MARGIN}{label:<{width}}  {text}".rstrip() for label, text in lines)])


def as_values(value: Any) -> Any:
    """Return facts as the dictionaries, lists and plain values JSON knows; keys are the fields' names."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: as_values(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): as_values(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [as_values(item) for item in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.12g}")  # without the noise of the last bits
    return str(value) if isinstance(value, float | Path) else value  # JSON has no NaN


def _title(facts: Facts) -> str:
    names = {"video": "video", "calibration": "calibration", "ego": "the drone's poses"}
    title = f"{names[facts.kind]} ({facts.format})" if facts.kind in names else facts.format
    return f"{title}, DAMAGED" if facts.damaged else title


def _track(track: TrackAdvice) -> Iterator[Line]:
    if track.obstacle:
        yield "to track", f"not possible: {track.obstacle}"
        return
    yield "to track", track.command
    width = max((len(need.option) for need in (*track.needs, *track.choices)), default=0)
    for need in track.needs:
        yield "", f"  {need.option:<{width}}  needed: {need.why}"
    for need in track.choices:
        yield "", f"  {need.option:<{width}}  possible: {need.why}"
