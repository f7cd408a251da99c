"""The landing target as a value: the single source for printing, rendering, labels, detection and pose.

The default is pad v1 of docs/conventions.md. Lengths inside a `PadSpec` are fractions of its diameter D, as on the
drawing; properties ending in `_m` are metres in the pad frame (x to the top of the print, y to its left, z out of it).
"""

from __future__ import annotations

import difflib
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from landtool.errors import InputError, UsageError
from landtool.families import canonical_name, tag_family
from landtool.geometry import Array, Pose, rotation_from_rotvec

Color = tuple[int, int, int]  # sRGB, red first
WHITE: Color = (255, 255, 255)
BLACK: Color = (0, 0, 0)


@dataclass(frozen=True)
class Board:
    """The square the target is printed on, centred."""

    side: float = 1.10
    color: Color = WHITE


@dataclass(frozen=True)
class Ring:
    """The ring around the H, centred."""

    outer: float = 1.00
    inner: float = 0.84
    color: Color = (215, 25, 28)


@dataclass(frozen=True)
class Letter:
    """The H: two vertical stems and a crossbar, centred."""

    height: float = 0.60
    width: float = 0.52
    stroke: float = 0.10
    color: Color = (20, 20, 20)


@dataclass(frozen=True)
class QuietZone:
    """The white square over the H on which the tag stands, centred."""

    side: float = 0.20
    color: Color = WHITE


@dataclass(frozen=True)
class PadTag:
    """One tag: `size` is its measured edge as a fraction of D, (x, y) its centre, yaw its turn on the print.

    yaw_deg = 0 is the upright tag of pad v1, its top towards the top of the print; positive turns it to the left.
    """

    family: str = "tag36h11"
    id: int = 5
    size: float = 0.16
    x: float = 0.0
    y: float = 0.0
    yaw_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class Shape:
    """One painted area, to be drawn in order: a polygon of points (N, 2) or, with a radius, a disc about points[0].

    points_m: pad frame, metres.
    """

    points_m: Array
    color: Color
    radius_m: float = 0.0


@dataclass(frozen=True)
class PadSpec:
    """A landing target of outer ring diameter `diameter_m`; a part that is None is not on it.

    Raises InputError for sizes that cannot be printed.
    """

    name: str = "pad v1"
    diameter_m: float = 1.0
    board: Board | None = Board()
    ring: Ring | None = Ring()
    letter: Letter | None = Letter()
    quiet_zone: QuietZone | None = QuietZone()
    tags: tuple[PadTag, ...] = (PadTag(),)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.diameter_m) and self.diameter_m > 0):
            raise InputError(f"diameter_m = {self.diameter_m} is not a positive length")
        if self.ring and not 0 < self.ring.inner < self.ring.outer:
            raise InputError("the ring's inner diameter must lie between 0 and its outer one")
        letter = self.letter
        if letter and not (letter.stroke > 0 and 2 * letter.stroke < letter.width and letter.stroke < letter.height):
            raise InputError("the H's strokes do not fit into its height and width")
        if any(part and part.side <= 0 for part in (self.board, self.quiet_zone)):
            raise InputError("the side of the board or of the quiet zone is not positive")
        if not self.tags and not self.ring:
            raise InputError("a pad needs a tag or a ring")
        for tag in self.tags:
            if tag.size <= 0:
                raise InputError(f"tag {tag.id} has no positive size")
            tag_family(tag.family).modules(tag.id)
        if len({(tag.family, tag.id) for tag in self.tags}) < len(self.tags):
            raise InputError("two tags of the pad have the same family and id")

    @classmethod
    def read(cls, path: Path) -> PadSpec:
        """Read a pad TOML. Raises InputError naming the file and the key that is wrong."""
        try:
            with path.open("rb") as file:
                data = tomllib.load(file)
        except OSError as error:
            raise UsageError(error.strerror or "cannot be read", file=path) from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"no valid TOML: {error}", file=path) from error
        try:
            return cls._from_mapping(data)
        except (InputError, UsageError) as error:
            raise InputError(error.reason, file=path, hint=error.hint) from error

    def to_toml(self) -> str:
        """Return the pad as TOML that `read` turns into an equal pad."""
        lines = [f"name = {_toml(self.name)}", f"diameter_m = {_toml(self.diameter_m)}"]
        parts = {key: getattr(self, key) for key in _PARTS}
        lines += [f"{key} = false" for key, part in parts.items() if part is None]
        lines += [] if self.tags else ["tags = []"]  # before the first table, or it would belong to it
        for key, part in parts.items():
            if part is not None:
                lines += ["", f"[{key}]", *_toml_lines(part)]
        for tag in self.tags:
            lines += ["", "[[tags]]", *_toml_lines(tag)]
        return "\n".join(lines) + "\n"

    @classmethod
    def _from_mapping(cls, data: Mapping[str, Any]) -> PadSpec:
        refuse_unknown_keys(data, [field.name for field in fields(cls)])
        values: dict[str, Any] = {key: data[key] for key in ("name", "diameter_m") if key in data}
        for key, kind in _PARTS.items():
            if key in data:
                values[key] = None if data[key] is False else _part(kind, data[key], key)
        if "tags" in data:
            if not isinstance(data["tags"], list):
                raise InputError("tags must be a list of tables", hint="begin each tag with [[tags]]")
            values["tags"] = tuple(_part(PadTag, tag, "tags") for tag in data["tags"])
        if not isinstance(values.get("name", ""), str):
            raise InputError("name must be a text")
        diameter = values.get("diameter_m", 1.0)
        if isinstance(diameter, bool) or not isinstance(diameter, int | float):
            raise InputError("diameter_m must be a number")
        return cls(**values)

    def scaled(self, diameter_m: float) -> PadSpec:
        """Return the same target with another ring diameter."""
        return replace(self, diameter_m=diameter_m)

    def tag_size_m(self, tag: PadTag) -> float:
        """Edge length of a tag's measured quadrilateral, metres."""
        return tag.size * self.diameter_m

    def pad_T_tag(self, tag: PadTag) -> Pose:
        """Return the pose of a tag (x right, y up, z out of the print) in the pad frame."""
        # upright, the tag's x (right) is the pad's -y: a turn of -90 degrees about z
        yaw = math.radians(tag.yaw_deg - 90.0)
        place = np.array([tag.x, tag.y, 0.0]) * self.diameter_m
        return Pose(rotation_from_rotvec([0.0, 0.0, yaw]), place)

    def tag_corners_m(self, tag: PadTag) -> Array:
        """Return the corners (4, 3) of a tag in the pad frame: its top-left, top-right, bottom-right, bottom-left."""
        half = self.tag_size_m(tag) / 2.0
        square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        return self.pad_T_tag(tag).apply(square)

    @property
    def outline_m(self) -> Array:
        """The target's outer edge (N, 3), pad frame, metres: the ring's circle, else the box around the tags."""
        if self.ring:
            angle = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
            radius = self.ring.outer * self.diameter_m / 2.0
            return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
        corners = np.concatenate([self.tag_corners_m(tag) for tag in self.tags])
        low, high = corners.min(axis=0), corners.max(axis=0)
        return np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])

    @property
    def letter_outline_m(self) -> Array:
        """The H as one polygon (12, 2), pad frame, metres; empty (0, 2) without an H."""
        return _letter_outline(self.letter) * self.diameter_m if self.letter else np.zeros((0, 2))

    @cached_property
    def extent_m(self) -> float:
        """Side of the centred square that holds everything printed, metres."""
        points = [np.abs(shape.points_m).max() + shape.radius_m for shape in self.shapes()]
        return 2.0 * float(max(points))

    def shapes(self) -> list[Shape]:
        """Return what is painted, bottom first."""
        d = self.diameter_m
        painted: list[Shape] = []
        if self.board:
            painted.append(_square(self.board.side * d, self.board.color))
        if self.ring:
            centre = np.zeros((1, 2))
            inside = self.board.color if self.board else WHITE
            painted.append(Shape(centre, self.ring.color, self.ring.outer * d / 2.0))
            painted.append(Shape(centre, inside, self.ring.inner * d / 2.0))
        if self.letter:
            painted.append(Shape(self.letter_outline_m, self.letter.color))
        if self.quiet_zone:
            painted.append(_square(self.quiet_zone.side * d, self.quiet_zone.color))
        for tag in self.tags:
            painted += self._tag_shapes(tag)
        return painted

    def _tag_shapes(self, tag: PadTag) -> list[Shape]:
        """Paint the whole reference image: one white square, then every run of black modules in a row.

        White first: the other way round, a black rim would shine through at the edge of the white border.
        """
        family = tag_family(tag.family)
        modules = family.modules(tag.id)
        n = family.total_modules
        module = self.tag_size_m(tag) / family.border_modules
        pad_T_tag = self.pad_T_tag(tag)

        def rectangle(row: int, first: int, rows: int, columns: int, color: Color) -> Shape:
            x0, x1 = (first - n / 2) * module, (first + columns - n / 2) * module
            y0, y1 = (n / 2 - row) * module, (n / 2 - row - rows) * module
            square = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
            return Shape(pad_T_tag.apply(square)[:, :2], color)

        painted = [rectangle(0, 0, n, n, WHITE)]
        for row in range(n):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], (~modules[row]).astype(int), [0]])))
            painted += [rectangle(row, a, 1, b - a, BLACK) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        return painted


_PARTS: dict[str, type] = {"board": Board, "ring": Ring, "letter": Letter, "quiet_zone": QuietZone}


def _square(side: float, color: Color) -> Shape:
    h = side / 2.0
    return Shape(np.array([[h, h], [h, -h], [-h, -h], [-h, h]]), color)


def _letter_outline(letter: Letter) -> Array:
    """The H as one polygon (12, 2) in fractions of D; x is up on the print, y to the left."""
    x, y, s = letter.height / 2.0, letter.width / 2.0, letter.stroke
    left = [(x, y), (x, y - s), (s / 2, y - s), (s / 2, s - y), (x, s - y), (x, -y)]
    return np.array(left + [(-a, -b) for a, b in left])


def refuse_unknown_keys(data: Mapping[str, Any], known: Sequence[str], where: str = "") -> None:
    """Raise InputError for the first key of a TOML table that is not known, naming the nearest one that is.

    where: the table's own name with a dot behind it, empty for the whole file.
    """
    for key in data:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
            raise InputError(f"unknown key '{where}{key}'", hint=f"nearest known key is '{where}{near}'")


def _part(kind: type, data: Any, where: str) -> Any:
    """Build one part of the pad from its TOML table, checking keys and types."""
    if not isinstance(data, Mapping):
        raise InputError(f"'{where}' must be a table or false")
    known = {field.name: field.default for field in fields(kind)}
    refuse_unknown_keys(data, list(known), f"{where}.")
    values = dict(data)
    for key, value in values.items():
        name, default = f"{where}.{key}", known[key]
        if key == "color":
            values[key] = _color(value, name)
        elif key == "family":
            if not isinstance(value, str):
                raise InputError(f"{name} must be a text")
            values[key] = canonical_name(value)
        elif isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{name} must be a finite number")
        elif isinstance(default, int) and not isinstance(value, int):
            raise InputError(f"{name} must be a whole number")
    return kind(**values)


def _color(value: Any, name: str) -> Color:
    if isinstance(value, list) and len(value) == 3 and all(type(v) is int and 0 <= v <= 255 for v in value):
        return value[0], value[1], value[2]
    raise InputError(f"{name} must be three whole numbers from 0 to 255 (red, green, blue)")


def _toml(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # a TOML basic string is a JSON one
    return str(list(value)) if isinstance(value, tuple) else repr(value)


def _toml_lines(part: Any) -> list[str]:
    return [f"{field.name} = {_toml(getattr(part, field.name))}" for field in fields(part)]
