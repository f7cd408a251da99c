"""How much worse each number of an evaluation may become: patterns over their names, read from TOML."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path
from typing import Any

from landtool.errors import InputError, UsageError
from landtool.io.local import local_file
from landtool.pad import refuse_unknown_keys

_KEYS = ("absolute", "relative", "ignore")
_SHIPPED = "data/tolerance.toml"


@dataclass(frozen=True)
class Allowance:
    """By how much a number may get worse: the larger of `absolute`, in its own unit, and `relative` of its old value.

    ignore: it is not compared at all.
    """

    absolute: float = 0.0
    relative: float = 0.0
    ignore: bool = False

    def of(self, baseline: float) -> float:
        """Return how much worse than `baseline` is allowed."""
        return max(self.absolute, self.relative * abs(baseline))


@dataclass(frozen=True)
class Tolerance:
    """Allowances by pattern, in the order of their file; file: None for what landtool brings along."""

    patterns: tuple[tuple[str, Allowance], ...]
    file: Path | None = None

    def of(self, key: str) -> Allowance | None:
        """Return what holds for a number, None where it is not compared.

        The last pattern that matches wins. One with ":" is about parts of the data, one without about all of it. Of a
        number about all of the data that none matches nothing is allowed; one about a part is then not compared.
        """
        matching = [allowance for pattern, allowance in self.patterns if _matches(pattern, key)]
        if not matching:
            return None if ":" in key else Allowance()
        return None if matching[-1].ignore else matching[-1]

    def notes(self, keys: Iterable[str]) -> list[str]:
        """Return a line for each pattern of a file that matches none of the keys, with the nearest one."""
        known = sorted(set(keys))
        if self.file is None or not known:
            return []
        idle = [pattern for pattern, _ in self.patterns if not any(_matches(pattern, key) for key in known)]
        return [f"{self.file}: '{p}' matches no number; the nearest is {_nearest(p, known)}" for p in idle]


def read_tolerance(path: Path | None = None) -> Tolerance:
    """Read a tolerance file; without one return what landtool brings along.

    Raises UsageError when it cannot be opened, InputError for broken TOML, an unknown key and an impossible value.
    """
    try:
        if path is None:
            text = (resources.files("landtool") / _SHIPPED).read_text(encoding="utf-8")
        else:
            text = local_file(path).read_bytes().decode("utf-8")
        values = tomllib.loads(text)
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"no valid TOML: {error}", file=path) from error
    try:
        return Tolerance(tuple((pattern, _allowance(pattern, table)) for pattern, table in values.items()), path)
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint) from error


def _matches(pattern: str, key: str) -> bool:
    return (":" in pattern) == (":" in key) and fnmatchcase(key, pattern)


def _nearest(pattern: str, keys: list[str]) -> str:
    part = [key for key in keys if (":" in key) == (":" in pattern)] or keys
    return difflib.get_close_matches(pattern, part, n=1, cutoff=0.0)[0]


def _allowance(pattern: str, table: Any) -> Allowance:
    hint = 'a table begins with a pattern in quotes, as ["detection.*"]'
    if not isinstance(table, Mapping):
        raise InputError(f"'{pattern}' must be a table", hint=hint)
    if any(isinstance(value, Mapping) for value in table.values()):
        raise InputError(f"[{pattern}.{next(iter(table))}] is no pattern", hint=hint)
    refuse_unknown_keys(table, _KEYS, f"{pattern}: ")
    ignore = table.get("ignore", False)
    if not isinstance(ignore, bool):
        raise InputError(f"'{pattern}: ignore' must be true or false")
    if ignore and len(table) > 1:
        raise InputError(f"'{pattern}' is ignored and has a tolerance", hint="keep one of them")
    return Allowance(_number(pattern, table, "absolute"), _number(pattern, table, "relative"), ignore)


def _number(pattern: str, table: Mapping[str, Any], name: str) -> float:
    value = table.get(name, 0.0)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value) or value < 0.0:
        raise InputError(f"'{pattern}: {name}' is {value!r}", hint="give a number, 0 or more")
    return float(value)
