"""The boards a camera is calibrated with: chessboards, ChArUco boards and Kalibr's AprilGrids.

Board frame: metres, origin at the print's top left (of the outermost square, or of the outermost tag), x to the right,
y down, z into the print, as OpenCV has it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.errors import InputError, UsageError
from landtool.families import tag_family
from landtool.geometry import Array

BoardKind = Literal["chessboard", "charuco", "aprilgrid"]
KINDS: tuple[BoardKind, ...] = get_args(BoardKind)
# Markers of n x n bits: the largest table of each holds the smaller ones
DICTIONARIES = {
    "4x4": cv2.aruco.DICT_4X4_1000,
    "5x5": cv2.aruco.DICT_5X5_1000,
    "6x6": cv2.aruco.DICT_6X6_1000,
    "7x7": cv2.aruco.DICT_7X7_1000,
}
BORDER_MODULES = 2  # of Kalibr's tags, black on each side; plain AprilTags have one
_FAMILY = "tag36h11"
_FEWEST, _MOST = 2, 100  # squares or tags, each way
_SIDE_M = 1e-4, 10.0


@dataclass(frozen=True)
class Board:
    """A board. columns, rows: its squares (chessboard, charuco) or tags (aprilgrid).

    square_m: side of a square, or of a tag, outer edge of its black border. marker_m: side of a ChArUco marker.
    dictionary: bits of a ChArUco marker, 5x5. white_first: the top left square of a ChArUco board is white and has the
    first marker, as OpenCV before 4.6 drew boards with an even number of rows. spacing: gap between an AprilGrid's
    tags over their side.

    Raises UsageError for what no board can be.
    """

    kind: BoardKind = "charuco"
    columns: int = 8
    rows: int = 11
    square_m: float = 0.02
    marker_m: float = 0.015
    dictionary: str = "5x5"
    white_first: bool = False
    spacing: float = 0.3

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(f"no board '{self.kind}'", hint=f"known: {', '.join(KINDS)}")
        least = _FEWEST if self.kind == "aprilgrid" else _FEWEST + 1
        if not (least <= self.columns <= _MOST and least <= self.rows <= _MOST):
            raise UsageError(f"a board of {self.size}", hint=f"{least} to {_MOST} each way")
        if not _SIDE_M[0] <= self.square_m <= _SIDE_M[1]:
            raise UsageError(f"squares of {self.square_m:g} m", hint=f"{_SIDE_M[0]:g} to {_SIDE_M[1]:g}, in metres")
        if self.kind == "charuco" and not 0.3 * self.square_m <= self.marker_m <= 0.95 * self.square_m:
            reason = f"markers of {self.marker_m:g} m in squares of {self.square_m:g} m"
            raise UsageError(reason, hint="a marker's side is 0.3 to 0.95 of its square's")
        if self.dictionary not in DICTIONARIES:
            raise UsageError(f"no markers '{self.dictionary}'", hint=f"known: {', '.join(DICTIONARIES)}")
        if not 0.05 <= self.spacing <= 1.0:
            raise UsageError(f"a spacing of {self.spacing:g}", hint="the gap over the tag's side, 0.05 to 1")
        if self.white_first and self.rows % 2:
            reason = f"a board of {self.size} whose first square is white"
            raise UsageError(reason, hint="older OpenCV drew it so only with an even number of rows; leave it out")
        known = {"charuco": 1000, "aprilgrid": len(tag_family(_FAMILY).codes)}.get(self.kind)
        if known is not None and self.markers > known:
            raise UsageError(f"a board of {self.size} needs {self.markers} markers", hint=f"there are {known}")

    @classmethod
    def usual(cls, kind: BoardKind) -> Board:
        """Return the board of a kind that `landtool pad --board` prints unless told otherwise; it fits A4."""
        return cls(kind, 6, 8, 0.022) if kind == "aprilgrid" else cls(kind)

    @classmethod
    def read(cls, path: Path) -> Board:
        """Read a board from a TOML file. Raises UsageError for none, InputError for its content."""
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise UsageError(error.strerror or "cannot be read", file=path, hint="give a board's TOML") from error
        except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(
                "is no TOML", file=path, hint="make one with landtool pad --board KIND -o b.toml"
            ) from error
        try:
            return cls._of(values)
        except (UsageError, InputError) as error:
            raise InputError(error.reason, file=path, hint=error.hint) from error

    @classmethod
    def _of(cls, values: Mapping[str, Any]) -> Board:
        known = {field.name: type(field.default) for field in fields(cls)} | {"kind": str}
        if "kind" not in values and "diameter_m" in values:
            raise InputError("describes a landing pad, not a board", hint="landtool pad --board KIND -o board.toml")
        for key, value in values.items():
            if key not in known:
                raise InputError(f"unknown key '{key}'", hint=f"known: {', '.join(known)}")
            fits = isinstance(value, known[key]) or (known[key] is float and isinstance(value, int))
            if not fits or (isinstance(value, bool) and known[key] is not bool):
                raise InputError(f"{key} = {value!r} is no {known[key].__name__}", hint="see docs/calibrate.md")
        if "kind" not in values:
            raise InputError("holds no board's kind", hint=f"kind is one of {', '.join(KINDS)}")
        if values["kind"] not in KINDS:
            raise InputError(f"no board '{values['kind']}'", hint=f"known: {', '.join(KINDS)}")
        return replace(cls.usual(values["kind"]), **values)

    def to_toml(self) -> str:
        """Return the board as TOML, from which `read` makes an equal board."""
        lines = [f'kind = "{self.kind}"', f"columns = {self.columns}", f"rows = {self.rows}"]
        lines.append(f"square_m = {self.square_m!r}")
        if self.kind == "charuco":
            lines += [f"marker_m = {self.marker_m!r}", f'dictionary = "{self.dictionary}"']
            lines += ["white_first = true"] * self.white_first
        if self.kind == "aprilgrid":
            lines.append(f"spacing = {self.spacing!r}")
        return "\n".join(lines) + "\n"

    @property
    def size(self) -> str:
        """Columns and rows as `8x11`."""
        return f"{self.columns}x{self.rows}"

    @property
    def article(self) -> str:
        """What stands before its kind or name in a sentence."""
        return "an" if self.kind == "aprilgrid" else "a"

    @property
    def name(self) -> str:
        """The board in words."""
        mm = f"{self.square_m * 1000:.6g} mm"
        if self.kind == "aprilgrid":
            return f"aprilgrid {self.size} tags of {mm} (tag36h11, spacing {self.spacing:g})"
        inner = f", markers {self.marker_m * 1000:.6g} mm ({self.dictionary})" if self.kind == "charuco" else ""
        return f"{self.kind} {self.size} squares of {mm}{inner}"

    @property
    def markers(self) -> int:
        """How many markers or tags it has; a chessboard none."""
        if self.kind == "aprilgrid":
            return self.columns * self.rows
        return (self.columns * self.rows + self.white_first) // 2 if self.kind == "charuco" else 0

    @property
    def pitch_m(self) -> float:
        """From one square or tag to the next, metres."""
        return self.square_m * (1.0 + self.spacing) if self.kind == "aprilgrid" else self.square_m

    @property
    def clear_m(self) -> float:
        """How far around a crossing nothing but its own two lines is seen, metres."""
        if self.kind == "chessboard":
            return 0.5 * self.square_m
        if self.kind == "charuco":
            return min(0.5 * self.square_m, (self.square_m - self.marker_m) / math.sqrt(2.0))
        border = BORDER_MODULES / (6 + 2 * BORDER_MODULES)
        return self.square_m * min(self.spacing, border * math.sqrt(2.0))

    @property
    def extent_m(self) -> tuple[float, float]:
        """Width and height of the print, metres; an AprilGrid's small corner squares included."""
        if self.kind != "aprilgrid":
            return self.columns * self.square_m, self.rows * self.square_m
        gap = self.spacing * self.square_m
        return self.columns * self.pitch_m + gap, self.rows * self.pitch_m + gap

    @cached_property
    def points_m(self) -> Array:
        """The crossings (N, 3), metres, row by row; of an AprilGrid four a tag, as `marker_corners_m` has them."""
        if self.kind == "aprilgrid":
            flat = self.marker_corners_m.reshape(-1, 2)
        else:
            y, x = np.mgrid[1 : self.rows, 1 : self.columns].reshape(2, -1)
            flat = np.column_stack([x, y]) * self.square_m
        return np.column_stack([flat, np.zeros(len(flat))])

    @cached_property
    def marker_places(self) -> NDArray[np.int64]:
        """Column and row (n, 2) of each marker's square, by its id. An AprilGrid's ids begin at the bottom left."""
        if self.kind == "aprilgrid":
            ids = np.arange(self.markers)
            return np.column_stack([ids % self.columns, self.rows - 1 - ids // self.columns])
        rows, columns = np.mgrid[0 : self.rows, 0 : self.columns].reshape(2, -1)
        white = (rows + columns) % 2 == (0 if self.white_first else 1)
        return np.column_stack([columns[white], rows[white]]) if self.kind == "charuco" else np.zeros((0, 2), np.int64)

    @cached_property
    def marker_corners_m(self) -> Array:
        """Corners (n, 4, 2) of the markers, metres: top left, top right, bottom right, bottom left of the upright."""
        side = self.square_m if self.kind == "aprilgrid" else self.marker_m
        first = self.marker_places * self.pitch_m + (0.0 if self.kind == "aprilgrid" else (self.square_m - side) / 2.0)
        unit = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        return first[:, None, :] + unit * side

    def rectangles_m(self) -> Array:
        """Return what is black, (n, 4): left, top, right, bottom in metres; side by side, none over another."""
        parts: list[Array] = []
        if self.kind != "aprilgrid":
            row, column = np.mgrid[0 : self.rows, 0 : self.columns].reshape(2, -1)
            dark = (row + column) % 2 == (1 if self.kind == "charuco" and self.white_first else 0)
            corner = np.column_stack([column, row])[dark] * self.square_m
            parts.append(np.hstack([corner, corner + self.square_m]))
        for marker, corners in enumerate(self.marker_corners_m):
            parts.append(_black_modules(marker_modules(self, marker), corners))
        if self.kind == "aprilgrid":
            # small squares in the gaps, touching four tags: each tag's corner is the crossing of two lines
            gap = self.spacing * self.square_m
            row, column = np.mgrid[0 : self.rows + 1, 0 : self.columns + 1].reshape(2, -1)
            corner = np.column_stack([column, row]) * self.pitch_m - gap
            parts.append(np.hstack([corner, corner + gap]))
        return np.concatenate(parts)


@cache
def _marker_dictionary(bits: str) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(DICTIONARIES[bits])


def marker_modules(board: Board, marker: int) -> NDArray[np.bool_]:
    """Return the picture (n, n) of a board's marker with its black border, True where it is white."""
    if board.kind == "aprilgrid":
        inner = tag_family(_FAMILY).modules(marker)[2:-2, 2:-2]
        return np.pad(inner, BORDER_MODULES)
    table = _marker_dictionary(board.dictionary)
    return np.asarray(table.generateImageMarker(marker, table.markerSize + 2, borderBits=1) > 127)


def _black_modules(white: NDArray[np.bool_], corners: Array) -> Array:
    """Return the black runs of a marker's rows as rectangles (n, 4)."""
    n = len(white)
    step = (corners[2] - corners[0]) / n
    found = []
    for y, row in enumerate(white):
        edges = np.flatnonzero(np.diff(np.concatenate([[True], row, [True]]).astype(np.int8)))
        for x0, x1 in edges.reshape(-1, 2):
            found.append([*(corners[0] + step * (x0, y)), *(corners[0] + step * (x1, y + 1))])
    return np.array(found)
