"""The charts of an evaluation, against truth; several models in one chart where they share it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.io.tables import ReadTable
from landtool.report.html.chart import Chart, Look, Series
from landtool.report.html.charts_run import distance_chart, horizon_chart

_LOOKS: tuple[Look, ...] = ("a", "b", "c", "d", "e", "f")
_BINS = 8
# Charts of a clip: table, title, label, and each curve's column, name and look
_OVER_TIME: tuple[tuple[str, str, str, tuple[tuple[str, str, Look], ...]], ...] = (
    ("pose_errors.csv", "Pose against truth", "place error, m", (("place_m", "place of the pad", "a"),)),
    ("track_errors.csv", "Track against truth", "track error, m", (("error_x_m", "x", "a"), ("error_y_m", "y", "b"))),
)


def evaluation_charts(record: Mapping[str, Any], tables: Mapping[str, ReadTable]) -> list[Chart]:
    """Return the charts of an evaluation's record and tables; of a table that is not there none is returned."""
    models = [str(model["name"]) for model in record["models"]]
    charts = [_precision_recall(record.get("curves") or [])]
    if boxes := tables.get("boxes.csv"):
        charts += [_recall(boxes, models, "distance_m", "distance, m"), _recall(boxes, models, "size_px", "size, px")]
    if poses := tables.get("pose_errors.csv"):
        charts += _poses(poses, models)
    if ahead := tables.get("prediction_errors.csv"):
        charts += _predictions(ahead, models)
    if dehazed := tables.get("dehaze_errors.csv"):
        charts.append(_dehaze(dehazed))
    return charts


def _precision_recall(curves: Sequence[Mapping[str, Any]]) -> Chart:
    series = tuple(
        Series(_model(curve["model"]), _numbers(curve["recall"]), _numbers(curve["precision"]), look)
        for curve, look in zip(curves, _cycle(len(curves)), strict=True)
    )
    return Chart(
        "Precision and recall of the detector",
        "recall",
        "precision",
        series,
        empty="no curve: 0 of 0 targets",
        x_range=(0.0, 1.0),
        y_range=(0.0, 1.02),
    )


def _recall(boxes: ReadTable, models: list[str], column: str, label: str) -> Chart:
    """Draw the share of targets that were found by distance or size."""
    value, found = boxes.floats(column), boxes.floats("found")
    target = np.array([kind == "target" for kind in boxes.texts("kind")], dtype=bool) & np.isfinite(value) & (value > 0)
    series = []
    ends = _ends(value[target])
    for name, of_model, look in _of_models(boxes, models):
        parts = [found[target & of_model & (value >= a) & (value < b)] for a, b in pairwise(ends)]
        share = np.array([float(part.mean()) if len(part) else np.nan for part in parts])
        series.append(Series(name, np.sqrt(ends[:-1] * ends[1:]), share, look, "marked"))
    return Chart(
        f"Targets found by {label.split(',')[0]}",
        label,
        "recall",
        tuple(series) if target.any() else (),
        empty=f"no target has a known {label.split(',')[0]}: 0 of 0",
        y_range=(0.0, 1.02),
        log_x=True,
    )


def _ends(values: Array) -> Array:
    if not len(values):
        return np.array([1.0, 2.0])
    return np.geomspace(values.min() * 0.999, values.max() * 1.001, _BINS + 1)


def _poses(poses: ReadTable, models: list[str]) -> Iterator[Chart]:
    what = (("place_m", "place error, m", "Place of the pad"), ("normal_deg", "tilt error, deg", "Tilt of the pad"))
    for name, of_model, _ in _of_models(poses, models):
        for column, label, title in what:
            yield distance_chart(
                f"{title} against truth{_of(name, models)}",
                label,
                poses.floats("distance_m")[of_model],
                poses.floats(column)[of_model],
                note="",
                empty="no pose to compare: 0 of 0",
            )


def _predictions(ahead: ReadTable, models: list[str]) -> Iterator[Chart]:
    horizon, error, held = (ahead.floats(name) for name in ("horizon_s", "error_m", "held_m"))
    for name, of_model, _ in _of_models(ahead, models):
        by_horizon = {
            float(h): (error[of_model & (horizon == h)], held[of_model & (horizon == h)])
            for h in np.unique(horizon[of_model & np.isfinite(horizon)])
        }
        yield horizon_chart(
            f"Prediction against truth{_of(name, models)}", by_horizon, note="", empty="no prediction: 0 of 0"
        )


def _dehaze(table: ReadTable) -> Chart:
    fog = table.floats("fog_per_m")
    series = (
        Series("hazy", fog, table.floats("psnr_before_db"), "b", "dots"),
        Series("dehazed", fog, table.floats("psnr_after_db"), "a", "dots"),
    )
    return Chart("Pictures against their clear twins", "fog, 1/m", "PSNR, dB", series, from_zero=False)


def clip_charts(tables: Mapping[str, ReadTable], clip: str, model: str, start_ns: int | None) -> list[Chart]:
    """Return the charts of one clip's errors over time; model "" is every model."""
    charts = []
    for file, title, label, columns in _OVER_TIME:
        table = tables.get(file)
        if table is None:
            continue
        of_clip = rows_of(table, clip, model)
        at = seconds(table, start_ns)[of_clip]
        series = tuple(Series(name, at, table.floats(column)[of_clip], look, "dots") for column, name, look in columns)
        empty = f"{file} has no row of this clip"
        shown = series if of_clip.any() else ()
        charts.append(Chart(title, "time, s", label, shown, empty=empty, timed=True, from_zero=len(columns) == 1))
    return charts


def rows_of(table: ReadTable, clip: str, model: str) -> NDArray[np.bool_]:
    """Return which rows (N,) are of a clip, and of a model where one is named."""
    return np.array(
        [
            c == clip and (not model or m == model)
            for c, m in zip(table.texts("clip"), table.texts("model"), strict=True)
        ],
        dtype=bool,
    )


def seconds(table: ReadTable, start_ns: int | None) -> Array:
    """Return the times (N,) of a table in seconds since the clip's start, NaN where unknown."""
    return np.array(
        [np.nan if t is None or start_ns is None else (t - start_ns) / 1e9 for t in table.ints("t_ns")], np.float64
    )


def _of_models(table: ReadTable, models: list[str]) -> Iterator[tuple[str, NDArray[np.bool_], Look]]:
    """Yield every model with its rows (N,) and its look."""
    names = table.texts("model")
    rows: dict[str, list[int]] = defaultdict(list)
    for i, name in enumerate(names):
        rows[name].append(i)
    order = [*(m for m in models if m in rows), *(m for m in rows if m not in models)]
    for name, look in zip(order, _cycle(len(order)), strict=True):
        chosen = np.zeros(len(names), dtype=bool)
        chosen[rows[name]] = True
        yield _model(name), chosen, look


def _cycle(count: int) -> list[Look]:
    return [_LOOKS[i % len(_LOOKS)] for i in range(count)]


def _model(name: object) -> str:
    return str(name) or "all"


def _of(name: str, models: list[str]) -> str:
    return f", {name}" if len(models) > 1 else ""


def _numbers(values: Sequence[float | None]) -> Array:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
