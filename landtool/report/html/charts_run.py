"""The charts of a run, of what the run itself measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from landtool.geometry import Array
from landtool.report.html.chart import Chart, Look, Series
from landtool.report.html.flight import Flight

_METHODS: tuple[tuple[str, Look], ...] = (("box", "c"), ("target", "b"), ("tag", "a"))
_LOG_RATIO = 4.0  # a distance that shrinks by more than this is legible on a logarithmic axis only
_LOG_BAND = 30.0  # so are errors that differ by more than this
_BINS = 10


def run_charts(flight: Flight, *, has_truth: bool) -> list[Chart]:
    """Return the charts of a flight; what cannot be drawn says why. has_truth: others compare it with truth."""
    return [
        _distance(flight),
        _lateral(flight),
        _speed(flight),
        _above(flight),
        _foresight(flight),
        _residual(flight),
        _claimed(flight, has_truth),
    ]


def _time(flight: Flight) -> str:
    return "time, s" if flight.has_clock else "frame"


def _distance(flight: Flight) -> Chart:
    known = flight.distance_m[np.isfinite(flight.distance_m) & (flight.distance_m > 0.0)]
    method = np.array(flight.method)
    series = tuple(
        Series(f"by {name}", flight.at, np.where(method == name, flight.distance_m, np.nan), look, "dots")
        for name, look in _METHODS
        if (method == name).any()
    )
    return Chart(
        "Distance of the camera from the pad",
        _time(flight),
        "distance, m",
        series,
        empty="the pad was measured in no frame",
        log_y=bool(len(known)) and known.max() > _LOG_RATIO * known.min(),
        timed=True,
        x_range=_range(flight),
    )


def _lateral(flight: Flight) -> Chart:
    plane = "in the world" if flight.reference == "world" else "in the body frame, tilt included"
    return Chart(
        "Lateral error",
        _time(flight),
        "lateral error, m",
        (Series(f"horizontal distance of the drone from the pad's centre, {plane}", flight.at, flight.lateral_m),),
        empty="no lateral error: the pad's place below the drone is known in no frame",
        timed=True,
        x_range=_range(flight),
    )


def _speed(flight: Flight) -> Chart:
    return Chart(
        "Speed of the platform, as tracked",
        _time(flight),
        "speed, m/s",
        (Series("speed over ground", flight.at, _common(flight.speed_mps, flight.state), "e"),),
        empty="no track, so no speed",
        timed=True,
        x_range=_range(flight),
    )


def _common(speed: Array, state: Sequence[str]) -> Array:
    """A track that is not proven knows nothing of its speed yet."""
    return np.where(np.array(state) == "tentative", np.nan, speed)


def _above(flight: Flight) -> Chart:
    ahead = "" if flight.horizon_s is None else f", {flight.horizon_s:g} s ahead"
    series = (
        Series(f"prediction{ahead}", flight.ahead_m[:, 0], flight.ahead_m[:, 1], "d"),
        Series("pad, measured", flight.pad_m[:, 0], flight.pad_m[:, 1], "a"),
        Series("drone", flight.drone_m[:, 0], flight.drone_m[:, 1], "b"),
    )
    return Chart(
        "From above",
        "world x, m",
        "world y, m",
        series,
        empty="the drone's own pose is not known (--ego), so there are no places in the world",
        equal=True,
        from_zero=False,
    )


def _foresight(flight: Flight) -> Chart:
    return horizon_chart(
        "Prediction against what was measured later",
        flight.foresight,
        note="Not against truth: errors of the later measurement are in it.",
        empty="no prediction was checked by a later measurement",
    )


def horizon_chart(title: str, by_horizon: dict[float, tuple[Array, Array]], *, note: str, empty: str) -> Chart:
    """Draw errors and those of holding the last place, (N,) m each, by horizon in seconds."""
    horizon = np.array(sorted(by_horizon))
    errors, held = ([by_horizon[h][k] for h in horizon] for k in (0, 1))
    series: tuple[Series, ...] = ()
    if len(horizon):
        series = (
            Series("predicted, median", horizon, _percentiles(errors, 50), "a", "marked"),
            Series("predicted, 95 %", horizon, _percentiles(errors, 95), "d", "marked"),
            Series("last place held, median", horizon, _percentiles(held, 50), "b", "marked"),
        )
    return Chart(title, "horizon, s", "error, m", series, note=note, empty=empty)


def _percentiles(parts: list[Array], percent: float) -> Array:
    return np.array([float(np.nanpercentile(part, percent)) if np.isfinite(part).any() else np.nan for part in parts])


def _residual(flight: Flight) -> Chart:
    ahead = "" if flight.horizon_s is None else f" {flight.horizon_s:g} s"
    return Chart(
        f"Prediction{ahead} ahead, checked when its time had come",
        _time(flight),
        "off what was measured, m",
        (Series("distance between predicted and measured place", flight.at, flight.residual_m, "d"),),
        empty="no prediction was checked by a later measurement",
        timed=True,
        x_range=_range(flight),
    )


def _claimed(flight: Flight, has_truth: bool) -> Chart:
    return distance_chart(
        "Uncertainty of the pose, as claimed",
        "1 sigma of the place, m",
        flight.distance_m,
        flight.sigma_m,
        note="This is what the run says of itself."
        if has_truth
        else "The run has no truth: this is what it says of itself. landtool eval compares with truth.",
        empty="the pad was measured in no frame",
    )


def distance_chart(title: str, label: str, distance_m: Array, values: Array, *, note: str, empty: str) -> Chart:
    """Draw the median and the band from the 5th to the 95th percentile of values (N,) by distance (N,)."""
    known = np.isfinite(distance_m) & np.isfinite(values) & (distance_m > 0.0)
    if not known.any():
        return Chart(title, "distance, m", label, (), note=note, empty=empty)
    distance, value = distance_m[known], values[known]
    ends = np.geomspace(distance.min() * 0.999, distance.max() * 1.001, _BINS + 1)
    middle = np.sqrt(ends[:-1] * ends[1:])
    bins = np.clip(np.searchsorted(ends, distance) - 1, 0, _BINS - 1)
    parts = [value[bins == k] for k in range(_BINS)]
    low, median, high = (_percentiles(parts, p) for p in (5, 50, 95))
    series = (
        Series("5 to 95 %", middle, low, "a", "band", high),
        Series("median", middle, median, "a", "marked"),
    )
    spread = value[value > 0.0]
    log_y = bool(len(spread)) and float(np.percentile(spread, 95)) > _LOG_BAND * float(np.percentile(spread, 5))
    return Chart(title, "distance, m", label, series, note=note, empty=empty, log_x=True, log_y=log_y)


def _range(flight: Flight) -> tuple[float, float] | None:
    """Return the ends of the time axis, the same for all charts of a flight."""
    known = flight.at[np.isfinite(flight.at)]
    if not len(known):
        return None
    low, high = float(known.min()), float(known.max())
    return low, high if high > low else low + 1.0
