"""`landtool dehaze`: recordings without their haze."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from landtool.config import DehazeCommandConfig
from landtool.dehaze.config import BOUNDS, PAPER_BOUNDS
from landtool.errors import UsageError
from landtool.io.atomic import refuse_input_as_output
from landtool.run.dehazed_files import dehazed_paths
from landtool.run.dehazing import dehaze
from landtool_cli import options
from landtool_cli.batch import run_all
from landtool_cli.console import Console, pass_console
from landtool_cli.settings import from_file, with_options

PAPER = "With --recipe paper: "
# Options that only one choice of another reads
NEEDS = {
    "--patch": ("dehazer__paper__patch_px", "recipe", "paper"),
    "--airlight": ("dehazer__paper__airlight", "recipe", "paper"),
    "--airlight-share": ("dehazer__paper__airlight_share", "recipe", "paper"),
    "--omega": ("dehazer__paper__omega", "recipe", "paper"),
    "--t0": ("dehazer__paper__t0", "recipe", "paper"),
    "--refine": ("dehazer__paper__refine", "recipe", "paper"),
    "--guided-radius": ("dehazer__paper__guided_radius_px", "refine", "guided"),
    "--guided-epsilon": ("dehazer__paper__guided_epsilon", "refine", "guided"),
    "--matting-lambda": ("dehazer__paper__matting_lambda", "refine", "matting"),
    "--subsample": ("dehazer__paper__subsample", "recipe", "paper"),
}


def _number(name: str, key: str, metavar: str, text: str) -> options.Decorator:
    """Return an option for one number of the settings, with its bounds."""
    *_, last = key.split("__")
    low, high = (BOUNDS | PAPER_BOUNDS)[last]
    whole = isinstance(low, int) and isinstance(high, int)
    kind = click.IntRange(int(low), int(high)) if whole else options.FiniteRange(low, high)
    return click.option(name, key, type=kind, metavar=metavar, help=text)


@click.command("dehaze")
@options.inputs
@options.output("The result, of INPUT's kind; a folder for several inputs or a folder of images.", required=True)
@click.option(
    "--when", type=click.Choice(["auto", "on"]), help="Dehaze frames that are hazy, or every frame.  [default: auto]"
)
@click.option(
    "--recipe",
    "dehazer__recipe",
    type=click.Choice(["veil", "paper"]),
    help="A smooth veil, taken off in linear light, or the dark channel prior.  [default: veil]",
)
@_number("--strength", "dehazer__strength", "S", "Share of what the recipe takes off.  [default: 1]")
@click.option(
    "--tone",
    "dehazer__tone",
    metavar="srgb|none|GAMMA",
    help="Tone curve of the pictures.  [default: srgb]",
)
@_number("--smooth", "dehazer__smooth_s", "S", "Time over which a video's air is smoothed, s.  [default: 0.3]")
@_number("--haze-on", "dehazer__haze_on", "H", "With --when auto: haze at which dehazing starts.  [default: 0.11]")
@_number("--haze-off", "dehazer__haze_off", "H", "With --when auto: haze below which it ends.  [default: 0.09]")
@_number("--patch", "dehazer__paper__patch_px", "N", f"{PAPER}side of the dark channel's patch, px.  [default: 15]")
@click.option(
    "--airlight",
    "dehazer__paper__airlight",
    type=click.Choice(["mean", "brightest"]),
    help=f"{PAPER}mean of the pixels whose dark channel is brightest, or the brightest of them.  [default: mean]",
)
@_number("--airlight-share", "dehazer__paper__airlight_share", "S", f"{PAPER}how many those are.  [default: 0.001]")
@_number("--omega", "dehazer__paper__omega", "W", f"{PAPER}share of the haze that is taken off.  [default: 0.95]")
@_number("--t0", "dehazer__paper__t0", "T", f"{PAPER}least transmission in the recovery.  [default: 0.1]")
@click.option(
    "--refine",
    "dehazer__paper__refine",
    type=click.Choice(["guided", "matting"]),
    help=f"{PAPER}guided filter, or matting Laplacian, about a second a picture.  [default: guided]",
)
@_number("--guided-radius", "dehazer__paper__guided_radius_px", "N", "Guided filter: radius, px.  [default: 60]")
@_number("--guided-epsilon", "dehazer__paper__guided_epsilon", "E", "Guided filter: regularisation.  [default: 0.001]")
@_number("--matting-lambda", "dehazer__paper__matting_lambda", "L", "Matting: weight of the data.  [default: 0.0001]")
@_number(
    "--subsample",
    "dehazer__paper__subsample",
    "N",
    f"{PAPER}estimate in a picture this much smaller; 1 is dense.  [default: 4]",
)
@click.option(
    "--side-by-side", is_flag=True, default=None, help="Put the input to the left of the result; not for MCAP logs."
)
@click.option(
    "--save-transmission",
    is_flag=True,
    default=None,
    help="Write each dehazed frame's transmission to the folder <OUTPUT's name>-transmission, too: PNG, 65535 is 1.",
)
@options.topic
@options.fps
@options.config
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    inputs: tuple[Path, ...],
    output: Path,
    config: Path | None,
    overwrite: bool,
    **flags: Any,
) -> int:
    """Take the haze out of images, folders of images, videos and MCAP logs.

    OUTPUT is of the same kind, size and timing. A frame that is clear passes unchanged.
    """
    settings = with_options(from_file(DehazeCommandConfig(), config), flags)
    _refuse_unread(settings, flags)
    paths = dehazed_paths(inputs, output, overwrite=overwrite, maps=settings.save_transmission)
    for path in paths:
        refuse_input_as_output([config] if config else [], path)
    return run_all(console, inputs, paths, partial(dehaze, config=settings, overwrite=overwrite))


def _refuse_unread(settings: DehazeCommandConfig, flags: dict[str, Any]) -> None:
    """Raise UsageError for an option that was given and that the chosen recipe does not read."""
    chosen = {"recipe": settings.dehazer.recipe, "refine": settings.dehazer.paper.refine}
    for option, (key, choice, wanted) in NEEDS.items():
        if flags[key] is None:
            continue
        of_paper = choice == "refine" and chosen["recipe"] != "paper"
        if of_paper or chosen[choice] != wanted:
            other = "--recipe paper" if of_paper else f"--{choice} {wanted}"
            raise UsageError(f"{option} is read only with {other}", hint=f"add {other} or leave out {option}")
