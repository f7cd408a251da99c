"""metrics.json and metrics.csv: everything an evaluation found out, written and read back."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

from landtool.errors import InputError, UsageError
from landtool.evaluate.metric import STAGES, Better, Metric
from landtool.io.atomic import atomic_path
from landtool.io.run_record import HashedFile, installed_versions, plain
from landtool.io.tables import Columns, Row, write_table

FORMAT_VERSION = 1
METRICS_JSON, METRICS_CSV = "metrics.json", "metrics.csv"
METRIC_COLUMNS: Columns = {
    "model": str,
    "stage": str,
    "name": str,
    "slice": str,
    "value": float,
    "low": float,
    "high": float,
    "better": str,
    "expected": float,
    "count": int,
    "of": int,
}
_HINT = "give the folder that `landtool eval` wrote"
_AGAIN = "evaluate again"
_KEYS = ("dataset", "models", "metrics", "versions")


@dataclass(frozen=True)
class PartRecord:
    """A part of the dataset: stills, clip or pairs, and how many pictures it has."""

    name: str
    kind: str
    frames: int


@dataclass(frozen=True)
class ModelRecord:
    """A network that was judged, with its file; `HashedFile` says what was in it."""

    name: str
    file: HashedFile


@dataclass(frozen=True)
class CurveRecord:
    """Precision and recall of a network if every box of at least `score` is taken; descending scores."""

    model: str
    score: tuple[float, ...]
    precision: tuple[float, ...]
    recall: tuple[float, ...]


@dataclass(frozen=True)
class SpeedRecord:
    """What a stage took: of all its frames together, seconds."""

    model: str
    stage: str
    frames: int
    seconds: float


@dataclass(frozen=True)
class EvalRecord:
    """Everything metrics.json says. digest: of the dataset. gate: what became of the comparison, None without one."""

    dataset: str
    digest: str
    parts: tuple[PartRecord, ...]
    config: Mapping[str, Any]
    models: tuple[ModelRecord, ...]
    metrics: tuple[Metric, ...]
    curves: tuple[CurveRecord, ...] = ()
    speed: tuple[SpeedRecord, ...] = ()
    notes: tuple[str, ...] = ()
    gate: Mapping[str, Any] | None = None
    exit_code: int = 0
    versions: Mapping[str, str | None] = field(default_factory=lambda: installed_versions())


def write_record(folder: Path, record: EvalRecord, *, tables: bool = True) -> None:
    """Write metrics.json and, with `tables`, metrics.csv. Raises OutputError as `atomic_path` does."""
    values = {
        "format_version": FORMAT_VERSION,
        "command": "eval",
        "versions": record.versions,
        "dataset": {"name": record.dataset, "digest": record.digest, "parts": record.parts},
        "config": record.config,
        "models": [{"name": m.name, "file": m.file.path, "sha256": m.file.sha256} for m in record.models],
        "metrics": [dict(zip(METRIC_COLUMNS, row, strict=True)) for row in metric_rows(record.metrics)],
        "curves": record.curves,
        "speed": record.speed,
        "notes": record.notes,
        "gate": record.gate,
        "exit_code": record.exit_code,
    }
    with atomic_path(folder / METRICS_JSON) as temporary:
        temporary.write_text(json.dumps(plain(values), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if tables:
        write_table(folder / METRICS_CSV, METRIC_COLUMNS, metric_rows(record.metrics))


def metric_rows(metrics: Iterable[Metric]) -> Iterator[Row]:
    """Yield a row a metric, in the order of METRIC_COLUMNS."""
    for m in metrics:
        interval = m.value, m.low, m.high
        yield m.model, m.stage, m.name, m.slice, *interval, m.better, m.expected, m.count, m.of


def metric_of(row: Mapping[str, Any]) -> Metric:
    """Return the metric of a row of metrics.json. Raises InputError for one that is none."""
    try:
        stage, better = row["stage"], row["better"]
        numbers = [row[name] for name in ("value", "low", "high", "expected")]
        counts, texts = [row["count"], row["of"]], [row["name"], row["slice"], row["model"]]
    except (KeyError, TypeError) as error:
        raise InputError(f"a metric without {error}") from None
    known = stage in STAGES and better in get_args(Better) and all(isinstance(text, str) for text in texts)
    if not known or not all(v is None or _is_number(v) for v in numbers) or not all(type(n) is int for n in counts):
        raise InputError(f"a metric that is none: {stage}.{row['name']}")
    value, low, high, expected = (None if v is None else float(v) for v in numbers)
    name, part, model = texts
    count, of = counts
    return Metric(stage, name, value, count, of, better, low, high, expected, part, model)


def read_metrics(folder: Path) -> tuple[Mapping[str, Any], tuple[Metric, ...]]:
    """Return what an evaluation's metrics.json holds: everything as plain values, and its metrics.

    Raises UsageError when there is none, InputError for a broken one and one of another format.
    """
    path = folder / METRICS_JSON
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path, hint=_HINT) from error
    except (ValueError, RecursionError) as error:
        raise InputError("is no valid JSON", file=path, hint=_AGAIN) from error
    if not isinstance(values, dict) or values.get("format_version") != FORMAT_VERSION:
        found = values.get("format_version") if isinstance(values, dict) else None
        raise InputError(f"is of format {found}, not {FORMAT_VERSION}", file=path, hint=_AGAIN)
    missing = [key for key in _KEYS if key not in values]
    if missing or not isinstance(values["metrics"], list):
        raise InputError(f"has no {', '.join(missing) or 'list of metrics'}", file=path, hint=_AGAIN)
    try:
        return values, tuple(metric_of(row) for row in values["metrics"])
    except InputError as error:
        raise InputError(error.reason, file=path, hint=_AGAIN) from error


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
