"""Settings of a command: its file, and the options that win over it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from landtool.config import configured, read_config
from landtool.errors import InputError, LandtoolError, UsageError

Settings = TypeVar("Settings")


def from_file(defaults: Settings, file: Path | None) -> Settings:
    """Return the settings with those of a file, if there is one, put in; what is wrong with it names the file."""
    if file is None:
        return defaults
    try:
        return configured(defaults, read_config(file))
    except LandtoolError as error:
        raise type(error)(error.reason, file=error.file or file, hint=error.hint) from error


def with_options(base: Settings, flags: Mapping[str, Any]) -> Settings:
    """Return the settings with the options that were given put in: `tags__tone` is `tone` in the table `tags`."""
    values: dict[str, Any] = {}
    for name, value in flags.items():
        if value is None:
            continue
        *tables, key = name.split("__")
        place = values
        for table in tables:
            place = place.setdefault(table, {})
        place[key] = value
    try:
        return configured(base, values)
    except InputError as error:  # no file's content but what was typed
        raise UsageError(error.reason, hint=error.hint) from error
