"""What the names in the table of times mean."""

from __future__ import annotations

from collections.abc import Iterable

_WORDS = {
    "dehaze": "measuring haze, and dehazing",
    "detect": "the network inside `landtool track`, which need not run on every frame",
    "tags": "reading the tags",
    "target": "poses from the tags and the print",
    "track": "the filter and its predictions",
    "write": "writing tables and video",
    "whole": "all of `landtool track`, from the first frame to the last",
    "look": "one whole look of the network at a picture with its rings, as in `landtool detect`: no part of track",
}


def speed_note(stages: Iterable[str]) -> str:
    """Return what the stages that occur are, and how their times are to be read."""
    said = "; ".join(f"{name}: {_WORDS[name]}" for name in dict.fromkeys(stages) if name in _WORDS)
    return f"{said}. Stages overlap: their sum is not the time the run took." if said else ""
