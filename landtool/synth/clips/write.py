"""A clip as files that appear together: the recording, its truth, the drone's odometry, the camera and the pad."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from landtool.errors import UsageError
from landtool.io.atomic import atomic_path
from landtool.io.calibration import camera_yaml
from landtool.io.run_record import installed_versions, sha256_of
from landtool.synth.clips.config import ClipConfig
from landtool.synth.clips.recording import RECORDERS, LogRecorder, VideoRecorder
from landtool.synth.clips.tables import ego_text, truth_text
from landtool.synth.clips.take import FrameTruth, Take, draw_take

FORMAT_VERSION = 1
SIDE_FILES = ("truth.csv", "ego.csv", "camera.yaml", "pad.toml", "manifest.json")
"""What lies beside `<name>.mp4`, as `<name>.truth.csv`."""
# pictures done and pictures in all, called after every picture
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class ClipReport:
    """What was written. frames: pictures; visible: those that show a part of the pad; occluded: those that would."""

    path: Path
    files: tuple[Path, ...]
    frames: int
    visible: int
    occluded: int


def side_files(path: Path) -> dict[str, Path]:
    """Return the files beside a clip by their endings, `SIDE_FILES`."""
    return {ending: path.with_suffix(f".{ending}") for ending in SIDE_FILES}


def write_clip(
    config: ClipConfig, path: Path, *, overwrite: bool = False, report: Progress | None = None
) -> ClipReport:
    """Draw a clip and write it to `path`, .mp4 or .mcap, with the files of `side_files` beside it.

    The same config gives the same bytes. All files appear when everything is written, or none of them.

    Raises UsageError for another ending or a scenario that does not fit its numbers, OutputExistsError before anything
    is drawn when one of the files exists and `overwrite` is false, OutputError when it cannot be written.
    """
    recorder = RECORDERS.get(path.suffix.lower())
    if recorder is None:
        raise UsageError("is no kind of clip", file=path, hint=f"end its name in {' or '.join(RECORDERS)}")
    beside = side_files(path)
    with ExitStack() as files:
        places = {ending: files.enter_context(atomic_path(p, overwrite=overwrite)) for ending, p in beside.items()}
        clip = files.enter_context(atomic_path(path, overwrite=overwrite))
        take = draw_take(config)
        truths = _record(take, recorder, clip, report)
        _write(places["truth.csv"], truth_text(truths, config.fog_beta))
        _write(places["ego.csv"], ego_text(take))
        _write(places["camera.yaml"], camera_yaml(take.camera))
        _write(places["pad.toml"], config.pad.to_toml())
        written = {path.name: clip, **{beside[e].name: p for e, p in places.items() if e != "manifest.json"}}
        _write(places["manifest.json"], _manifest(take, written))
    seen = [truth for truth in truths if truth.visible_fraction > 0.0]
    return ClipReport(path, (path, *beside.values()), len(truths), len(seen), sum(t.occluded for t in truths))


def _record(
    take: Take, recorder: type[VideoRecorder] | type[LogRecorder], path: Path, report: Progress | None
) -> list[FrameTruth]:
    truths: list[FrameTruth] = []
    with recorder(path, take) as file:
        for image, truth in take.frames():
            file.write(image, truth)
            truths.append(truth)
            if report:
                report(len(truths), len(take.times_ns))
    return truths


def _manifest(take: Take, written: dict[str, Path]) -> str:
    """Return what the clip was made of, with a digest of every file."""
    values = {
        "format_version": FORMAT_VERSION,
        "command": "generate clip",
        "seed": take.config.seed,
        "config": take.config.as_values(),
        "versions": installed_versions(),
        "drawn": {
            "carrier": take.body.name,
            "ground": take.scene.ground,
            "weather": take.scene.weather,
            "hidden_s": take.motion.hidden_s,
            "exposure_s": take.exposure_s,
            "readout_s": take.readout_s,
            "airlight": take.scene.still.fog.airlight if take.scene.still.fog else None,
        },
        "frames": len(take.times_ns),
        "sha256": {name: sha256_of(place) for name, place in sorted(written.items())},
    }
    return json.dumps(values, indent=2, allow_nan=False) + "\n"


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
