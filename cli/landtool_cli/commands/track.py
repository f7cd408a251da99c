"""`landtool track`: the whole method on recordings."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from landtool.config import BOUNDS as SETTINGS_BOUNDS
from landtool.config import TRACK_SAVED, TRACK_SAVES, TrackConfig
from landtool.detect.config import BOUNDS as DETECTOR_BOUNDS
from landtool.errors import UsageError
from landtool.families import FAMILIES
from landtool.run.tracking import read_files, track
from landtool.tracking.tracker import BOUNDS
from landtool_cli import options
from landtool_cli.batch import output_folders, run_all
from landtool_cli.console import Console, pass_console
from landtool_cli.settings import from_file, with_options

TRACKER = {
    "horizon": ("horizon_s", "S", "How far ahead the platform's place is predicted.  [default: 0.5]"),
    "camera-delay": ("camera_delay_s", "S", "How long before its stamp a picture was exposed.  [default: 0]"),
    "accel-sigma": ("accel_sigma_mps2", "A", "Process noise, m/s^2.  [default: 1]"),
    "gate": ("gate_probability", "P", "Share of right measurements that pass the gate.  [default: 0.999]"),
    "coast": ("coast_s", "S", "A track ends this long after its last measurement.  [default: 2]"),
}

SCORE = options.FiniteRange(*DETECTOR_BOUNDS["conf"])


def tracker_options(function: Any) -> Any:
    """Add an option for each number of the tracker that is often changed, with its bounds."""
    for name, (key, metavar, text) in reversed(TRACKER.items()):
        kind = options.FiniteRange(*BOUNDS[key])
        function = click.option(f"--{name}", f"tracker__{key}", type=kind, metavar=metavar, help=text)(function)
    return function


@click.command("track")
@options.inputs
@options.output("Folder for the results, one folder an input.  [default: runs/track]")
@options.camera
@click.option("--camera-name", metavar="NAME", help="Which camera of a Kalibr camchain.")
@click.option("--scale-intrinsics/--no-scale-intrinsics", default=None, help="Accept a calibration of another size.")
@options.pad
@click.option("--diameter", "diameter_m", type=options.DIAMETER_M, metavar="M", help="Ring diameter D of the pad.")
@click.option("--mount", type=options.PATH, metavar="FILE", help="Camera on the body, TOML.  [default: straight down]")
@click.option("--ego", metavar="FILE|TOPIC", help="The drone's own poses: CSV, TUM, or a topic of the MCAP input.")
@click.option(
    "--model", "detector__model", type=options.PATH, metavar="FILE", help="An ONNX network.  [default: the shipped one]"
)
@click.option("--conf", "detector__conf", type=SCORE, metavar="S", help="Least score of a box.  [default: 0.25]")
@click.option(
    "--switch-altitude",
    "switch_altitude_m",
    type=options.FiniteRange(*SETTINGS_BOUNDS["switch_altitude_m"]),
    metavar="M",
    help="Height over the pad where the far stage gives way to the near one.  [default: where the tag is readable]",
)
@click.option(
    "--policy",
    type=click.Choice(["fuse", "paper"]),
    help="Use what is seen best in each frame, or the paper's hard switch from boxes to the tag.  [default: fuse]",
)
@options.dehaze
@options.topic
@options.fps
@click.option("--tags", "tags__which", type=click.Choice(["pad", "all"]), help="Which tags to read.  [default: pad]")
@click.option("--family", "tags__family", metavar="NAME", help=f"For --tags all: {', '.join(FAMILIES)}.")
@click.option(
    "--tone",
    "tags__tone",
    metavar="auto|srgb|none|GAMMA",
    help="Tone curve of the pictures; auto: by the pad's edges.  [default: auto]",
)
@click.option("--max-hamming", "tags__max_hamming", type=click.IntRange(0, 2), help="Corrected bits.  [default: 1]")
@click.option(
    "--min-margin",
    "tags__min_margin",
    type=options.FiniteRange(0, 255),
    help="Least mean distance of a tag's bits from their threshold, grey levels.  [default: 20]",
)
@tracker_options
@click.option(
    "--measurement",
    "tracker__measurement",
    type=click.Choice(["position", "paper"]),
    help="What the filter is given: positions, or also velocities made of two of them.  [default: position]",
)
@click.option(
    "--motion",
    "tracker__motion",
    type=click.Choice(["adaptive", "constant-velocity"]),
    help="How the platform is expected to move.  [default: adaptive]",
)
@click.option("--smooth/--no-smooth", default=None, help="Add the smoothed track to tracks.csv.")
@click.option(
    "--save", metavar="LIST", help=f"Outputs, of {', '.join(TRACK_SAVES)}.  [default: {','.join(TRACK_SAVED)}]"
)
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
    """Follow the pad through videos, folders of images and MCAP logs.

    Writes poses, tracks with a prediction, tables of tags and frames, and an annotated video for each INPUT.
    """
    flags["hfov_deg"] = flags.pop("hfov")
    settings = _settings(config, flags)
    files = read_files(settings)
    also_read = [*files.paths, *([config] if config else [])]
    folders = output_folders(inputs, output or Path("runs/track"), overwrite=overwrite, also_read=also_read)
    run = partial(track, config=settings, files=files, overwrite=overwrite)
    return run_all(console, inputs, folders, run)


def _settings(file: Path | None, flags: dict[str, Any]) -> TrackConfig:
    """Return the settings of a file, if there is one, with the options that were given put in."""
    base = from_file(TrackConfig(), file)
    if flags["hfov_deg"] is not None and flags["camera"] is None:  # it stands in for the file's camera too
        base = replace(base, camera=None, camera_name=None)
    if flags["camera"] is not None and flags["hfov_deg"] is None:
        base = replace(base, camera_name=None, hfov_deg=None)
    settings = with_options(base, flags)
    if flags["tags__family"] and settings.tags.which == "pad":
        raise UsageError("--family is read only with --tags all", hint="the pad's own families are in its file, --pad")
    return settings
