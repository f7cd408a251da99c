"""Settings of a command: its file, and the options that win over it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from landtool.config import configured, read_config
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.pad import refuse_unknown_keys

Settings = TypeVar("Settings")


OTHER_TABLES = ("eval",)  # of one file that serves several commands, each reads its own


def from_file(defaults: Settings, file: Path | None) -> Settings:
    """Return the settings with those of a file, if there is one, put in; what is wrong with it names the file."""

    def own(data: dict[str, Any]) -> dict[str, Any]:
        known = [field.name for field in fields(defaults)]  # type: ignore[arg-type]
        refuse_unknown_keys(data, [*known, *OTHER_TABLES])
        return {name: value for name, value in data.items() if name not in OTHER_TABLES}

    return _put_in(defaults, file, own)


def table_of_file(defaults: Settings, file: Path | None, table: str) -> Settings:
    """Return the settings with those of one table of a file put in."""
    return _put_in(defaults, file, lambda data: data.get(table, {}), f"{table}.")


def _put_in(
    defaults: Settings, file: Path | None, chosen: Callable[[dict[str, Any]], Any], where: str = ""
) -> Settings:
    if file is None:
        return defaults
    try:
        values = chosen(read_config(file))
        if not isinstance(values, Mapping):
            raise InputError(f"'{where.removesuffix('.')}' must be a table")
        return configured(defaults, values, where)
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
