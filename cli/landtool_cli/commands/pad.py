"""`landtool pad`: the target for printing, or its TOML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from landtool.calibrate.board import Board
from landtool.errors import UsageError
from landtool.io.atomic import atomic_path, refuse_input_as_output
from landtool.io.local import local_file
from landtool.pad import PadSpec
from landtool.print_pad import FORMATS, PRINT_DIAMETER_M, PadPrint, print_pad
from landtool.print_pad.board import print_board
from landtool.print_pad.layout import PAGES
from landtool.print_pad.write_png import DPI_RANGE
from landtool_cli import options
from landtool_cli.boards import board_of, board_options, given
from landtool_cli.console import Console, pass_console

SUFFIXES = (*FORMATS, ".toml")


@click.command("pad")
@options.output("What to make, by its ending: .pdf, .svg or .png for printing, .toml for --pad.", required=True)
@click.option(
    "--diameter",
    type=options.DIAMETER_M,
    metavar="M",
    help="Outer diameter of the ring, D, in metres.  [default: that of --pad; without one 0.18, which fits A4]",
)
@click.option("--page", type=click.Choice(list(PAGES)), default="a4", show_default=True, help="Paper size.")
@click.option("--pad", "file", type=options.PATH, metavar="FILE", help="The target as TOML.  [default: pad v1]")
@board_options("A board to calibrate a camera with, in place of the target.")
@click.option("--dpi", type=click.IntRange(*DPI_RANGE), default=300, show_default=True, help="Resolution of a .png.")
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    output: Path,
    diameter: float | None,
    page: str,
    file: Path | None,
    dpi: int,
    overwrite: bool,
    **flags: Any,
) -> None:
    """Make the landing target for printing, at true scale.

    A target larger than the page is spread over several pages of a PDF, to be cut and joined; an SVG or PNG is one
    sheet as large as it needs to be. Print at 100 %: the ruler in the margin must measure 100 mm.

    `landtool track` has to know D. Make the pad file for it with the same options: landtool pad -o pad.toml

    With --board it is the board for `landtool calibrate`; a .toml is its description.
    """
    suffix = output.suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError("unknown kind of output", file=output, hint=f"use one of {', '.join(SUFFIXES)}")
    if flags["board"] is not None:
        if file is not None or diameter is not None:
            raise UsageError("--pad and --diameter are the target's, not a board's", hint="leave them or --board out")
        _make_board(console, output, flags, page, dpi, overwrite)
        return
    if unread := given(flags):
        raise UsageError(f"{unread[0]} is read only with --board", hint="add --board KIND")
    if file is not None:
        refuse_input_as_output([file], output)
    pad = _wanted_pad(file, diameter)
    with atomic_path(output, overwrite=overwrite) as temporary:
        if suffix == ".toml":
            temporary.write_text(pad.to_toml(), encoding="utf-8")
            sheets = f"for `landtool track --pad {output}`"
        else:
            made = print_pad(pad, suffix, page=page, dpi=dpi)
            temporary.write_bytes(made.data)
            sheets = _sheets(made)
    console.result(f"{output}: {pad.name}, D = {pad.diameter_m:g} m, {sheets}")
    for tag in pad.tags:
        console.result(f"  {tag.family} id {tag.id}: {pad.tag_size_m(tag) * 1000:.6g} mm, outer edge of its border")
    if suffix != ".toml":
        console.result(_advice(pad, file))


def _make_board(console: Console, output: Path, flags: dict[str, Any], page: str, dpi: int, overwrite: bool) -> None:
    """Print a board, or write its description."""
    board, read = board_of(flags)
    refuse_input_as_output(read, output)
    suffix = output.suffix.lower()
    with atomic_path(output, overwrite=overwrite) as temporary:
        if suffix == ".toml":
            temporary.write_text(board.to_toml(), encoding="utf-8")
            console.result(f"{output}: {board.name}, for `landtool calibrate --board {output}`")
            return
        data, width, height = print_board(board, suffix, page=page, dpi=dpi)
        temporary.write_bytes(data)
    console.result(f"{output}: {board.name}, one sheet of {width:.6g} x {height:.6g} mm")
    console.result("Print at 100 %, no scaling; the ruler must measure 100 mm. Fix it to something flat.")
    console.result(f"Calibrate with it: landtool calibrate INPUT -o camera.yaml {_as_options(board)}")


def _as_options(board: Board) -> str:
    """Return the options that describe a board; the usual one needs its kind only."""
    said = f"--board {board.kind}"
    if board == Board.usual(board.kind):
        return said
    said += f" --squares {board.size} --square {board.square_m:.9g}"
    if board.kind == "charuco":
        said += f" --marker {board.marker_m:.9g} --dictionary {board.dictionary}" + " --white-first" * board.white_first
    return said + (f" --spacing {board.spacing:g}" if board.kind == "aprilgrid" else "")


def _wanted_pad(file: Path | None, diameter: float | None) -> PadSpec:
    """Return the pad of the options; on paper, pad v1 has the size that fits it."""
    if file is None:
        return PadSpec(diameter_m=diameter or PRINT_DIAMETER_M)
    pad = PadSpec.read(local_file(file))
    return pad.scaled(diameter) if diameter else pad


def _sheets(made: PadPrint) -> str:
    size = f"{made.width_mm:.6g} x {made.height_mm:.6g} mm"
    pages = made.rows * made.columns
    return f"one sheet of {size}" if pages == 1 else f"{pages} pages of {size}, {made.rows} rows of {made.columns}"


def _advice(pad: PadSpec, file: Path | None) -> str:
    """Say how to print, and how `landtool track` learns the size."""
    advice = "Print at 100 %, no scaling; the ruler must measure 100 mm. "
    if file is not None and PadSpec.read(file) == pad:
        return f"{advice}Track it with --pad {file}"
    source = f" --pad {file}" if file else ""
    return f"{advice}Its file for track --pad: landtool pad -o pad.toml{source} --diameter {pad.diameter_m!r}"
