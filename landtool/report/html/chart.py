"""Charts as inline SVG: colours come from the page's style sheet, so they follow light, dark and print."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.report.html.axis import Axis, span, tick_text
from landtool.report.html.thin import MOST_POINTS, thinned

WIDTH, _HEIGHT, _SQUARE = 380, 226, 310
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 10, 24, 36
_GAP, _LETTER = 6, 8.0  # between the numbers of an axis and the axis; what a digit of them takes in any font
_TABLE_ROWS = 24  # a table behind a chart is to be read; the whole is in the CSV files
Look = Literal["a", "b", "c", "d", "e", "f"]
Kind = Literal["line", "dots", "marked", "band"]


@dataclass(frozen=True, eq=False)
class Series:
    """One curve. x, y: (N,), NaN unknown. kind: marked is a line with its points; a band reaches from y to `high`.

    look: its colour and dashes in the style sheet.
    """

    name: str
    x: Array
    y: Array
    look: Look = "a"
    kind: Kind = "line"
    high: Array | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """What is to be drawn. The units are at the ends of the labels.

    empty: what is said where there is nothing to draw. rule: a dashed line across at a value, and its name. timed: x is
    seconds of the flight, to be clicked on. equal: both axes in the same scale.
    """

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    note: str = ""
    empty: str = "nothing to draw: 0 of 0"
    rule: tuple[float, str] | None = None
    y_range: tuple[float, float] | None = None
    x_range: tuple[float, float] | None = None
    from_zero: bool = True
    log_x: bool = False
    log_y: bool = False
    timed: bool = False
    equal: bool = False


@dataclass(frozen=True)
class Drawn:
    """A chart for the template. svg: None where there was nothing to draw. head, rows: the numbers behind it, as texts.

    start, end: what its x axis begins and ends with, at left and right in the picture.
    """

    title: str
    note: str
    empty: str
    svg: Markup | None
    legend: tuple[tuple[str, str, str], ...]
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    thinned: str
    start: float = 0.0
    end: float = 0.0
    timed: bool = False
    left: int = _LEFT
    right: int = WIDTH - _RIGHT


def draw(chart: Chart) -> Drawn:
    """Draw a chart."""
    shown = [s for s in chart.series if np.isfinite(s.y).any() and np.isfinite(s.x).any()]
    if not shown:
        return Drawn(chart.title, chart.note, chart.empty, None, (), (), (), "")
    x, y = _axes(chart, shown, _LEFT)
    left = _room(y)
    if left > _LEFT:
        x, y = _axes(chart, shown, left)
    height = _SQUARE if chart.equal else _HEIGHT
    title = f"{chart.title}: {chart.y_label} over {chart.x_label}"
    body = [*_grid(chart, x, y, height), *(part for s in shown for part in _series(s, x, y))]
    if chart.rule is not None:
        place = float(y.place(np.array([chart.rule[0]]))[0])
        body.append(f'<path class="rule" d="M{left} {place:.1f}H{WIDTH - _RIGHT}"/>')
    if chart.timed:
        body.append(f'<path class="cursor" d="M{left} {_TOP}V{height - _BOTTOM}" visibility="hidden"/>')
    svg = (
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title)}">'
        f"<title>{escape(title)}</title>{''.join(body)}</svg>"
    )
    head, rows, note = _table(chart, shown)
    legend: list[tuple[str, str, str]] = [(s.look, s.kind, s.name) for s in shown]
    if chart.rule is not None:
        legend.append(("rule", "line", chart.rule[1]))
    return Drawn(
        chart.title,
        chart.note,
        chart.empty,
        Markup(svg),
        tuple(legend),
        head,
        rows,
        note,
        start=x.low,
        end=x.high,
        timed=chart.timed,
        left=left,
    )


def _room(y: Axis) -> int:
    """Return where a chart begins: its y axis' numbers have to fit before it."""
    return max(_LEFT, math.ceil(_GAP + _LETTER * max((len(tick_text(value)) for value in y.ticks()), default=0)))


def _axes(chart: Chart, shown: list[Series], left: int) -> tuple[Axis, Axis]:
    height = _SQUARE if chart.equal else _HEIGHT
    xs = np.concatenate([s.x for s in shown])
    ys = np.concatenate([part for s in shown for part in (s.y, s.high) if part is not None])
    x_low, x_high = chart.x_range or (_exact(xs) if chart.timed else span(xs, log=chart.log_x))
    y_low, y_high = chart.y_range or span(ys, from_zero=chart.from_zero and not chart.log_y, log=chart.log_y)
    if chart.equal:
        x_low, x_high, y_low, y_high = _same_scale(x_low, x_high, y_low, y_high, height, left)
    x = Axis(x_low, x_high, left, WIDTH - _RIGHT, chart.log_x)
    return x, Axis(y_low, y_high, height - _BOTTOM, _TOP, chart.log_y)


def _exact(values: Array) -> tuple[float, float]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return low, high if high > low else low + 1.0


def _same_scale(x_low: float, x_high: float, y_low: float, y_high: float, height: int, left: int) -> tuple[float, ...]:
    """Widen one of the axes, so that a metre is as long along both."""
    wide, high = WIDTH - left - _RIGHT, height - _TOP - _BOTTOM
    scale = max((x_high - x_low) / wide, (y_high - y_low) / high)
    x_middle, y_middle = 0.5 * (x_low + x_high), 0.5 * (y_low + y_high)
    half_x, half_y = 0.5 * scale * wide, 0.5 * scale * high
    return x_middle - half_x, x_middle + half_x, y_middle - half_y, y_middle + half_y


def _grid(chart: Chart, x: Axis, y: Axis, height: int) -> Iterator[str]:
    bottom, left, right = height - _BOTTOM, round(x.start), WIDTH - _RIGHT
    for value in y.ticks():
        place = float(y.place(np.array([value]))[0])
        yield f'<path class="grid" d="M{left} {place:.1f}H{right}"/>'
        yield f'<text x="{left - _GAP}" y="{place + 4:.1f}" text-anchor="end">{tick_text(value)}</text>'
    for value in x.ticks():
        place = float(x.place(np.array([value]))[0])
        yield f'<path class="grid" d="M{place:.1f} {_TOP}V{bottom}"/>'
        yield f'<text x="{place:.1f}" y="{bottom + 15}" text-anchor="middle">{tick_text(value)}</text>'
    yield f'<path class="axis" d="M{left} {bottom}H{right}"/>'
    yield f'<text class="label" x="0" y="13">{escape(chart.y_label)}</text>'
    yield f'<text class="label" x="{right}" y="{height - 5}" text-anchor="end">{escape(chart.x_label)}</text>'


def _series(series: Series, x: Axis, y: Axis) -> Iterator[str]:
    if series.kind == "band" and series.high is not None:
        yield from _band(series, series.high, x, y)
        return
    kept = thinned(series.y)
    px, py = x.place(series.x[kept]), y.place(series.y[kept])
    known = np.isfinite(px) & np.isfinite(py)
    if series.kind in ("line", "marked"):
        yield f'<path class="line s-{series.look}" d="{_path(px, py, known)}"/>'
    if series.kind in ("dots", "marked"):
        marks = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(px[known], py[known], strict=True))
        yield f'<path class="dots s-{series.look}" d="{marks}"/>'


def _path(px: Array, py: Array, known: NDArray[np.bool_]) -> str:
    """Return the line through the known points, broken where one is unknown; a lone one becomes a short dash."""
    parts, pen = [], "M"
    for i, (a, b) in enumerate(zip(px.tolist(), py.tolist(), strict=True)):
        if not known[i]:
            pen = "M"
            continue
        alone = pen == "M" and (i + 1 == len(known) or not known[i + 1])
        parts.append(f"{pen}{a:.1f} {b:.1f}" + ("h.1" if alone else ""))
        pen = "L"
    return "".join(parts)


def _band(series: Series, high: Array, x: Axis, y: Axis) -> Iterator[str]:
    """Fill between two curves, in pieces where one of them is unknown."""
    kept = np.unique(np.concatenate([thinned(series.y, MOST_POINTS // 2), thinned(high, MOST_POINTS // 2)]))
    px, low, top = x.place(series.x[kept]), y.place(series.y[kept]), y.place(high[kept])
    known = np.flatnonzero(np.isfinite(px) & np.isfinite(low) & np.isfinite(top))
    for piece in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        if len(piece) > 1:
            way = [*zip(px[piece], top[piece], strict=True), *zip(px[piece][::-1], low[piece][::-1], strict=True)]
            points = "L".join(f"{a:.1f} {b:.1f}" for a, b in way)
            yield f'<path class="band s-{series.look}" d="M{points}Z"/>'


def _table(chart: Chart, shown: list[Series]) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...], str]:
    """Return the numbers behind a chart: a column a curve where all share their x, else a row a point."""
    first = shown[0].x
    shared = all(len(s.x) == len(first) and np.array_equal(s.x, first, equal_nan=True) for s in shown)
    if shared:
        columns = [(chart.x_label, first)]
        for s in shown:
            columns += [(f"{s.name}{', from' if s.high is not None else ''}", s.y)]
            columns += [] if s.high is None else [(f"{s.name}, to", s.high)]
        kept = _few(len(first), _TABLE_ROWS)
        rows = [tuple(_cell(values[i]) for _, values in columns) for i in kept]
        return tuple(name for name, _ in columns), tuple(rows), _share(len(kept), len(first))
    rows, total = [], 0
    for s in shown:
        kept = _few(len(s.x), max(4, _TABLE_ROWS // len(shown)))
        total += len(s.x)
        rows += [(s.name, _cell(s.x[i]), _cell(s.y[i])) for i in kept]
    return ("curve", chart.x_label, chart.y_label), tuple(rows), _share(len(rows), total)


def _few(count: int, most: int) -> list[int]:
    if count <= most:
        return list(range(count))
    return sorted({round(i * (count - 1) / (most - 1)) for i in range(most)})


def _share(kept: int, total: int) -> str:
    return "" if kept == total else f"{kept} of {total} points; all of them are in the CSV files"


def _cell(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else ""
