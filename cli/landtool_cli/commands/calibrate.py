"""`landtool calibrate`: the camera's intrinsics from a recording of a board."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from landtool.calibrate.models import MODELS
from landtool.run.calibration import CalibrateRequest, calibrate
from landtool_cli import options
from landtool_cli.boards import board_of, board_options
from landtool_cli.console import Console, pass_console


@click.command("calibrate")
@click.argument("input", metavar="INPUT", type=options.PATH)
@options.output("The camera as ROS camera_info YAML; a report and numbers are written beside it.", required=True)
@board_options("The board's kind, or its TOML.  [default: charuco]")
@click.option(
    "--model",
    type=click.Choice(list(MODELS)),
    default="plumb_bob",
    show_default=True,
    help="The lens: 5 coefficients, a fisheye's 4, or 8 of a rational polynomial.",
)
@options.topic
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    input: Path,
    output: Path,
    model: str,
    topic: str | None,
    overwrite: bool,
    **flags: Any,
) -> int:
    """Calibrate a camera from a video, folder of images or MCAP log of a board.

    Film the board flat, sharp and whole, in all parts of the picture, near and far, tilted to all sides. Beside
    CAM.yaml lie CAM.report.png (residuals, coverage, uncertainty) and CAM.json (all numbers, views used and refused).
    `landtool pad --board KIND -o board.pdf` prints a board.
    """
    board, read = board_of(flags)
    console.file = input
    with console.counter(label=input.name) as counter:
        request = CalibrateRequest(
            input,
            output,
            board,
            model,
            topic,
            read,
            overwrite,
            on_start=lambda info: counter.expect(info.frames_declared),
            on_frame=counter.add,
        )
        outcome = calibrate(request)
    console.result(f"{input}: {outcome.files[0]}")
    for line in outcome.lines():
        console.result(f"  {line}")
    for warning in outcome.warnings:
        console.warning(f"{input}: {warning}")
    return outcome.exit_code
