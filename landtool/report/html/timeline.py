"""The timeline of a run: stage, method, track and picture of every frame as bars, to be clicked on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array
from landtool.report.html.flight import Flight

_BINS = 800  # more than a screen tells apart
# Rows from the top: name, and for every value its share of the row's height, which tells it from others without colour,
# and whether it is shown where several share a pixel (the later in the list the rather)
_ROWS: tuple[tuple[str, tuple[tuple[str, float], ...]], ...] = (
    ("stage", (("near", 1.0), ("far", 0.45))),
    ("measured by", (("tag", 1.0), ("target", 0.7), ("box", 0.4), ("nothing", 0.12))),
    ("track", (("confirmed", 1.0), ("coasting", 0.6), ("tentative", 0.35), ("none", 0.12))),
    ("picture", (("good", 0.3), ("dehazed", 0.65), ("damaged", 1.0), ("lost", 1.0))),
)


@dataclass(frozen=True)
class Bar:
    """A stretch of equal frames; start and width in thousandths of the timeline, height in hundredths of the row."""

    value: str
    start: float
    width: float
    height: float


@dataclass(frozen=True)
class Row:
    """One line of the timeline. shares: how much of the frames each value has, in words."""

    name: str
    bars: tuple[Bar, ...]
    shares: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Timeline:
    """rows: to be drawn. ticks: place in thousandths and text. said: for the script, by row its name and changes.

    times_s: of every frame in the page's time (`at`), end_s: when the last one ends. unit: of the ticks.
    """

    rows: tuple[Row, ...]
    ticks: tuple[tuple[float, str], ...]
    said: tuple[tuple[str, tuple[tuple[int, str], ...]], ...]
    times_s: tuple[float, ...]
    end_s: float
    unit: str
    frames: tuple[int, ...]


def timeline(flight: Flight) -> Timeline:
    """Lay a flight out along its time, or its frames' numbers where it has no clock."""
    from landtool.report.html.axis import Axis

    start, end, at = _extent(flight.at)
    values = _values(flight)
    bins = _bins(at, start, end)
    rows = tuple(Row(name, _bars(values[name], bins, looks), _shares(values[name], looks)) for name, looks in _ROWS)
    axis = Axis(start, end, 0.0, 1000.0)
    ticks = tuple((float(axis.place(np.array([tick]))[0]), f"{tick:g}") for tick in axis.ticks(8))
    return Timeline(
        rows,
        ticks,
        tuple((name, _changes(values[name])) for name, _ in _ROWS),
        tuple(round(value, 6) for value in at.tolist()),
        end,
        "s" if flight.has_clock else "frame",
        tuple(flight.index),
    )


def _extent(at: Array) -> tuple[float, float, Array]:
    """Return start, end and the times with none missing and none going back: a frame without one has that before it."""
    start = float(np.nanmin(at)) if np.isfinite(at).any() else 0.0
    filled = np.maximum.accumulate(np.where(np.isfinite(at), at, start))
    step = np.diff(filled)
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 1.0
    return start, float(filled[-1]) + usual, filled


def _values(flight: Flight) -> dict[str, list[str]]:
    pictures = zip(flight.has_picture, flight.status, flight.dehazed, strict=True)
    return {
        "stage": flight.stage,
        "measured by": [method or "nothing" for method in flight.method],
        "track": [state or "none" for state in flight.state],
        "picture": [
            "lost" if not has else "damaged" if status == "damaged" else "dehazed" if dehazed else "good"
            for has, status, dehazed in pictures
        ],
    }


def _bins(at: Array, start: float, end: float) -> Array:
    """Return the edges of every frame (N + 1,) in thousandths."""
    edges = np.append(at, end)
    placed: Array = (edges - start) / (end - start) * 1000.0
    return placed


def _bars(values: Sequence[str], edges: Array, looks: tuple[tuple[str, float], ...]) -> tuple[Bar, ...]:
    rank = {name: i for i, (name, _) in enumerate(looks)}
    heights = dict(looks)
    shown = _worst_of_bins(values, edges, rank) if len(values) > _BINS else list(zip(values, edges[:-1], strict=True))
    bars: list[Bar] = []
    for i, (value, start) in enumerate(shown):
        end = shown[i + 1][1] if i + 1 < len(shown) else 1000.0
        if bars and bars[-1].value == value:
            bars[-1] = Bar(value, bars[-1].start, end - bars[-1].start, bars[-1].height)
        else:
            bars.append(Bar(value, start, end - start, 100.0 * heights.get(value, 0.0)))
    return tuple(bar for bar in bars if bar.height > 0.0 and bar.width > 0.0)


def _worst_of_bins(values: Sequence[str], edges: Array, rank: dict[str, int]) -> list[tuple[str, float]]:
    """Return for each bin that holds a frame the value that matters most, and its start."""
    worst: dict[int, str] = {}
    for value, start in zip(values, edges[:-1], strict=True):
        place = min(_BINS - 1, int(start * _BINS / 1000.0))
        if place not in worst or rank.get(value, -1) > rank.get(worst[place], -1):
            worst[place] = value
    return [(value, place * 1000.0 / _BINS) for place, value in sorted(worst.items())]


def _shares(values: Sequence[str], looks: tuple[tuple[str, float], ...]) -> tuple[tuple[str, str], ...]:
    counted = ((name, values.count(name) if isinstance(values, list) else 0) for name, _ in looks)
    return tuple((name, f"{count / len(values):.1%}") for name, count in counted if count)


def _changes(values: Sequence[str]) -> tuple[tuple[int, str], ...]:
    return tuple((i, value) for i, value in enumerate(values) if not i or value != values[i - 1])
