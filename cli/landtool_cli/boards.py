"""Options that describe a calibration board, for the commands that print, draw and find one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from landtool.calibrate.board import DICTIONARIES, KINDS, Board
from landtool.errors import UsageError
from landtool.io.local import local_file
from landtool_cli.options import Decorated, Decorator, FiniteRange

_LENGTH = FiniteRange(0.0, min_open=True)
# Which kinds read an option
_READ_BY = {"marker": ("charuco",), "dictionary": ("charuco",), "white_first": ("charuco",), "spacing": ("aprilgrid",)}


def squares(text: str) -> tuple[int, int]:
    """Return columns and rows of a text such as 8x11, or fail as click does."""
    found = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
    if not found:
        raise click.BadParameter(f"'{text}' is no size of a board such as 8x11.")
    return int(found[1]), int(found[2])


def board_options(help: str) -> Decorator:
    """Take what describes a board: `board`, `squares`, `square`, `marker`, `dictionary`, `white_first`, `spacing`.

    help: of --board.
    """

    def add(function: Decorated) -> Decorated:
        for option in reversed(_OPTIONS):
            function = option(function)
        return click.option("--board", metavar=f"{'|'.join(KINDS)}|FILE", help=help)(function)

    return add


_OPTIONS = (
    click.option(
        "--squares",
        type=squares,
        metavar="CxR",
        help="Columns and rows of squares, not of inner corners, or of tags.  [default: 8x11, tags 6x8]",
    ),
    click.option(
        "--square",
        type=_LENGTH,
        metavar="M",
        help="Side of a square, or of a tag, metres.  [default: 0.02, tags 0.022]",
    ),
    click.option(
        "--marker", type=_LENGTH, metavar="M", help="Side of a ChArUco marker, metres.  [default: 3/4 of --square]"
    ),
    click.option(
        "--dictionary", type=click.Choice(list(DICTIONARIES)), help="Bits of a ChArUco marker.  [default: 5x5]"
    ),
    click.option("--white-first", is_flag=True, default=None, help="A ChArUco board whose first square is white."),
    click.option(
        "--spacing", type=_LENGTH, metavar="S", help="Gap between an AprilGrid's tags over their side.  [default: 0.3]"
    ),
)


def board_of(flags: Mapping[str, Any]) -> tuple[Board, tuple[Path, ...]]:
    """Return the board that the options describe, and the files that were read for it.

    Raises UsageError for an unknown kind, an option its kind does not read, and what no board can be.
    """
    said = flags["board"] or "charuco"
    files: tuple[Path, ...] = ()
    if said in KINDS:
        board = Board.usual(said)
    elif said.lower().endswith(".toml"):
        files = (local_file(Path(said)),)
        board = Board.read(files[0])
    else:
        raise UsageError(f"no board '{said}'", hint=f"known: {', '.join(KINDS)}, or a board's TOML")
    for name, kinds in _READ_BY.items():
        if flags[name] is not None and board.kind not in kinds:
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} is read only with --board {kinds[0]}", hint=f"leave out {option}")
    values: dict[str, Any] = {}
    if flags["squares"] is not None:
        values["columns"], values["rows"] = flags["squares"]
    if flags["square"] is not None:
        values["square_m"] = flags["square"]
        values["marker_m"] = board.marker_m / board.square_m * flags["square"]
    if flags["marker"] is not None:
        values["marker_m"] = flags["marker"]
    values |= {name: flags[name] for name in ("dictionary", "white_first", "spacing") if flags[name] is not None}
    return replace(board, **values), files


def given(flags: Mapping[str, Any]) -> list[str]:
    """Return the options of a board that were given, as they are typed."""
    names = ("squares", "square", "marker", "dictionary", "white_first", "spacing")
    return [f"--{name.replace('_', '-')}" for name in names if flags[name] is not None]
