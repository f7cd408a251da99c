"""Options that several commands share: each is declared once, with its bounds.

Paths are handed over unchecked: the library says what is wrong with a file, in one style.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar

import click

from landtool.config import BOUNDS

Decorated = TypeVar("Decorated", bound=Callable[..., Any])


class Decorator(Protocol):
    """Adds an option to a command's function."""

    def __call__(self, function: Decorated, /) -> Decorated:
        """Return the function, decorated."""
        ...


class FiniteRange(click.FloatRange):
    """A range of numbers that NaN, which click lets pass, is not in."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number, or fail as click does."""
        number: float = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{number} is not in the range {self._describe_range()}.", param, ctx)
        return number


class GivenPath(click.Path):
    """A path. The empty text, which an unset shell variable gives, is none and not the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or fail as click does."""
        if value == "":
            self.fail("the path is empty.", param, ctx)
        return super().convert(value, param, ctx)


PATH = GivenPath(path_type=Path)
HFOV_DEG = FiniteRange(*BOUNDS["hfov_deg"])
FPS = FiniteRange(*BOUNDS["fps"])
DIAMETER_M = FiniteRange(*BOUNDS["diameter_m"])


def size_px(text: str) -> tuple[int, int]:
    """Return width and height of a text such as 640x480, or fail as click does."""
    found = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text)
    if not found:
        raise click.BadParameter(f"'{text}' is no picture size such as 640x480.")
    return int(found[1]), int(found[2])


def inputs(function: Decorated) -> Decorated:
    """Take one or more recordings: `inputs`, a tuple of paths."""
    return click.argument("inputs", metavar="INPUT...", type=PATH, nargs=-1, required=True)(function)


def output(help: str, *, required: bool = False) -> Decorator:
    """Take `-o/--output PATH`: `output`."""
    return click.option("-o", "--output", type=PATH, required=required, help=help)


def overwrite(function: Decorated) -> Decorated:
    """Take `--overwrite`: `overwrite`, a bool."""
    return click.option("--overwrite", is_flag=True, help="Replace outputs that exist.")(function)


def camera(function: Decorated) -> Decorated:
    """Take `--camera FILE` and `--hfov DEG`: `camera`, a path, and `hfov`, degrees; None when not given."""
    function = click.option(
        "--hfov",
        type=HFOV_DEG,
        metavar="DEG",
        help="Horizontal field of view, in place of a camera file: no distortion, and every output says so.",
    )(function)
    return click.option(
        "--camera",
        type=PATH,
        metavar="FILE",
        help="Calibration: ROS camera_info YAML, Kalibr camchain or OpenCV FileStorage. An MCAP log can hold its own.",
    )(function)


def pad(function: Decorated) -> Decorated:
    """Take `--pad FILE`: `pad`, the path of a pad TOML, None when not given."""
    return click.option("--pad", type=PATH, metavar="FILE", help="The target as TOML.  [default: pad v1, D = 1.0 m]")(
        function
    )


def dehaze(function: Decorated) -> Decorated:
    """Take `--dehaze auto|on|off`: `dehaze`, None when not given."""
    return click.option(
        "--dehaze",
        type=click.Choice(["auto", "on", "off"]),
        help="Look through haze: where there is some, in every frame, or never.  [default: auto]",
    )(function)


def topic(function: Decorated) -> Decorated:
    """Take `--topic NAME`: `topic`, None when not given."""
    return click.option("--topic", metavar="NAME", help="Image topic of an MCAP log that holds more than one.")(
        function
    )


def fps(function: Decorated) -> Decorated:
    """Take `--fps F`: `fps`, images a second, None when not given."""
    return click.option(
        "--fps", type=FPS, metavar="F", help="Frame rate of a folder of images, which has no clock of its own."
    )(function)


def config(function: Decorated) -> Decorated:
    """Take `--config FILE`: `config`, a path, None when not given."""
    return click.option("--config", type=PATH, metavar="FILE", help="Settings as TOML; options win over it.")(function)
