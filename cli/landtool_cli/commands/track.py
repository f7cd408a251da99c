"""`landtool track`: the whole method on recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from landtool.config import SAVES, TrackConfig, configured, read_config
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.families import FAMILIES
from landtool.run import RunFiles, RunOutcome, read_files, track
from landtool.tracking.tracker import BOUNDS
from landtool_cli import options
from landtool_cli.batch import batch_exit_code, output_folders
from landtool_cli.console import Console, pass_console
from landtool_cli.explain import explain

TRACKER = {
    "horizon": ("horizon_s", "S", "How far ahead the platform's place is predicted.  [default: 0.5]"),
    "accel-sigma": ("accel_sigma_mps2", "A", "Process noise, m/s^2.  [default: 2]"),
    "gate": ("gate_probability", "P", "Share of right measurements that pass the gate.  [default: 0.999]"),
    "coast": ("coast_s", "S", "A track ends this long after its last measurement.  [default: 2]"),
}


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
@options.topic
@options.fps
@click.option("--tags", "tags__which", type=click.Choice(["pad", "all"]), help="Which tags to read.  [default: pad]")
@click.option("--family", "tags__family", metavar="NAME", help=f"For --tags all: {', '.join(FAMILIES)}.")
@click.option("--tone", "tags__tone", metavar="srgb|none|GAMMA", help="Tone curve of the pictures.  [default: srgb]")
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
    """Follow the pad through videos, folders of images and MCAP logs.

    Writes poses, tracks with a prediction, tables of tags and frames, and an annotated video for each INPUT.
    """
    flags["hfov_deg"] = flags.pop("hfov")
    settings = _settings(config, flags)
    files = read_files(settings)
    also_read = [*files.paths, *([config] if config else [])]
    folders = output_folders(inputs, output or Path("runs/track"), overwrite=overwrite, also_read=also_read)
    failures: list[LandtoolError] = []
    codes: list[int] = []
    for path, folder in zip(inputs, folders, strict=True):
        console.file = path
        try:
            outcome = _track_one(console, path, folder, settings, files, overwrite)
        except Exception as error:  # whatever it is, it must not cost the other inputs
            if len(inputs) == 1:
                raise
            text, _ = explain(error, console)
            console.error(text)
            failures.append(error if isinstance(error, LandtoolError) else LandtoolError(text))
            continue
        codes.append(outcome.exit_code)
        _tell(console, path, outcome)
    return batch_exit_code(codes, failures)


def _settings(file: Path | None, flags: dict[str, Any]) -> TrackConfig:
    """Return the settings of a file, if there is one, with the options that were given put in."""
    base = _from_file(file) if file else TrackConfig()
    if flags["hfov_deg"] is not None and flags["camera"] is None:  # it stands in for the file's camera too
        base = replace(base, camera=None, camera_name=None)
    if flags["camera"] is not None and flags["hfov_deg"] is None:
        base = replace(base, camera_name=None, hfov_deg=None)
    try:
        settings = configured(base, _nested(flags))
    except InputError as error:  # no file's content but what was typed
        raise UsageError(error.reason, hint=error.hint) from error
    if flags["tags__family"] and settings.tags.which == "pad":
        raise UsageError("--family is read only with --tags all", hint="the pad's own families are in its file, --pad")
    return settings


def _from_file(file: Path) -> TrackConfig:
    try:
        return configured(TrackConfig(), read_config(file))
    except LandtoolError as error:
        raise type(error)(error.reason, file=error.file or file, hint=error.hint) from error


def _nested(flags: dict[str, Any]) -> dict[str, Any]:
    """Turn the options that were given into nested settings: `tags__tone` goes into `tags`."""
    values: dict[str, Any] = {}
    for name, value in flags.items():
        if value is None:
            continue
        table, _, key = name.rpartition("__")
        (values.setdefault(table, {}) if table else values)[key] = value
    return values


def _track_one(
    console: Console, path: Path, folder: Path, settings: TrackConfig, files: RunFiles, overwrite: bool
) -> RunOutcome:
    with console.counter(label=path.name) as counter:
        return track(
            path,
            folder,
            settings,
            files=files,
            overwrite=overwrite,
            on_start=lambda info: counter.expect(info.frames_declared),
            on_frame=lambda _frame, _result: counter.add(),
        )


def _tell(console: Console, path: Path, outcome: RunOutcome) -> None:
    counts = outcome.counts
    console.result(f"{path}: {outcome.folder}")
    for line in outcome.summary.lines():
        console.result(f"  {line}")
    console.result(f"  {outcome.summary.frames / outcome.wall_s:.0f} frames/s over {outcome.wall_s:.1f} s")
    if counts.damaged or counts.lost:
        console.warning(f"{path}: {counts.damaged} frames damaged, {counts.lost} lost, of {outcome.summary.frames}")
    for note in outcome.notes:
        console.warning(f"{path}: {note}")
