"""A report as the template takes it, and its way into one HTML text."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from landtool import __version__
from landtool.report.html.chart import Drawn
from landtool.report.html.film import Film
from landtool.report.html.judgement import Judgement
from landtool.report.html.timeline import Timeline


@dataclass(frozen=True)
class Still:
    """One of the worst frames. jpeg: base64, "" without a picture. player: whose, "" for none; at: its time there."""

    title: str
    words: tuple[str, ...]
    jpeg: str = ""
    player: str = ""
    at: float = 0.0


@dataclass(frozen=True)
class Bar:
    """A row of a table with a bar. share: of the longest, percent."""

    name: str
    share: float
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Texts under a head; marks: for each row the level its last cell is coloured by, "" for none."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Gate:
    """What a gate compared. said: where nothing changed, so. changed, same: None where there is no such row."""

    said: str
    changed: Table | None
    same: Table | None


@dataclass(frozen=True)
class Section:
    """One recording. key: its anchor and its player's name. missing: what is not there, one sentence each."""

    key: str
    name: str
    film: Film | None
    timeline: Timeline | None
    charts: tuple[Drawn, ...]
    lines: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


@dataclass(frozen=True)
class Page:
    """Everything a report shows. kind: what it is of, in words. speed: the stages' times."""

    kind: str
    title: str
    judgement: Judgement
    sections: tuple[Section, ...]
    charts: tuple[Drawn, ...] = ()
    gate: Gate | None = None
    tables: tuple[Table, ...] = ()
    slices: tuple[Table, ...] = ()
    worst: tuple[Still, ...] = ()
    worst_note: str = ""
    speed: tuple[Bar, ...] = ()
    speed_head: tuple[str, ...] = ()
    speed_note: str = ""
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    facts: tuple[Table, ...] = ()


def render(page: Page) -> str:
    """Return the page as HTML that needs no other file. Every text is escaped where it is put in."""
    text: str = _template().render(
        page=page,
        style=Markup(_asset("report.css")),
        script=Markup(_asset("report.js")),
        script_data=_script_data,
        version=__version__,
    )
    return text


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield nested settings as dotted names and texts."""
    for key, value in values.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from flat(value, f"{name}.")
        else:
            yield name, text_of(value)


def text_of(value: Any) -> str:
    """Return a plain value as people read it: unknown is empty, a list its items."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(text_of(item) for item in value)
    return json.dumps(value, ensure_ascii=False) if isinstance(value, Mapping) else str(value)


def rounded(value: object) -> str:
    """Return a plain value as `text_of` does, a number with four digits."""
    return f"{value:.4g}" if isinstance(value, float) else text_of(value)


def _script_data(section: Section) -> Markup:
    """Return what the script needs to know of a section, as JSON that cannot end its element."""
    line, film = section.timeline, section.film
    if line is None:
        return Markup("null")
    shown = film.shown_s if film is not None and film.plays else None
    told = {
        "at": line.times_s,
        "end": line.end_s,
        "unit": line.unit,
        "frame": _compact(line.frames),
        "shown": None if shown is None else [round(value, 4) for value in shown],
        "rows": line.said,
    }
    text = json.dumps(told, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _compact(frames: tuple[int, ...]) -> list[int] | int:
    """Return the first of frame numbers that follow one another, else all of them."""
    return frames[0] if frames == tuple(range(frames[0], frames[0] + len(frames))) else list(frames)


@cache
def _template() -> Any:
    made = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return made.from_string(_asset("report.html.j2"))


def _asset(name: str) -> str:
    return resources.files("landtool").joinpath("data", name).read_text(encoding="utf-8")
