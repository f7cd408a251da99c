"""The lines of a darknet .cfg: sections of `key=value`, each value read with its bounds and its line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from landtool.errors import InputError

HINT = "give a darknet .cfg of a Tiny-YOLOv3 kind"


@dataclass
class Section:
    """One `[name]` with its keys; `taken` are those that were read."""

    name: str
    line: int
    values: dict[str, tuple[str, int]] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)

    def text(self, key: str, default: str | None = None) -> str:
        """Return a value. Raises InputError when it is not there and has no default."""
        self.taken.add(key)
        if key in self.values:
            return self.values[key][0]
        if default is None:
            raise line_error(self.line, f"[{self.name}] has no '{key}'")
        return default

    def line_of(self, key: str) -> int:
        """Return the line of a key, or of the section."""
        return self.values.get(key, ("", self.line))[1]

    def number(self, key: str, default: float | None, low: float, high: float) -> float:
        """Return a number within its bounds."""
        text = self.text(key, None if default is None else repr(default))
        value = _float(text, self.line_of(key), key)
        if not low <= value <= high:
            raise line_error(self.line_of(key), f"{key} = {text} is impossible", f"it must be {low:g} to {high:g}")
        return value

    def whole(self, key: str, default: int | None, low: int, high: int) -> int:
        """Return a whole number within its bounds."""
        value = self.number(key, default, low, high)
        if not value.is_integer():
            raise line_error(self.line_of(key), f"{key} = {value:g} is no whole number")
        return int(value)

    def flag(self, key: str, default: int = 0) -> bool:
        """Return a 0 or 1."""
        return self.whole(key, default, 0, 1) == 1

    def numbers(self, key: str, default: str | None = None) -> tuple[float, ...]:
        """Return a list of numbers separated by commas."""
        parts = [part.strip() for part in self.text(key, default).split(",")]
        return tuple(_float(part, self.line_of(key), key) for part in parts if part)

    def whole_numbers(self, key: str, default: str | None = None) -> tuple[int, ...]:
        """Return a list of whole numbers separated by commas."""
        values = self.numbers(key, default)
        if not all(value.is_integer() for value in values):
            raise line_error(self.line_of(key), f"{key} must be whole numbers")
        return tuple(int(value) for value in values)

    def only(self, key: str, allowed: str, default: str) -> None:
        """Refuse every value of a key but one."""
        if self.text(key, default) != allowed:
            raise line_error(self.line_of(key), f"{key} = {self.text(key)} is not supported", f"only {allowed} is")

    def refuse_rest(self, harmless: frozenset[str]) -> None:
        """Refuse keys that were not read and change what the network gives out."""
        for key, (_, line) in self.values.items():
            if key not in self.taken and key not in harmless:
                raise line_error(line, f"[{self.name}] key '{key}' is not supported", "remove it if it changes nothing")


def sections(text: str) -> Iterator[Section]:
    """Yield the sections of a cfg. Raises InputError for a line that is none of one."""
    section: Section | None = None
    for number, commented in _lines(text):
        line = re.split("[#;]", commented, maxsplit=1)[0].rstrip()
        match = re.fullmatch(r"\[(\w+)\]", line)
        if match:
            if section is not None:
                yield section
            section = Section(match[1], number)
            continue
        if section is None or "=" not in line:
            raise line_error(number, "is neither a [section] nor key=value", HINT)
        _add(section, line, number)
    if section is not None:
        yield section


def only_section(text: str, name: str) -> Section:
    """Return the keys of a file that has no [section]. Raises InputError for a line that is no key=value."""
    section = Section(name, 1)
    for number, line in _lines(text):  # a path may hold a #, so comments have lines of their own here
        if "=" not in line:
            raise line_error(number, "is no key=value")
        _add(section, line, number)
    return section


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the lines that say something, counted from 1; a line that begins with # or ; says nothing."""
    for number, raw in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
        line = raw.strip()
        if line and line[0] not in "#;":
            yield number, line


def _add(section: Section, line: str, number: int) -> None:
    key, _, value = (part.strip() for part in line.partition("="))
    if key in section.values:
        raise line_error(number, f"'{key}' stands twice in [{section.name}]")
    section.values[key] = (value, number)


def _float(text: str, line: int, key: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise line_error(line, f"{key} = {text} is no number") from None
    if not math.isfinite(value):
        raise line_error(line, f"{key} = {text} is not finite")
    return value


def line_error(line: int, reason: str, hint: str = "") -> InputError:
    """Return the error of a line, counted from 1."""
    return InputError(f"line {line}: {reason}", hint=hint)
