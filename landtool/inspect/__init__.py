"""What a recording, calibration, pad, mount, pose or settings file holds, and what a run still needs for it."""

from __future__ import annotations

from pathlib import Path

from landtool.errors import InputError
from landtool.inspect.facts import Facts, Request
from landtool.inspect.files import inspect_file, read_text, unknown_text
from landtool.inspect.recordings import inspect_recording

__all__ = ["Facts", "Request", "inspect"]


def inspect(path: Path, request: Request) -> Facts:
    """Tell what an input is and holds. The kind is told by content, never by the file's name.

    Raises UsageError for what is no plain local file or folder and for options that do not fit, InputError for content
    that cannot be read or is of no known kind.
    """
    text = _text(path)
    if text is not None and (facts := inspect_file(path, text, request)) is not None:
        return facts
    try:
        return inspect_recording(path, request)
    except InputError as error:
        if text is None:
            raise
        raise unknown_text(path, text) from error


def _text(path: Path) -> str | None:
    """Return what a file says as text; None for all else, of which opening it as a recording will tell more."""
    try:
        return read_text(path) if path.is_file() else None
    except (OSError, ValueError):
        return None
