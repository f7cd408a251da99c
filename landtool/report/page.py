"""The page of plots: one landing over time, on one sheet."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from landtool.geometry import Array
from landtool.report.page_data import METHODS, STAGES, PageData
from landtool.report.page_strip import draw_strip
from landtool.tracking.kalman import chi2_quantile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_PX, _HEIGHT_PX, _DPI = 1600, 1500, 100
# After Okabe and Ito; markers and lightness tell them apart in grey, too
COLORS = {"tag": "#0072b2", "target": "#e69f00", "box": "#cc79a7"}
_MARKERS = {"tag": "o", "target": "s", "box": "^"}
_X, _Y, _DARK, _BAND = "#0072b2", "#d55e00", "#222222", "#bbbbbb"
_WIDE = 1.959964  # sigmas that 95 % of a normal variable lie within
_LOG_RATIO = 4.0  # a distance that shrinks by more than this is legible on a logarithmic axis only


def draw_page(data: PageData, *, title: str, nis_dof: int = 2) -> bytes:
    """Return the page as a PNG, 1600 px wide.

    title: the recording's name. nis_dof: numbers a measurement of the filter has, 2 or 4.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_PX / _DPI, _HEIGHT_PX / _DPI))
    FigureCanvasAgg(figure)  # or saving would ask for the window system
    figure.suptitle(_legible(_heading(data, title)), fontsize=14, x=0.07, ha="left", y=0.985, parse_math=False)
    if said := _nothing(data):
        figure.text(0.5, 0.5, said, ha="center", fontsize=24, color=_DARK)
    else:
        _draw_panels(figure, data, nis_dof)
    png = BytesIO()
    # no name of the software, whose version would change the bytes
    figure.savefig(png, format="png", dpi=_DPI, metadata={"Software": None})
    return png.getvalue()


def _nothing(data: PageData) -> str:
    """Return why there is nothing to draw, empty where there is."""
    if not np.isfinite(data.frames.column("distance_m")).any():
        return "the pad was measured in no frame"
    return "" if np.isfinite(data.frames.column("at")).any() else "no frame has a time"


def _heading(data: PageData, title: str) -> str:
    plural = "" if data.count == 1 else "s"
    thinned = f", one of {data.frames.every} drawn" if data.frames.every > 1 else ""
    return f"{title}: {data.count} frame{plural}{thinned}" + ("" if data.has_clock else ", no clock")


def _legible(text: str) -> str:
    """Return a text without letters that the typeface lacks: the plotting library warns of each one on stderr."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    known = get_font(findfont(FontProperties())).get_charmap()
    return "".join(letter if ord(letter) in known else "?" for letter in text)


def _draw_panels(figure: Figure, data: PageData, nis_dof: int) -> None:
    places = {"left": 0.07, "right": 0.985, "top": 0.955, "bottom": 0.04, "hspace": 0.2}
    panels = figure.subplots(6, 1, sharex=True, gridspec_kw={**places, "height_ratios": [1.15, 2, 1.5, 1.5, 1.2, 1.6]})
    strip, distance, lateral, speed, nis, residual = panels
    draw_strip(strip, data)
    _draw_distance(distance, data)
    _draw_lateral(lateral, data)
    _draw_speeds(speed, data)
    _draw_nis(nis, data, nis_dof)
    _draw_residuals(residual, data)
    for axes in (distance, lateral, speed, nis, residual):
        axes.grid(alpha=0.35)
        axes.tick_params(labelsize=10)
        for when, _ in _handovers(data):
            axes.axvline(when, color=_DARK, linestyle=":", linewidth=1.2)
    residual.set_xlabel("seconds since the first frame" if data.has_clock else "frame", fontsize=11)
    at = data.frames.column("at")
    low, high = float(np.nanmin(at)), float(np.nanmax(at))
    margin = 0.01 * (high - low) or 0.5
    residual.set_xlim(low - margin, high + margin)


def _draw_distance(axes: Axes, data: PageData) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    at, distance, method = (data.frames.column(name) for name in ("at", "distance_m", "method"))
    for name in ("box", "target", "tag"):  # the best on top
        chosen = method == METHODS[name]
        if chosen.any():
            label = f"by {name}"
            axes.plot(at[chosen], distance[chosen], _MARKERS[name], color=COLORS[name], markersize=4, label=label)
    known = distance[np.isfinite(distance) & (distance > 0.0)]
    if len(known) and known.max() > _LOG_RATIO * known.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(bottom=0.0)
    _finish(axes, "distance, m")


def _draw_lateral(axes: Axes, data: PageData) -> None:
    at, lateral = data.frames.column("at"), data.frames.column("lateral_m")
    known = np.isfinite(lateral)
    if not known.any():
        _say(axes, "lateral error unknown", "lateral error, m")
        return
    plane = "world" if data.reference == "world" else "body frame, tilt included"
    label = f"horizontal distance from the pad's centre ({plane}), last {lateral[known][-1]:.2f} m"
    axes.plot(at, lateral, color=_DARK, marker=".", markersize=3, linewidth=1.2, label=label)
    axes.set_ylim(0.0, 1.1 * max(0.01, float(lateral[known].max())))
    for place, (when, altitude_m) in enumerate(_handovers(data)[:6]):  # more would cover one another
        height = "" if altitude_m is None else f" at {altitude_m:.1f} m"
        text = f" switch{height}"
        axes.annotate(
            text,
            (when, 0.88 - 0.13 * (place % 3)),
            xycoords=("data", "axes fraction"),
            fontsize=9,
            annotation_clip=True,
        )
    _finish(axes, "lateral error, m")


def _draw_speeds(axes: Axes, data: PageData) -> None:
    at = data.frames.column("at")
    ends = []
    for axis, color, style in (("x", _X, "-"), ("y", _Y, "--")):
        speed, sigma = data.frames.column(f"v{axis}_mps"), data.frames.column(f"v{axis}_sigma_mps")
        known = np.isfinite(speed)
        if not known.any():
            _say(axes, "no track, so no speed", "speed, m/s")
            return
        low, high = speed - _WIDE * sigma, speed + _WIDE * sigma
        axes.plot(at, speed, style, color=color, linewidth=1.4, marker=".", markersize=2, label=f"v{axis}")
        axes.fill_between(at, low, high, color=color, alpha=0.18, linewidth=0)
        # a track begins knowing nothing of its speed: such bands would flatten all the rest
        ends += [float(np.percentile(low[known], 10)), float(np.percentile(high[known], 90))]
    margin = 0.25 * (max(ends) - min(ends)) or 1.0
    axes.set_ylim(min(ends) - margin, max(ends) + margin)
    axes.plot([], [], color=_BAND, linewidth=8, alpha=0.6, label="95 % bands")
    _finish(axes, "speed, m/s")


def _draw_nis(axes: Axes, data: PageData, dof: int) -> None:
    at, nis = data.frames.column("at"), data.frames.column("nis")
    known = np.isfinite(nis)
    if not known.any():
        _say(axes, "no measurement against a track", "NIS")
        return
    limit = chi2_quantile(0.95, dof)
    top = 2.5 * limit
    inside, above = known & (nis <= top), known & (nis > top)
    axes.plot(at[inside], nis[inside], ".", color=_DARK, markersize=3)
    axes.plot(at[above], np.full(above.sum(), 0.96 * top), "^", color=_Y, markersize=5)
    share = f"{np.mean(nis[known] > limit):.1%} of {known.sum()} lie above, 5 % should"
    axes.axhline(limit, color=_Y, linestyle="--", linewidth=1.4, label=f"95 % limit {limit:.2f}: {share}")
    axes.set_ylim(-0.03 * top, top)
    _finish(axes, "NIS")


def _draw_residuals(axes: Axes, data: PageData) -> None:
    at, sigma = data.residuals.column("at"), data.residuals.column("sigma_m")
    name = "prediction error, m"
    if not len(at):
        _say(axes, "no prediction was checked by a later measurement", name)
        return
    where = _split(at)
    errors = [data.residuals.column(f"{axis}_m") for axis in "xy"]
    for axis, error, color, style in zip("xy", errors, (_X, _Y), ("-", "--"), strict=True):
        label = f"{axis}, {data.horizon_s:g} s ahead minus measured then"
        axes.plot(
            np.insert(at, where, np.nan), np.insert(error, where, np.nan), style, color=color, lw=1.4, label=label
        )
    if np.isfinite(sigma).any():
        half = _WIDE * np.insert(sigma, where, np.nan)
        label = "95 % by the filter"
        axes.fill_between(np.insert(at, where, np.nan), -half, half, color=_BAND, alpha=0.45, lw=0, label=label)
    lengths = np.hypot(*errors)
    wide = _WIDE * sigma[np.isfinite(sigma)]
    top = 1.2 * max(0.01, float(np.percentile(lengths, 98)), float(np.median(wide)) if len(wide) else 0.0)
    axes.set_ylim(-top, top)
    axes.plot([], [], " ", label=f"RMS {np.sqrt(np.mean(lengths**2)):.3f} m")
    _finish(axes, name)


def _split(at: Array) -> list[int]:
    """Return where a line over `at` (N,) is to be cut: at gaps of many steps, and where time goes back."""
    step = np.diff(at)
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0
    return [int(i) + 1 for i in np.flatnonzero((step > 8.0 * usual) | (step < 0.0))]


def _handovers(data: PageData) -> list[tuple[float, float | None]]:
    """Return when the stage changed, and at which altitude."""
    at, stage, altitude = (data.frames.column(name) for name in ("at", "stage", "altitude_m"))
    known = np.flatnonzero(np.isin(stage, list(STAGES.values())) & np.isfinite(at))
    changes = known[1:][np.diff(stage[known]) != 0.0]
    return [(float(at[i]), float(altitude[i]) if np.isfinite(altitude[i]) else None) for i in changes]


def _finish(axes: Axes, name: str) -> None:
    axes.set_ylabel(name, fontsize=11)
    # above the panel, where it covers nothing
    axes.legend(fontsize=10, loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=4, frameon=False, borderpad=0.2)


def _say(axes: Axes, text: str, name: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=12, color=_DARK)
    axes.set_yticks([])
    axes.set_ylabel(name, fontsize=11)
