"""The drone's own poses over time, and how its camera is mounted, as files."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.errors import InputError, LandtoolError, UsageError
from landtool.geometry import Array, Pose
from landtool.pad import refuse_unknown_keys

CSV_COLUMNS = ("t_ns", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
# A camera that looks straight down, the top of its image towards body x (docs/conventions.md)
STRAIGHT_DOWN = Pose(np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.zeros(3))
_HINT = f"give a CSV with the columns {', '.join(CSV_COLUMNS)}, or a TUM file"
_MOUNT_HINT = "give a TOML with [body_T_camera] translation_m = [x, y, z] and quaternion_wxyz = [w, x, y, z]"
_MAX_S = 2**63 // 10**9  # int64 nanoseconds end in the year 2262
_Row = tuple[int, int, list[float]]  # line, t_ns, x y z in m and the quaternion w x y z


@dataclass(frozen=True, eq=False)
class EgoPoses:
    """The drone's poses in time: `world_T_body` at each stamp, the world level with z up.

    t_ns: (N,) int64, strictly increasing, on the video's clock. positions_m: (N, 3). quaternions_wxyz: (N, 4), unit.

    Raises InputError for no poses, stamps that do not increase, values that are not finite, quaternions that are not
    of unit length within 1 %. The error names the pose, or its line where `lines` (N numbers) says which one that is.
    """

    t_ns: NDArray[np.int64]
    positions_m: Array
    quaternions_wxyz: Array
    lines: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        t_ns = np.array(self.t_ns, dtype=np.int64).reshape(-1)
        positions = np.array(self.positions_m, dtype=np.float64).reshape(-1, 3)
        quaternions = np.array(self.quaternions_wxyz, dtype=np.float64).reshape(-1, 4)
        if not len(t_ns) == len(positions) == len(quaternions):
            raise ValueError(f"{len(t_ns)} stamps, {len(positions)} positions, {len(quaternions)} quaternions")
        if not len(t_ns):
            raise InputError("holds no poses", hint=_HINT)
        norms = np.linalg.norm(quaternions, axis=1)
        finite = np.isfinite(positions).all(axis=1) & np.isfinite(norms)
        self._refuse(~finite, "a value is not a finite number", "remove the line or mend it")
        self._refuse(np.abs(norms - 1.0) > 0.01, "the quaternion is not of length 1", "check the order of the columns")
        steps = np.diff(t_ns, prepend=t_ns[0] - 1)
        self._refuse(steps == 0, "the time of the line before is repeated", "keep one line of them")
        self._refuse(steps < 0, "the time is before that of the line before", "sort the lines by time")
        quaternions /= norms[:, None]
        for name, value in (("t_ns", t_ns), ("positions_m", positions), ("quaternions_wxyz", quaternions)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def _refuse(self, wrong: NDArray[np.bool_], reason: str, hint: str) -> None:
        if wrong.any():
            index = int(np.argmax(wrong))
            place = f"line {self.lines[index]}" if self.lines else f"pose {index + 1}"
            raise InputError(f"{place}: {reason}", hint=hint)


def read_ego(path: Path) -> EgoPoses:
    """Read the drone's poses from a CSV (`CSV_COLUMNS`, more are ignored) or a TUM file, told apart by content.

    A TUM file holds `t tx ty tz qx qy qz qw` a line, t in seconds; `#` begins a comment.

    Raises UsageError when the file cannot be opened, InputError naming the line that is wrong.
    """
    try:
        lines = _lines(path)
        if not lines:
            raise InputError("holds no poses", hint=_HINT)
        rows = list(_csv_rows(lines) if "," in lines[0][1] else _tum_rows(lines))
        values = np.array([row for _, _, row in rows], dtype=np.float64).reshape(-1, 7)
        stamps = np.array([t_ns for _, t_ns, _ in rows], dtype=np.int64)
        return EgoPoses(stamps, values[:, :3], values[:, 3:], tuple(line for line, _, _ in rows))
    except LandtoolError as error:
        raise type(error)(error.reason, file=path, hint=error.hint) from error


def read_mount(path: Path) -> Pose:
    """Read how the camera is mounted, `body_T_camera`, from a TOML with both keys of `[body_T_camera]`.

    Raises UsageError when the file cannot be opened, InputError for other content.
    """
    try:
        with path.open("rb") as file:
            return _mount(tomllib.load(file))
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"no valid TOML: {error}", file=path, hint=_MOUNT_HINT) from error
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint) from error


def _mount(data: dict[str, Any]) -> Pose:
    refuse_unknown_keys(data, ["body_T_camera"])
    table = data.get("body_T_camera")
    if not isinstance(table, dict):
        raise InputError("holds no table [body_T_camera]", hint=_MOUNT_HINT)
    refuse_unknown_keys(table, ["translation_m", "quaternion_wxyz"], "body_T_camera.")
    translation_m = _vector(table, "translation_m", 3)
    quaternion_wxyz = _vector(table, "quaternion_wxyz", 4)
    if abs(math.hypot(*quaternion_wxyz) - 1.0) > 0.01:
        raise InputError("body_T_camera.quaternion_wxyz is not of length 1", hint="give w x y z, w first")
    return Pose.from_quaternion(translation_m, quaternion_wxyz)


def _vector(table: dict[str, Any], key: str, count: int) -> list[float]:
    value = table.get(key)
    good = isinstance(value, list) and len(value) == count and all(type(v) in (int, float) for v in value)
    if not isinstance(value, list) or not good or not all(map(math.isfinite, value)):
        raise InputError(f"body_T_camera.{key} must be {count} finite numbers", hint=_MOUNT_HINT)
    return [float(v) for v in value]


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the lines that are neither empty nor comments, with their numbers from 1."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", hint=_HINT) from error
    except UnicodeDecodeError as error:
        raise InputError("is no text", hint=_HINT) from error
    lines = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in lines if line and not line.startswith("#")]


def _csv_rows(lines: Sequence[tuple[int, str]]) -> Iterator[_Row]:
    header = _cells_of_csv(lines[0][1])
    wrong = [name for name in CSV_COLUMNS if header.count(name) != 1]
    if wrong:
        raise InputError(f"line {lines[0][0]}: needs one column '{wrong[0]}'", hint=_HINT)
    places = [header.index(name) for name in CSV_COLUMNS]
    for number, line in lines[1:]:
        cells = _counted(number, _cells_of_csv(line), len(header))
        t_ns, *values = (cells[place] for place in places)
        yield number, _whole_ns(number, t_ns), [_float(number, value) for value in values]


def _cells_of_csv(line: str) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(",")]


def _tum_rows(lines: Sequence[tuple[int, str]]) -> Iterator[_Row]:
    for number, line in lines:
        t_s, *values = _counted(number, line.split(), 8)
        x, y, z, qx, qy, qz, qw = (_float(number, value) for value in values)
        yield number, _ns_of_seconds(number, t_s), [x, y, z, qw, qx, qy, qz]


def _counted(number: int, cells: list[str], count: int) -> list[str]:
    if len(cells) != count:
        raise InputError(f"line {number}: {len(cells)} columns where {count} are needed", hint=_HINT)
    return cells


def _float(number: int, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"line {number}: '{text[:30]}' is no number", hint=_HINT) from error


def _whole_ns(number: int, text: str) -> int:
    try:
        t_ns = int(text)
    except ValueError as error:
        raise InputError(f"line {number}: t_ns '{text[:30]}' is no whole number", hint=_HINT) from error
    return _in_range(number, t_ns)


def _ns_of_seconds(number: int, text: str) -> int:
    """Turn seconds into nanoseconds exactly: a float holds seconds since 1970 to 0.2 microseconds only."""
    try:
        t_s = Decimal(text)
    except InvalidOperation as error:
        raise InputError(f"line {number}: the time '{text[:30]}' is no number", hint=_HINT) from error
    if not t_s.is_finite() or abs(t_s) > _MAX_S:
        raise InputError(f"line {number}: the time '{text[:30]}' is not finite or too large", hint=_HINT)
    return _in_range(number, round(t_s.scaleb(9)))


def _in_range(number: int, t_ns: int) -> int:
    if abs(t_ns) > _MAX_S * 10**9:
        raise InputError(f"line {number}: the time {t_ns} ns is too large", hint=_HINT)
    return t_ns
