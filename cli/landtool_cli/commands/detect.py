"""`landtool detect`: boxes and tags in recordings, in pixels."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from landtool.config import SAVES, DetectConfig
from landtool.detect.config import BOUNDS
from landtool.errors import UsageError
from landtool.families import FAMILIES
from landtool.run.detection import detect, load_files
from landtool_cli import options
from landtool_cli.batch import output_folders, run_all
from landtool_cli.console import Console, pass_console
from landtool_cli.settings import from_file, with_options

SCORE = options.FiniteRange(*BOUNDS["conf"])
OVERLAP = options.FiniteRange(*BOUNDS["iou"])
THREADS = click.IntRange(int(BOUNDS["threads"][0]), int(BOUNDS["threads"][1]))


@click.command("detect")
@options.inputs
@options.output("Folder for the results, one folder an input.  [default: runs/detect]")
@click.option(
    "--model", "detector__model", type=options.PATH, metavar="FILE", help="An ONNX network.  [default: the shipped one]"
)
@click.option("--conf", "detector__conf", type=SCORE, metavar="S", help="Least score of a box.  [default: 0.25]")
@click.option(
    "--iou",
    "detector__iou",
    type=OVERLAP,
    metavar="O",
    help="Of boxes of one class that overlap by more (intersection over union) the best stays.  [default: 0.45]",
)
@click.option(
    "--imgsz",
    "detector__imgsz",
    type=options.size_px,
    metavar="WxH",
    help="Size of the network's input, pixels.  [default: the model's]",
)
@click.option("--threads", "detector__threads", type=THREADS, metavar="N", help="Threads of the network.  [default: 1]")
@click.option(
    "--layout", "detector__layout", metavar="NAME", help="How the network writes its boxes.  [default: found out]"
)
@click.option(
    "--search",
    type=click.Choice(["frame", "region"]),
    help="Look at whole frames, or around the expected place where there is one.  [default: frame]",
)
@click.option(
    "--refine",
    type=click.Choice(["ring", "none"]),
    help="Move the pad's boxes onto its red ring, to a fraction of a pixel.  [default: ring]",
)
@options.pad
@options.dehaze
@options.topic
@options.fps
@click.option("--tags", "tags__which", type=click.Choice(["pad", "all", "none"]), help="Tags to read.  [default: pad]")
@click.option("--family", "tags__family", metavar="NAME", help=f"For --tags all: {', '.join(FAMILIES)}.")
@click.option("--tone", "tags__tone", metavar="srgb|none|GAMMA", help="Tone curve of the pictures.  [default: srgb]")
@click.option("--save", metavar="LIST", help=f"Outputs, of {', '.join(SAVES)}.  [default: {','.join(SAVES)}]")
@options.config
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    inputs: tuple[Path, ...],
    output: Path | None,
    config: Path | None,
    overwrite: bool,
    **flags: Any,
) -> int:
    """Find the pad and its tags in videos, folders of images and MCAP logs, in pixels: no calibration is needed.

    Writes tables of boxes, tags and frames, and an annotated video (images for a folder) for each INPUT.
    """
    settings = with_options(from_file(DetectConfig(), config), flags)
    if flags["tags__family"] and settings.tags.which != "all":
        raise UsageError("--family is read only with --tags all", hint="the pad's own families are in its file, --pad")
    also_read = [path for path in (settings.detector.model, settings.pad, config) if path is not None]
    folders = output_folders(inputs, output or Path("runs/detect"), overwrite=overwrite, also_read=also_read)
    files = load_files(settings)
    run = partial(detect, config=settings, files=files, overwrite=overwrite)
    return run_all(console, inputs, folders, run)
