"""`landtool generate`: images and clips with exact truth."""

from __future__ import annotations

import os
import shlex
import time
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, get_args

import click

from landtool.config import GenerateConfig, configured, read_config
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.io.atomic import refuse_input_as_output
from landtool.io.local import local_file
from landtool.io.mcap_build import McapSchema
from landtool.pad import PadSpec
from landtool.synth.board_clip import BOUNDS as BOARD_BOUNDS
from landtool.synth.board_clip import LENSES, BoardClipConfig, write_board_clip
from landtool.synth.board_clip import side_files as board_files
from landtool.synth.clips import BOUNDS, SCENARIOS, ClipConfig, side_files, write_clip
from landtool.synth.dataset import DatasetRequest, DatasetSummary, Progress, write_dataset
from landtool.synth.dataset.backgrounds import SCIKIT_IMAGE, find_backgrounds
from landtool_cli import options
from landtool_cli.boards import board_of, board_options
from landtool_cli.console import Console, Counter, pass_console
from landtool_cli.groups import NamingGroup, help_if_alone


@click.group("generate", cls=NamingGroup, invoke_without_command=True)
@click.pass_context
def command(ctx: click.Context) -> None:
    """Make images and clips of landings with exact truth, to train and to test with."""
    help_if_alone(ctx)


def shares(text: str) -> tuple[float, ...]:
    """Return the numbers of a text such as 0.8,0.1,0.1, or fail as click does."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise click.BadParameter(f"'{text}' is no list of shares such as 0.8,0.1,0.1.") from None


@command.command("images")
@options.output("Folder for the dataset.", required=True)
@click.option("-n", type=click.IntRange(min=1), metavar="N", help="How many images. Required, here or in --config.")
@click.option("--seed", type=click.IntRange(min=0), metavar="S", help="Another seed, other images.  [default: 0]")
@click.option("--size", type=options.size_px, metavar="WxH", help="Size of the images, pixels.  [default: 640x480]")
@click.option("--split", type=shares, metavar="A,B,C", help="Shares of train, val and test.  [default: 0.8,0.1,0.1]")
@options.pad
@click.option("--diameter", "diameter_m", type=options.DIAMETER_M, metavar="M", help="Ring diameter D of the pad.")
@click.option(
    "--backgrounds",
    multiple=True,
    metavar=f"DIR|{SCIKIT_IMAGE}",
    help=f"Photographs to lay under the pad: a folder, or those of the package {SCIKIT_IMAGE}. May be repeated.",
)
@click.option("--jobs", type=click.IntRange(min=1), metavar="J", help="Processes that draw.  [default: one a core]")
@click.option(
    "--clear", is_flag=True, default=None, help="Draw each image in fog in clear air, too, to measure dehazing."
)
@click.option("--preview/--no-preview", default=None, help="Draw a contact sheet and statistics.  [default: preview]")
@options.config
@options.overwrite
@pass_console
def images(console: Console, /, output: Path, config: Path | None, overwrite: bool, **flags: Any) -> None:
    """Make a dataset of single images: YOLO and COCO labels, splits, and the truth of each image in truth.csv.

    Interrupted, the same command goes on where it stopped. The same seed gives the same images, whatever --jobs is.
    """
    settings = _settings(config, flags)
    if settings.n is None:
        raise UsageError("how many images?", hint="give -n, or n in --config")
    also_read = [path for path in (settings.pad, config) if path]
    refuse_input_as_output([*also_read, *(Path(p) for p in settings.backgrounds if p != SCIKIT_IMAGE)], output)
    photos = find_backgrounds(settings.backgrounds)
    pad = _pad(settings.pad, settings.diameter_m)
    request = _request(settings, settings.n, pad, photos)
    jobs = settings.jobs or _cores()
    console.unfinished = "the same command goes on where this one stopped"
    with console.counter(label=output.name, unit="image") as counter:
        progress = _progress(console, counter, jobs)
        preview = settings.preview
        made = write_dataset(request, output, jobs=jobs, overwrite=overwrite, preview=preview, progress=progress)
    _tell(console, made, settings)


def frame_rate(text: str) -> Fraction:
    """Return the exact rate of a text such as 30, 29.97 or 30000/1001, or fail as click does."""
    try:
        return Fraction(text)
    except (ValueError, ZeroDivisionError):
        raise click.BadParameter(f"'{text}' is no frame rate such as 30 or 30000/1001.") from None


def bounded(name: str) -> options.FiniteRange:
    """Return the range of a number that a clip can be asked for."""
    return options.FiniteRange(*BOUNDS[name])


@command.command("clip")
@options.output("The clip, .mp4 or .mcap; its truth, odometry, camera and pad are written beside it.", required=True)
@click.option("--scenario", type=click.Choice(tuple(SCENARIOS)), help="What the platform does.  [default: straight]")
@click.option(
    "--duration",
    "duration_s",
    type=bounded("duration_s"),
    metavar="S",
    help="Seconds.  [default: 6]",
)
@click.option("--fps", type=frame_rate, metavar="F", help="Pictures a second, as 30 or 30000/1001.  [default: 30]")
@click.option(
    "--height",
    "height_start_m",
    type=bounded("height_start_m"),
    metavar="M",
    help="Height at the start.  [default: 6]",
)
@click.option(
    "--fog",
    "fog_beta",
    type=bounded("fog_beta"),
    metavar="BETA",
    help="Extinction a metre, 3.9 / visibility.  [default: 0]",
)
@click.option(
    "--wind",
    "wind_mps",
    type=bounded("wind_mps"),
    metavar="V",
    help="Mean wind in m/s, gusts with it.  [default: 2]",
)
@click.option("--vfr", is_flag=True, default=None, help="Uneven times between the pictures, and gaps.")
@click.option("--seed", type=click.IntRange(min=0), metavar="S", help="Another seed, another landing.  [default: 0]")
@click.option("--size", type=options.size_px, metavar="WxH", help="Size of the pictures, pixels.  [default: 640x480]")
@click.option(
    "--hfov",
    "hfov_deg",
    type=bounded("hfov_deg"),
    metavar="DEG",
    help="Horizontal field of view.  [default: 70]",
)
@options.pad
@click.option("--diameter", "diameter_m", type=options.DIAMETER_M, metavar="M", help="Ring diameter D of the pad.")
@click.option("--mcap-schema", type=click.Choice(get_args(McapSchema)), help="Messages of a .mcap.  [default: ros2]")
@options.overwrite
@pass_console
def clip(
    console: Console, /, output: Path, pad: Path | None, diameter_m: float | None, overwrite: bool, **flags: Any
) -> None:
    """Make a landing on a moving platform: video or MCAP log, and the truth of every frame.

    A drone with the limits of a real one comes down on the platform. Beside CLIP.mp4 lie CLIP.truth.csv (drone,
    camera and platform in every frame), CLIP.ego.csv (the drone's own noisy odometry, for `landtool track --ego`),
    CLIP.camera.yaml, CLIP.pad.toml and CLIP.manifest.json.
    """
    if pad is not None:
        refuse_input_as_output([pad], output)
    config = ClipConfig(pad=_pad(pad, diameter_m), **{name: v for name, v in flags.items() if v is not None})
    with console.counter(label=output.name) as counter:

        def progress(done: int, total: int) -> None:
            if done == 1:
                counter.expect(total)
            counter.add()

        made = write_clip(config, output, overwrite=overwrite, report=progress)
    beside = side_files(output)
    console.result(f"{output}: {made.frames} frames, {config.scenario}; the pad is seen in {made.visible}")
    console.result(f"  truth: {beside['truth.csv']}")
    console.result(f"  {shlex.join(_track_command(output, beside))}")


def _track_command(output: Path, beside: Mapping[str, Path]) -> list[str]:
    """Return the `landtool track` of a clip; a log carries its calibration itself."""
    # a name that begins with a dash would be taken for an option
    clip = f"./{output}" if str(output).startswith("-") else str(output)
    camera = [] if output.suffix.lower() == ".mcap" else ["--camera", str(beside["camera.yaml"])]
    return ["landtool", "track", clip, *camera, "--pad", str(beside["pad.toml"]), "--ego", str(beside["ego.csv"])]


@command.command("board")
@options.output("The film, .mp4 or .mov; the true camera and the board are written beside it.", required=True)
@board_options("The board's kind, or its TOML.  [default: charuco]")
@click.option(
    "--duration",
    "duration_s",
    type=options.FiniteRange(*BOARD_BOUNDS["duration_s"]),
    metavar="S",
    help="Seconds.  [default: 6]",
)
@click.option("--fps", type=frame_rate, metavar="F", help="Pictures a second.  [default: 10]")
@click.option("--size", type=options.size_px, metavar="WxH", help="Size of the pictures, pixels.  [default: 640x480]")
@click.option(
    "--hfov",
    "hfov_deg",
    type=options.FiniteRange(*BOARD_BOUNDS["hfov_deg"]),
    metavar="DEG",
    help="Horizontal field of view, about.  [default: 65]",
)
@click.option("--lens", type=click.Choice(LENSES), help="The lens.  [default: plumb_bob]")
@click.option("--seed", type=click.IntRange(min=0), metavar="S", help="Another seed, another film.  [default: 0]")
@options.overwrite
@pass_console
def board(console: Console, /, output: Path, overwrite: bool, **flags: Any) -> None:
    """Film a calibration board with a known camera, to try `landtool calibrate` without a printer.

    Beside FILM.mp4 lie FILM.camera.yaml, the camera that `landtool calibrate` should find, and FILM.toml, the board.
    """
    filmed, read = board_of(flags)
    refuse_input_as_output(read, output)
    named = ("duration_s", "fps", "size", "hfov_deg", "lens", "seed")
    config = BoardClipConfig(filmed, **{name: flags[name] for name in named if flags[name] is not None})
    with console.counter(label=output.name) as counter:
        camera = write_board_clip(config, output, overwrite=overwrite, report=counter.reach)
    beside = board_files(output)
    console.result(f"{output}: {config.frames} pictures of {filmed.article} {filmed.name}")
    console.result(f"  truth: {beside['camera.yaml']}, fx {camera.fx:.2f}, cx {camera.cx:.2f}, cy {camera.cy:.2f} px")
    film = f"./{output}" if str(output).startswith("-") else str(output)
    call = ["landtool", "calibrate", film, "--board", str(beside["toml"]), "-o", "camera.yaml"]
    console.result(f"  {shlex.join(call)}")


@command.command("preview")
@click.argument("dataset", metavar="DIR", type=options.PATH)
@options.output("Folder for the two pictures.  [default: DIR]")
@options.overwrite
@pass_console
def preview(console: Console, dataset: Path, output: Path | None, overwrite: bool) -> None:
    """Show a dataset: images with their labels as preview.png, and what was drawn how often as statistics.png."""
    from landtool.synth.preview import write_preview  # loads matplotlib

    for path in write_preview(dataset, output, overwrite=overwrite):
        console.result(str(path))


def _settings(file: Path | None, flags: dict[str, Any]) -> GenerateConfig:
    """Return the settings of a file, if there is one, with the options that were given put in."""
    base = GenerateConfig()
    if file:
        try:
            base = configured(base, read_config(file))
        except LandtoolError as error:
            raise type(error)(error.reason, file=error.file or file, hint=error.hint) from error
    given = {name: value for name, value in flags.items() if value is not None and value != ()}
    try:
        return configured(base, given)
    except InputError as error:  # no file's content but what was typed
        raise UsageError(error.reason, hint=error.hint) from error


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _pad(file: Path | None, diameter_m: float | None) -> PadSpec:
    pad = PadSpec.read(local_file(file)) if file else PadSpec()
    return pad.scaled(diameter_m) if diameter_m else pad


def _request(settings: GenerateConfig, n: int, pad: PadSpec, photos: Any) -> DatasetRequest:
    try:
        return DatasetRequest(
            n, settings.seed, settings.size, settings.split, settings.domain, pad, photos, settings.clear
        )
    except InputError as error:  # the pad's content
        raise InputError(error.reason, file=settings.pad, hint=error.hint) from error


def _progress(console: Console, counter: Counter, jobs: int) -> Progress:
    """Move the bar, and say how long drawing took."""
    began, left, drawn = 0.0, 0, 0

    def start(total: int, kept: int) -> None:
        nonlocal began, left
        began, left = time.perf_counter(), total - kept
        if kept:
            console.log(f"goes on where an earlier run stopped: {kept} of {total} images are there")
        counter.expect(left)

    def images(count: int) -> None:
        nonlocal drawn
        drawn += count
        for _ in range(count):
            counter.add()
        if drawn == left:
            seconds = time.perf_counter() - began
            console.log(f"{drawn} images in {seconds:.1f} s, {drawn / seconds:.1f} images/s, {jobs} at a time")

    return Progress(start, images)


def _tell(console: Console, summary: DatasetSummary, settings: GenerateConfig) -> None:
    folder = summary.folder
    without = summary.images - summary.with_pad
    size = "{}x{}".format(*settings.size)
    console.result(f"{folder}: {summary.images} images of {size}, {summary.with_pad} with the pad, {without} without")
    console.result("  " + ", ".join(f"{name} {count}" for name, count in summary.splits.items()))
    console.result(f"  labels: {folder / 'data.yaml'} (YOLO), {folder / 'annotations'} (COCO)")
    console.result(f"  truth: {folder / 'truth.csv'}")
    if settings.clear:
        console.result(f"  in clear air, too: {folder / 'clear'}, {summary.twins} images in fog")
    if settings.preview:
        console.result(f"  to look at: {folder / 'preview.png'}, {folder / 'statistics.png'}")
