r"""The tables landtool writes: their columns, how a result becomes rows, and reading them back.

A table is UTF-8 text: one header row, `,` between fields, `\n` after every row, quotes as in RFC 4180. An empty field
is an unknown value; there is no NaN and no infinity. Floats have nine significant digits.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from landtool.errors import InputError, UsageError
from landtool.geometry import Array
from landtool.io.atomic import atomic_path
from landtool.types import FrameResult

Cell = int | float | str | None
Row = tuple[Cell, ...]
Columns = Mapping[str, type[int] | type[float] | type[str]]


@dataclass(frozen=True)
class Table:
    """One kind of table: its columns in order with their types, and the rows one frame adds."""

    columns: Columns
    rows: Callable[[FrameResult], Iterable[Row]]


def _detections(result: FrameResult) -> Iterator[Row]:
    for d in result.detections:
        box = d.x_min_px, d.y_min_px, d.x_max_px, d.y_max_px
        yield result.index, result.t_ns, d.label, d.score, *box


def _tags(result: FrameResult) -> Iterator[Row]:
    for tag in result.tags:
        corners = (float(v) for v in tag.corners_px.reshape(8))
        yield result.index, result.t_ns, tag.family, tag.tag_id, tag.hamming, tag.margin, *corners


def _poses(result: FrameResult) -> Iterator[Row]:
    if (pose := result.pose) is None:
        return
    place = (float(v) for v in (*pose.camera_T_pad.translation, *pose.camera_T_pad.quaternion_wxyz))
    variances = np.diag(pose.covariance)
    # one number for the rotation: the mean of the variances about the camera's three axes, trace / 3
    spread = *(float(v) for v in variances[:3]), float(variances[3:].mean())
    yield result.index, result.t_ns, pose.method, *place, *spread, pose.ambiguity, pose.reproj_px


def _platform(result: FrameResult) -> Iterator[Row]:
    for reference, reference_T_pad in (("body", result.body_T_pad), ("world", result.world_T_pad)):
        if reference_T_pad is not None:
            place = (float(v) for v in (*reference_T_pad.translation, *reference_T_pad.quaternion_wxyz))
            yield result.index, result.t_ns, reference, *place


def _tracks(result: FrameResult) -> Iterator[Row]:
    for t in result.tracks:
        values = [float(v) for v in (*t.state, *np.diag(t.covariance))]
        predicted = (float(v) for v in t.predicted_xy_m)
        yield result.index, result.t_ns, t.track_id, t.status, t.reference, *values, t.nis, t.horizon_s, *predicted


def _predictions(result: FrameResult) -> Iterator[Row]:
    for t in result.tracks:
        for ahead in t.predictions:
            values = (float(v) for v in (*ahead.xy_m, *np.diag(ahead.covariance)))
            yield result.index, result.t_ns, t.track_id, t.reference, ahead.horizon_s, *values


def _frames(result: FrameResult) -> Iterator[Row]:
    r = result
    yield r.index, r.t_ns, r.file, r.status, r.haze, int(r.dehazed), r.stage, r.search, r.reason


_WHEN: Columns = {"frame": int, "t_ns": int}


def _floats(names: str) -> Columns:
    return dict.fromkeys(names.split(), float)


_CORNERS = "x0_px y0_px x1_px y1_px x2_px y2_px x3_px y3_px"
_PLACE = "x_m y_m z_m qw qx qy qz"
_POSE = f"{_PLACE} var_x_m2 var_y_m2 var_z_m2 var_rot_rad2 ambiguity reproj_px"
_TRACK = "x_m y_m vx_mps vy_mps var_x_m2 var_y_m2 var_vx var_vy nis horizon_s x_pred_m y_pred_m"

SMOOTHED: Columns = _floats(
    "smooth_x_m smooth_y_m smooth_vx_mps smooth_vy_mps smooth_var_x_m2 smooth_var_y_m2 smooth_var_vx smooth_var_vy"
)
"""The columns that smoothing adds to tracks.csv: the track as the whole run says, in the same units."""

TABLES: dict[str, Table] = {
    "detections.csv": Table(
        {**_WHEN, "label": str, **_floats("score x_min_px y_min_px x_max_px y_max_px")},
        _detections,
    ),
    "tags.csv": Table(
        {**_WHEN, "family": str, "tag_id": int, "hamming": int, **_floats(f"margin {_CORNERS}")},
        _tags,
    ),
    "poses.csv": Table({**_WHEN, "method": str, **_floats(_POSE)}, _poses),
    "platform.csv": Table({**_WHEN, "reference": str, **_floats(_PLACE)}, _platform),
    "tracks.csv": Table(
        {**_WHEN, "track_id": int, "state": str, "reference": str, **_floats(_TRACK)},
        _tracks,
    ),
    "predictions.csv": Table(
        {**_WHEN, "track_id": int, "reference": str, **_floats("horizon_s x_pred_m y_pred_m var_x_m2 var_y_m2")},
        _predictions,
    ),
    "frames.csv": Table(
        {
            **_WHEN,
            "file": str,
            "status": str,
            "haze": float,
            "dehazed": int,
            "stage": str,
            "search": str,
            "reason": str,
        },
        _frames,
    ),
}


def format_cell(value: Cell) -> str:
    """Return the text of one field, quoted where RFC 4180 asks for it; a float that is not finite becomes empty."""
    if value is None:
        return ""
    if isinstance(value, str):
        return '"' + value.replace('"', '""') + '"' if any(c in value for c in ',"\r\n') else value
    if isinstance(value, int | np.integer):
        return str(int(value))
    if not math.isfinite(value):
        return ""
    return f"{value + 0.0:.9g}"  # -0.0 + 0.0 is 0.0


class TableWriter:
    """Writes one table, row by row; use as a context manager. The file appears when the block ends well.

    Raises OutputExistsError and OutputError as `atomic_path` does.
    """

    def __init__(self, path: Path, table: Table, *, overwrite: bool = False) -> None:
        self._path, self._table, self._overwrite = path, table, overwrite
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            temporary = stack.enter_context(atomic_path(self._path, overwrite=self._overwrite))
            # a file name that is no UTF-8 is still written, readably
            opened = temporary.open("w", encoding="utf-8", errors="backslashreplace", newline="")
            self._file = stack.enter_context(opened)
            self._file.write(",".join(self._table.columns) + "\n")
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._stack.__exit__(kind, error, tb)

    def write(self, result: FrameResult) -> None:
        """Add the rows of one frame."""
        self._file.writelines(",".join(map(format_cell, row)) + "\n" for row in self._table.rows(result))


def write_table(path: Path, columns: Columns, rows: Iterable[Row], *, overwrite: bool = False) -> None:
    """Write a whole table. Raises OutputExistsError and OutputError as `atomic_path` does."""
    with (
        atomic_path(path, overwrite=overwrite) as temporary,
        temporary.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file,
    ):
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(map(format_cell, row)) + "\n" for row in rows)


@dataclass(frozen=True)
class ReadTable:
    """A table as read: every column's cells, in the file's order; None is an empty field."""

    columns: dict[str, list[Cell]]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), []))

    def floats(self, name: str) -> Array:
        """Return a column of numbers as (N,) float64, NaN where it is empty."""
        return np.array([np.nan if v is None else v for v in self.columns[name]], dtype=np.float64)

    def ints(self, name: str) -> list[int | None]:
        """Return a column of whole numbers, exact at any size."""
        return [None if v is None else int(v) for v in self.columns[name]]

    def texts(self, name: str) -> list[str]:
        """Return a column of text, empty where it is unknown."""
        return ["" if v is None else str(v) for v in self.columns[name]]


def read_table(path: Path, columns: Columns | None = None) -> ReadTable:
    """Read a whole table; `columns` defaults to those of the table of this file's name in `TABLES`.

    Raises as `read_rows` does.
    """
    wanted = _columns_of(path) if columns is None else columns
    rows = list(read_rows(path, wanted))
    return ReadTable({name: [row[name] for row in rows] for name in wanted})


def read_rows(path: Path, columns: Columns | None = None) -> Iterator[dict[str, Cell]]:
    """Yield the rows of a table as typed values; columns that are not asked for are left out.

    Raises UsageError when the file cannot be opened, InputError naming file and line when it is no such table.
    """
    wanted = _columns_of(path) if columns is None else columns
    return (row for _, row in numbered_rows(path, wanted))


def numbered_rows(path: Path, wanted: Columns) -> Iterator[tuple[int, dict[str, Cell]]]:
    """Yield the rows as `read_rows` does, each with the number of its last line in the file."""
    records = _records(path)
    header = _header(path, next(records, (0, []))[1], wanted)
    for line, fields in records:
        if len(fields) != len(header):
            reason = f"line {line}: {len(fields)} fields where the header has {len(header)}"
            raise InputError(reason, file=path, hint="the file may be cut; write it again")
        row = dict(zip(header, fields, strict=True))
        yield line, {name: _cell(path, line, name, row[name], kind) for name, kind in wanted.items()}


def column_names(path: Path) -> list[str]:
    """Return the names in a table's header. Raises UsageError and InputError as `read_rows` does."""
    return _header(path, next(_records(path), (0, []))[1], {})


def _header(path: Path, header: list[str], wanted: Columns) -> list[str]:
    hint = f"its first line must name the columns {', '.join(wanted)}" if wanted else "its first line names columns"
    if not header:
        raise InputError("is empty", file=path, hint=hint)
    missing = [name for name in wanted if header.count(name) != 1]
    if missing:
        raise InputError(f"line 1: not exactly one column {', '.join(missing)}", file=path, hint=hint)
    return header


def _columns_of(path: Path) -> Columns:
    if path.name not in TABLES:
        raise UsageError("is no table landtool knows by its name", file=path, hint=f"known: {', '.join(TABLES)}")
    return TABLES[path.name].columns


def _records(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield every record that is not a blank line, with the number of its last line."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            try:
                yield from ((reader.line_num, fields) for fields in reader if fields)
            except csv.Error as error:
                reason = f"line {reader.line_num}: {error}"
                raise InputError(reason, file=path, hint="write the file again") from error
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path) from error
    except UnicodeDecodeError as error:
        raise InputError("is no UTF-8 text", file=path, hint="give a CSV file as landtool writes it") from error


def _cell(path: Path, line: int, name: str, text: str, kind: type[int] | type[float] | type[str]) -> Cell:
    if kind is str:
        return text or None
    if not text:
        return None
    try:
        value = kind(text)
    except ValueError:
        value = None
    # Python also reads 1_000, which no other program does
    if value is None or "_" in text or (isinstance(value, float) and not math.isfinite(value)):
        sort = "a whole number" if kind is int else "a finite number"
        raise InputError(
            f"line {line}: {name} '{text}' is not {sort}", file=path, hint="an unknown value is left empty"
        )
    return value
