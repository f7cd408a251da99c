"""A calibration board on a sheet, at true scale."""

from __future__ import annotations

from landtool.calibrate.board import Board
from landtool.errors import UsageError
from landtool.print_pad.layout import BORDER_MM, FOOTER_MM, INDENT_MM, PAGES, Layout, footer
from landtool.print_pad.sheet import Area, Sheet
from landtool.print_pad.write_pdf import write_pdf
from landtool.print_pad.write_png import DPI_RANGE, write_png
from landtool.print_pad.write_svg import write_svg

SUFFIXES = (".pdf", ".svg", ".png")


def print_board(board: Board, suffix: str, *, page: str = "a4", dpi: int = 300) -> tuple[bytes, float, float]:
    """Return a board in the format of `suffix` (.pdf .svg .png), and its sheet's width and height in mm.

    A board is one sheet: a joint would bend its geometry. Raises UsageError for an unknown format or page, a
    resolution out of DPI_RANGE, and a board that does not fit the page.
    """
    if suffix not in SUFFIXES:
        raise UsageError(f"no printing format '{suffix}'", hint=f"known: {', '.join(SUFFIXES)}")
    if page not in PAGES:
        raise UsageError(f"no page size '{page}'", hint=f"known: {', '.join(PAGES)}")
    if not DPI_RANGE[0] <= dpi <= DPI_RANGE[1]:
        raise UsageError(f"{dpi} dots per inch", hint=f"it goes from {DPI_RANGE[0]} to {DPI_RANGE[1]}")
    layout = lay_out_board(board, PAGES[page])
    (sheet,) = layout.sheets
    if suffix == ".pdf":
        data = write_pdf(layout.sheets, layout.title)
    else:
        data = write_svg(sheet, layout.title) if suffix == ".svg" else write_png(sheet, dpi)
    return data, sheet.width_mm, sheet.height_mm


def lay_out_board(board: Board, page_mm: tuple[float, float]) -> Layout:
    """Put a board in the middle of a page of width and height `page_mm`, turned on its side where it fits only so."""
    across, down = (1000.0 * v for v in board.extent_m)
    width, height = page_mm
    if not _fits(across, down, width, height):
        width, height = height, width
    if not _fits(across, down, width, height):
        width, height = page_mm
        room = width - 2 * BORDER_MM, height - 2 * BORDER_MM - FOOTER_MM
        most = max(min(room[0] / across, room[1] / down), min(room[0] / down, room[1] / across)) * board.square_m
        reason = f"a board of {across:.6g} x {down:.6g} mm does not fit the page of {width:g} x {height:g} mm"
        hint = f"at most --square {int(most * 2000) / 2000:g}, fewer --squares, or a larger --page"
        raise UsageError(reason, hint=hint)
    boxes = board.rectangles_m() * 1000.0
    left = (width - across) / 2.0 - boxes[:, 0].min()
    top = (height - FOOTER_MM - BORDER_MM - down) / 2.0 - boxes[:, 1].min()
    # one area, as viewers show fine lines between areas that touch
    corners = boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2) + (left, top)
    picture = (Area(tuple(corners)),)
    lines = (board.name, *_say(board))
    window = (0.0, 0.0, width, height)
    sheet = Sheet(width, height, picture, window, tuple(footer(lines, height, INDENT_MM)))
    return Layout(board.name, 1, 1, (sheet,))


def _say(board: Board) -> tuple[str, ...]:
    call = f"landtool calibrate INPUT -o camera.yaml --board {board.kind} --squares {board.size}"
    call += f" --square {board.square_m:.6g}"
    if board.kind == "charuco":
        call += f" --marker {board.marker_m:.6g} --dictionary {board.dictionary}" + " --white-first" * board.white_first
    if board.kind == "aprilgrid":
        call += f" --spacing {board.spacing:g}"
    return call, "Print at 100 %, no scaling: the ruler must measure 100 mm. Fix it to something flat."


def _fits(across: float, down: float, width: float, height: float) -> bool:
    return across <= width - 2 * BORDER_MM and down <= height - 2 * BORDER_MM - FOOTER_MM
