"""What a report is made of: the folder of a run or of an evaluation, read as far as it goes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from landtool.errors import InputError, LandtoolError, UsageError
from landtool.evaluate.record import METRICS_JSON, read_metrics
from landtool.io.run_record import RUN_FILE
from landtool.io.tables import TABLES, Columns, ReadTable, read_table

VIDEO_FILE = "annotated.mp4"
Kind = Literal["run", "evaluation"]
_HINT = "give a folder that `landtool track` or `landtool eval` wrote, such as runs/track/flight"

_WHERE: Columns = {"model": str, "clip": str, "frame": int, "t_ns": int}


def _floats(names: str) -> Columns:
    return dict.fromkeys(names.split(), float)


# The tables of an evaluation that are drawn, with the columns that are read of them
EVALUATION_TABLES: dict[str, Columns] = {
    "boxes.csv": {
        **{"model": str, "part": str, "file": str, "frame": int, "kind": str, "label": str, "found": int},
        **_floats("score iou size_px distance_m fog_per_m"),
    },
    "pose_errors.csv": {
        **_WHERE,
        "method": str,
        "stage": str,
        **_floats("distance_m visible place_m normal_deg rotation_deg"),
        "flipped": int,
    },
    "track_errors.csv": {
        **_WHERE,
        "track_id": int,
        "state": str,
        **_floats("error_x_m error_y_m error_vx_mps error_vy_mps nees nis"),
    },
    "prediction_errors.csv": {**_WHERE, "track_id": int, **_floats("horizon_s error_m held_m")},
    "dehaze_errors.csv": {
        "part": str,
        "file": str,
        **_floats("fog_per_m psnr_before_db psnr_after_db ssim_before ssim_after"),
    },
}


@dataclass(frozen=True)
class Folder:
    """A folder of results. record: its run.json or metrics.json.

    tables: those that are there, by file name. missing: why each of the others is not, one sentence each.
    """

    path: Path
    kind: Kind
    record: Mapping[str, Any]
    tables: Mapping[str, ReadTable]
    missing: tuple[str, ...] = field(default=())

    @property
    def video(self) -> Path | None:
        """The annotated video, None where none was saved."""
        path = self.path / VIDEO_FILE
        return path if path.is_file() else None


def read_folder(path: Path) -> Folder:
    """Read the folder of a run of `landtool track` or of an evaluation.

    Raises UsageError when it is neither, InputError when its record is broken. A table that is broken or not there is
    named in `missing`.
    """
    if not path.is_dir():
        reason = "is no folder" if path.exists() else "does not exist"
        raise UsageError(reason, file=path, hint=_HINT)
    if (path / METRICS_JSON).is_file():
        return read_evaluation(path)
    if (path / RUN_FILE).is_file():
        return read_run(path)
    inner = sorted(child.name for child in path.iterdir() if (child / RUN_FILE).is_file())
    if inner:
        count = "a run" if len(inner) == 1 else f"{len(inner)} runs"
        raise UsageError(f"holds {count} and is none itself", file=path, hint=f"give {path / inner[0]}")
    raise UsageError("is neither a run nor an evaluation", file=path, hint=_HINT)


def read_run(path: Path) -> Folder:
    """Read a run's folder. Raises UsageError where it is none of `landtool track`, InputError for a broken record."""
    record = _read_record(path / RUN_FILE, ("command", "config", "inputs", "counts", "timings", "notes", "versions"))
    command = record["command"]
    if command != "track":
        raise UsageError(f"is a run of `landtool {command}`, which has no landing to tell of", file=path, hint=_HINT)
    if not isinstance(record.get("verdict"), Mapping):
        raise InputError("has no verdict", file=path / RUN_FILE, hint="run `landtool track` again")
    return Folder(path, "run", record, *_read_tables(path, {name: table.columns for name, table in TABLES.items()}))


def read_evaluation(path: Path) -> Folder:
    """Read an evaluation's folder. Raises InputError as `read_metrics` does."""
    record, _ = read_metrics(path)
    return Folder(path, "evaluation", record, *_read_tables(path, EVALUATION_TABLES))


def clip_folders(evaluation: Path) -> list[tuple[str, Path]]:
    """Return the runs below an evaluation, by name: of a clip, or of a model and a clip."""
    paths = sorted(file.parent for file in (evaluation / "runs").rglob(RUN_FILE))
    return [(path.relative_to(evaluation / "runs").as_posix(), path) for path in paths]


def _read_record(path: Path, keys: tuple[str, ...]) -> dict[str, Any]:
    """Read a JSON object. Raises InputError when it is none, or lacks a key that every such file has."""
    hint = "the file may be cut; make the folder again"
    try:
        record = json.loads(path.read_text(encoding="utf-8-sig"), parse_constant=_no_number)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path, hint="check its permissions") from error
    except (ValueError, RecursionError) as error:
        raise InputError("is no JSON", file=path, hint=hint) from error
    if not isinstance(record, dict):
        raise InputError("is no JSON object", file=path, hint=hint)
    missing = [key for key in keys if key not in record]
    if missing:
        raise InputError(f"has no key {', '.join(missing)}", file=path, hint=hint)
    return record


def _no_number(text: str) -> None:
    raise ValueError(text)


def _read_tables(path: Path, wanted: Mapping[str, Columns]) -> tuple[dict[str, ReadTable], tuple[str, ...]]:
    tables, missing = {}, []
    for name, columns in wanted.items():
        if not (path / name).is_file():
            missing.append(f"{name} was not saved")
            continue
        try:
            tables[name] = read_table(path / name, columns)
        except LandtoolError as error:
            missing.append(f"{name} cannot be used: {error.reason}")
    return tables, tuple(missing)
