"""metrics.json and metrics.csv come back as they were written, and what is none is told."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from landtool.errors import InputError, UsageError
from landtool.evaluate.metric import Metric
from landtool.evaluate.record import (
    METRIC_COLUMNS,
    CurveRecord,
    EvalRecord,
    ModelRecord,
    PartRecord,
    SpeedRecord,
    metric_of,
    read_metrics,
    write_record,
)
from landtool.io.run_record import HashedFile
from tests.unit.evaluate.metrics import made

METRICS = (
    made("detection.recall", 1 / 3, "higher", 0.1, 0.9),
    made("detection.recall:size_px=14-20", None, "higher"),
    replace(made("pose.nees_place", 1e-12, "expected", expected=1.0), model='a "ü" model'),
    made("speed.track_fps", 1e9, "neither"),
)


def record(metrics: tuple[Metric, ...] = METRICS, **changes: Any) -> EvalRecord:
    return EvalRecord("data", "0" * 64, (PartRecord("a", "clip", 24),), {"eval": {}}, (), metrics, **changes)


def test_metrics_come_back(tmp_path: Path) -> None:
    write_record(tmp_path, record(notes=("one",), exit_code=3))
    values, metrics = read_metrics(tmp_path)
    assert metrics == METRICS
    assert values["notes"] == ["one"]
    assert values["exit_code"] == 3
    assert values["dataset"] == {
        "name": "data", "digest": "0" * 64, "parts": [{"name": "a", "kind": "clip", "frames": 24}],
    }  # fmt: skip


def test_all_of_the_contract_is_there(tmp_path: Path) -> None:
    model = ModelRecord("shipped", HashedFile("net.onnx", "1" * 64))
    curve, speed = CurveRecord("shipped", (0.5,), (1.0,), (0.25,)), SpeedRecord("shipped", "look", 3, 0.5)
    write_record(tmp_path, replace(record(), models=(model,), curves=(curve,), speed=(speed,)))
    values, _ = read_metrics(tmp_path)
    assert list(values) == [
        "format_version", "command", "versions", "dataset", "config", "models", "metrics", "curves", "speed", "notes",
        "gate", "exit_code",
    ]  # fmt: skip
    assert values["models"] == [{"name": "shipped", "file": "net.onnx", "sha256": "1" * 64}]
    assert values["curves"] == [{"model": "shipped", "score": [0.5], "precision": [1.0], "recall": [0.25]}]
    assert values["speed"] == [{"model": "shipped", "stage": "look", "frames": 3, "seconds": 0.5}]


def test_the_table_leaves_the_unknown_empty(tmp_path: Path) -> None:
    write_record(tmp_path, record())
    with (tmp_path / "metrics.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(METRIC_COLUMNS)
    assert [row["value"] for row in rows] == ["0.333333333", "", "1e-12", "1e+09"]
    assert rows[2]["model"] == 'a "ü" model'
    assert rows[1]["low"] == rows[1]["expected"] == ""


def test_tables_may_be_left_out(tmp_path: Path) -> None:
    write_record(tmp_path, record(), tables=False)
    assert [path.name for path in tmp_path.iterdir()] == ["metrics.json"]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_what_is_no_number_is_written_as_unknown(value: float, tmp_path: Path) -> None:
    write_record(tmp_path, record((made("detection.recall", value),)))
    (read,) = read_metrics(tmp_path)[1]
    assert read.value is None
    assert (tmp_path / "metrics.csv").read_text().splitlines()[1] == ",detection,recall,,,,,lower,,10,10"


def edited(change: Callable[[dict[str, Any]], object]) -> Callable[[str], str]:
    def edit(text: str) -> str:
        values = json.loads(text)
        change(values)
        return json.dumps(values)

    return edit


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda text: text[:100], "is no valid JSON"),
        (lambda _: "[" * 100_000, "is no valid JSON"),
        (lambda _: "[]", "is of format None, not 1"),
        (edited(lambda v: v.update(format_version=9)), "is of format 9, not 1"),
        (edited(lambda v: v.pop("metrics")), "has no metrics"),
        (edited(lambda v: v["metrics"][0].pop("of")), "a metric without 'of'"),
        (edited(lambda v: v["metrics"].append(3)), "a metric without"),
        (edited(lambda v: v["metrics"][0].update(stage="taste")), r"a metric that is none: taste\.recall"),
        (edited(lambda v: v["metrics"][0].update(value="1")), r"a metric that is none: detection\.recall"),
        (edited(lambda v: v["metrics"][0].update(value=True)), r"a metric that is none: detection\.recall"),
        (edited(lambda v: v["metrics"][0].update(count=1.5)), r"a metric that is none: detection\.recall"),
        (edited(lambda v: v["metrics"][0].update(better="worse")), r"a metric that is none: detection\.recall"),
    ],
)
def test_a_broken_one_is_told(edit: Callable[[str], str], said: str, tmp_path: Path) -> None:
    write_record(tmp_path, record())
    path = tmp_path / "metrics.json"
    path.write_text(edit(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match=rf"metrics\.json: {said}.*; evaluate again"):
        read_metrics(tmp_path)


def test_a_folder_without_one(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="give the folder that `landtool eval` wrote"):
        read_metrics(tmp_path)


def test_a_row_is_a_metric() -> None:
    row = {**dict.fromkeys(METRIC_COLUMNS), "model": "", "stage": "track", "name": "lag_s", "slice": ""}
    found = metric_of({**row, "value": 1, "better": "lower", "count": 3, "of": 4})
    assert found == Metric("track", "lag_s", 1.0, 3, 4, "lower")
    assert isinstance(found.value, float)
