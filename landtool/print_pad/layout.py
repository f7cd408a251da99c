"""Where things stand on the sheets: the target, its ruler and sizes, and how a large one is cut into pages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from landtool.errors import UsageError
from landtool.pad import Color, PadSpec
from landtool.print_pad.sheet import Area, Box, Picture, Sheet, Text, bar, place

PAGES = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}  # width, height in mm
OVERLAP_MM = 10.0
MAX_SHEETS = 1000

BORDER_MM = 5.0  # what common printers leave white
_MARK_MM = 10.0  # room for the marks of a page that is to be cut
FOOTER_MM = 30.0
INDENT_MM = 10.0
_RULER_MM = 100
_LINE_MM = 0.2
_OVERVIEW_MM = 24.0
_LONGEST_LINE = 95  # characters that fit on the narrowest page beside the overview
_FAINT: Color = (200, 200, 200)
_HERE: Color = (0, 90, 200)


@dataclass(frozen=True)
class Layout:
    """The sheets, row by row from the top left, and the line that names the target and its size."""

    title: str
    rows: int
    columns: int
    sheets: tuple[Sheet, ...]


def lay_out(pad: PadSpec, page_mm: tuple[float, float], *, tiled: bool) -> Layout:
    """Lay a pad out on pages of width and height `page_mm`; what is larger is tiled or gets one sheet of its own.

    Raises UsageError when it would take more than MAX_SHEETS.
    """
    width, height = page_mm
    side = pad.extent_m * 1000.0
    fits = side <= width - 2 * BORDER_MM and side <= height - 2 * BORDER_MM - FOOTER_MM
    if tiled and not fits:
        return _tiles(pad, side, page_mm)
    if not fits:
        width = max(side + 2 * _MARK_MM, _RULER_MM + 60.0)
        height = side + 2 * _MARK_MM + FOOTER_MM
    # whatever room is left goes half above the target, half between it and the footer
    above = (height - FOOTER_MM - BORDER_MM - side) / 2.0
    box = ((width - side) / 2.0, above, side, side)
    picture = place(pad.shapes(), (width / 2.0, above + side / 2.0), 1000.0)
    margin = (*_crop_marks(box), *_footer(pad, height, ()))
    return Layout(_title(pad), 1, 1, (Sheet(width, height, picture, (0.0, 0.0, width, height), margin),))


@dataclass(frozen=True)
class _Grid:
    """How a square of `side` mm is cut: tiles of equal size, each overlapping the next by OVERLAP_MM."""

    side: float
    rows: int
    columns: int

    @property
    def tile(self) -> tuple[float, float]:
        width = (self.side + (self.columns - 1) * OVERLAP_MM) / self.columns
        height = (self.side + (self.rows - 1) * OVERLAP_MM) / self.rows
        return width, height

    def box(self, row: int, column: int) -> Box:
        """A tile's place in the square."""
        width, height = self.tile
        return column * (width - OVERLAP_MM), row * (height - OVERLAP_MM), width, height


def _tiles(pad: PadSpec, side: float, page_mm: tuple[float, float]) -> Layout:
    width, height = page_mm
    room = (width - 2 * _MARK_MM, height - 2 * _MARK_MM - FOOTER_MM)
    columns, rows = (max(1, math.ceil((side - OVERLAP_MM) / (across - OVERLAP_MM))) for across in room)
    if rows * columns > MAX_SHEETS:
        reason = f"a target {side / 1000:g} m wide needs {rows * columns} pages of {width:g} x {height:g} mm"
        raise UsageError(reason, hint=f"at most {MAX_SHEETS}: choose larger paper or write an .svg")
    grid = _Grid(side, rows, columns)
    sheets = [_tile(pad, grid, row, column, page_mm) for row in range(rows) for column in range(columns)]
    return Layout(_title(pad), rows, columns, tuple(sheets))


def _tile(pad: PadSpec, grid: _Grid, row: int, column: int, page_mm: tuple[float, float]) -> Sheet:
    width, height = page_mm
    left, top, tile_width, tile_height = grid.box(row, column)
    window = ((width - tile_width) / 2.0, _MARK_MM, tile_width, tile_height)
    # the square's centre, so that this tile's corner comes to the window's
    centre = (window[0] - left + grid.side / 2.0, window[1] - top + grid.side / 2.0)
    notes = (
        f"Row {row + 1} of {grid.rows}, column {column + 1} of {grid.columns}, counted from the top left. "
        f"Neighbours overlap by {OVERLAP_MM:g} mm.",
        "Cut at the upper and left marks; lay over the upper and left neighbours, edge to their grey ticks.",
    )
    ticks = _join_ticks(window, below=row + 1 < grid.rows, right=column + 1 < grid.columns)
    overview = _overview(pad, grid, (row, column), (width - INDENT_MM - _OVERVIEW_MM, height - FOOTER_MM))
    margin = (*_crop_marks(window), *ticks, *_footer(pad, height, notes), *overview)
    return Sheet(width, height, place(pad.shapes(), centre, 1000.0), window, margin)


def _crop_marks(box: Box) -> list[Picture]:
    """Return two short lines outside each corner of a box."""
    left, top, width, height = box
    gap, length, half = 0.5, 4.0, _LINE_MM / 2.0
    marks: list[Picture] = []
    for x, out_x in ((left, -1), (left + width, 1)):
        for y, out_y in ((top, -1), (top + height, 1)):
            start_x = x + gap if out_x > 0 else x - gap - length
            start_y = y + gap if out_y > 0 else y - gap - length
            marks += [bar(start_x, y - half, length, _LINE_MM), bar(x - half, start_y, _LINE_MM, length)]
    return marks


def _join_ticks(window: Box, *, below: bool, right: bool) -> list[Picture]:
    """Mark in the margin where the edges of the next pages come to lie."""
    left, top, width, height = window
    half, length = _LINE_MM / 2.0, 4.0
    ticks: list[Picture] = []
    if right:
        x = left + width - OVERLAP_MM - half
        ticks += [bar(x, y, _LINE_MM, length, _FAINT) for y in (top - 0.5 - length, top + height + 0.5)]
    if below:
        y = top + height - OVERLAP_MM - half
        ticks += [bar(x, y, length, _LINE_MM, _FAINT) for x in (left - 0.5 - length, left + width + 0.5)]
    return ticks


def _title(pad: PadSpec) -> str:
    what = "outer diameter of the ring" if pad.ring else "the unit of its drawing"
    return f"{_shortened(pad.name, 40)}: D = {pad.diameter_m * 1000:.6g} mm, {what}"


def _footer(pad: PadSpec, height: float, notes: tuple[str, ...]) -> list[Picture | Text]:
    """The ruler, and lines with the target's name and sizes, at the foot of a sheet `height` high."""
    tags = ", ".join(f"{tag.family} id {tag.id}: {pad.tag_size_m(tag) * 1000:.6g} mm" for tag in pad.tags)
    lines = [
        _title(pad),
        _shortened(f"Tags, outer edge of the border: {tags}", _LONGEST_LINE) if tags else "No tags",
        f"Print at 100 %, no scaling: the ruler must measure {_RULER_MM} mm.",
        *notes,
    ]
    return footer(lines, height, INDENT_MM)


def footer(lines: Sequence[str], height: float, left: float) -> list[Picture | Text]:
    """Return the check ruler, and lines of text under it, at the foot of a sheet `height` mm high."""
    top = height - FOOTER_MM
    texts = [Text(left, top + 11.3 + 3.3 * i, line, 2.8) for i, line in enumerate(lines)]
    return [*_ruler(left, top + 6.8), *texts]


def _ruler(left: float, base: float) -> list[Picture | Text]:
    """A scale of 100 mm: lines at every mm whose middles are exactly there, longer at 5 and 10."""
    half = _LINE_MM / 2.0
    parts: list[Picture | Text] = [bar(left - half, base - half, _RULER_MM + _LINE_MM, _LINE_MM)]
    for mm in range(_RULER_MM + 1):
        length = 4.0 if mm % 10 == 0 else 3.0 if mm % 5 == 0 else 2.0
        parts.append(bar(left + mm - half, base - length, _LINE_MM, length))
        if mm % 10 == 0:
            label = f"{mm} mm" if mm == _RULER_MM else str(mm)
            parts.append(Text(left + mm, base - 4.6, label, 2.2, "middle"))
    return parts


def _overview(pad: PadSpec, grid: _Grid, here: tuple[int, int], corner: tuple[float, float]) -> list[Picture | Text]:
    """A small picture of all pages with this one framed.

    Faint and with its tags as plain squares: a tag reader must not find a second target in the margin.
    """
    left, top = corner
    scale = _OVERVIEW_MM / grid.side
    centre = (left + _OVERVIEW_MM / 2.0, top + _OVERVIEW_MM / 2.0)
    shapes = replace(pad, tags=()).shapes() if pad.ring else []
    parts: list[Picture | Text] = []
    for part in place(shapes, centre, 1000.0 * scale):
        parts.append(part if min(part.color) > 250 else replace(part, color=_FAINT))
    for tag in pad.tags:
        corners = pad.tag_corners_m(tag)[:, :2]
        parts.append(Area(((centre - corners[:, ::-1] * 1000.0 * scale),), _FAINT))
    for row in range(grid.rows):
        for column in range(grid.columns):
            if (row, column) != here:
                parts += _frame(_scaled(grid.box(row, column), scale, corner), 0.1, (130, 130, 130))
    return [*parts, *_frame(_scaled(grid.box(*here), scale, corner), 0.5, _HERE)]


def _scaled(box: Box, scale: float, corner: tuple[float, float]) -> Box:
    left, top, width, height = (value * scale for value in box)
    return corner[0] + left, corner[1] + top, width, height


def _frame(box: Box, line: float, color: Color) -> list[Picture]:
    left, top, width, height = box
    return [
        bar(left, top, width, line, color),
        bar(left, top + height - line, width, line, color),
        bar(left, top, line, height, color),
        bar(left + width - line, top, line, height, color),
    ]


def _shortened(text: str, length: int) -> str:
    text = " ".join(text.split())
    return text if len(text) <= length else text[: length - 3] + "..."
