"""How a training went: one row a validation, as results.csv has it."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path

from landtool.errors import InputError
from landtool.io.tables import format_cell


@dataclass(frozen=True)
class ResultRow:
    """What a training had reached after so many iterations.

    seconds: it had taken so far, earlier runs of it included. loss_*: means over the iterations since the last row.
    precision ... map50_95: on the validation pictures, None where there is no such number.
    """

    iteration: int
    seconds: float
    loss_box: float
    loss_objectness: float
    loss_classes: float
    learning_rate: float
    precision: float | None
    recall: float | None
    map50: float | None
    map50_95: float | None


# by the names of the fields; the others are called in the table what they are called here
_NAMES = {"map50": "mAP50", "map50_95": "mAP50-95"}
_FIELDS = tuple(field.name for field in fields(ResultRow))
COLUMNS = tuple(_NAMES.get(name, name) for name in _FIELDS)


def results_csv(rows: Iterable[ResultRow]) -> str:
    """Return results.csv: a header, a row each, floats with nine digits, empty for what is unknown."""
    lines = (",".join(format_cell(getattr(row, name)) for name in _FIELDS) for row in rows)
    return "".join(f"{line}\n" for line in (",".join(COLUMNS), *lines))


def parse_results(text: str, file: Path | None = None) -> list[ResultRow]:
    """Read what `results_csv` wrote. Raises InputError naming the line that is no such row; file: where it stood."""
    lines = list(csv.reader(text.splitlines()))
    if not lines or tuple(lines[0]) != COLUMNS:
        raise InputError("line 1: these are no results of a training", file=file, hint=f"wanted: {','.join(COLUMNS)}")
    return [_row(cells, number, file) for number, cells in enumerate(lines[1:], start=2)]


def _row(cells: list[str], line: int, file: Path | None) -> ResultRow:
    if len(cells) != len(COLUMNS):
        reason = f"line {line}: {len(cells)} fields where the header has {len(COLUMNS)}"
        raise InputError(reason, file=file, hint="the file may be cut")
    try:
        iteration = int(cells[0])
        seconds, box, objectness, classes, rate = (_number(cell) for cell in cells[1:6])
        precision, recall, map50, map50_95 = (None if cell == "" else _number(cell) for cell in cells[6:])
    except ValueError as error:
        raise InputError(f"line {line}: {error}", file=file, hint="the file may be cut") from error
    return ResultRow(iteration, seconds, box, objectness, classes, rate, precision, recall, map50, map50_95)


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"'{text}' is not a finite number")
    return value
