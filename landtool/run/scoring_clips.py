"""A recording with truth as an evaluation sees it: followed as `landtool track` does, and shown to the network."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from landtool.camera import Camera
from landtool.config import EvalConfig, TrackConfig
from landtool.detect.detector import Detector
from landtool.evaluate.clip_truth import ClipTruth, read_clip_truth
from landtool.evaluate.dataset import Clip
from landtool.evaluate.detection_metrics import ScoredPicture
from landtool.io.run_record import StageTime
from landtool.io.source import open_source
from landtool.pad import PadSpec
from landtool.run.looking import boxes
from landtool.run.tracking import read_files, track
from landtool.types import Frame, FrameResult, LostFrame

OnPicture = Callable[[], None]
RUNS = "runs"


@dataclass(frozen=True, eq=False)
class SeenClip:
    """What was seen in a recording.

    results: of every frame, as `landtool track` has them; none where only the network was asked. camera, pad: with
    which it was followed. timings: of the run. pictures: frames with their boxes. looked: the network's own results.
    notes: what the run had to say.
    """

    name: str
    truth: ClipTruth
    results: tuple[FrameResult, ...] = ()
    camera: Camera | None = None
    pad: PadSpec | None = None
    timings: Mapping[str, StageTime] | None = None
    wall_s: float = 0.0
    pictures: tuple[ScoredPicture, ...] = ()
    looked: tuple[FrameResult, ...] = ()
    notes: tuple[str, ...] = ()


def see_clip(
    clip: Clip, detector: Detector, config: TrackConfig, evaluation: EvalConfig, runs: Path, *, on_picture: OnPicture
) -> SeenClip:
    """Follow a clip into the folder runs/<its name>, and show its frames to the network, as the stages need it.

    Raises UsageError and InputError as `track` and the truth's reader do.
    """
    seen = SeenClip(clip.name, read_clip_truth(clip.truth))
    settings = _of_clip(clip, config, evaluation)
    if "pose" in evaluation.stages or "track" in evaluation.stages:
        seen = _followed(seen, clip, settings, runs / clip.name, on_picture)
    if "detection" in evaluation.stages:
        pad = seen.pad or read_files(settings).pad
        seen = _looked_at(seen, clip, detector, settings, pad, evaluation.every, on_picture)
    return seen


def _of_clip(clip: Clip, config: TrackConfig, evaluation: EvalConfig) -> TrackConfig:
    """Return the settings with the files beside the clip put in; what lies beside it is its own and wins."""
    changes: dict[str, object] = {"save": ("csv", "plot", *(("video",) if "video" in evaluation.save else ()))}
    if clip.camera is not None:
        changes |= {"camera": clip.camera, "camera_name": None, "hfov_deg": None}
    if clip.pad is not None:
        changes |= {"pad": clip.pad, "diameter_m": None}
    if not evaluation.ego:
        changes["ego"] = None
    elif clip.ego is not None:
        changes["ego"] = str(clip.ego)
    return replace(config, **changes)  # type: ignore[arg-type]


def _followed(seen: SeenClip, clip: Clip, config: TrackConfig, folder: Path, on_picture: OnPicture) -> SeenClip:
    results: list[FrameResult] = []

    def keep(_frame: Frame | LostFrame, result: FrameResult) -> None:
        results.append(result)
        on_picture()

    folder.parent.mkdir(parents=True, exist_ok=True)
    files = read_files(config)
    outcome = track(clip.path, folder, config, files=files, on_frame=keep)
    return replace(
        seen,
        results=tuple(results),
        camera=outcome.camera,
        pad=files.pad,
        timings=outcome.timings,
        wall_s=outcome.wall_s,
        notes=tuple(f"{clip.name}: {note}" for note in outcome.notes),
    )


def _looked_at(
    seen: SeenClip,
    clip: Clip,
    detector: Detector,
    config: TrackConfig,
    pad: PadSpec,
    every: int,
    on_picture: OnPicture,
) -> SeenClip:
    pictures, looked = [], []
    with open_source(clip.path, topic=config.topic) as source:
        for frame, result in boxes(_every(iter(source), every), detector, pad, config):
            on_picture()
            if isinstance(frame, LostFrame) or frame.index not in seen.truth:
                continue
            height, width = frame.image.shape[:2]
            second = frame.index if frame.t_ns is None else frame.t_ns // 1_000_000_000
            truth = seen.truth.labelled(frame.index, clip.path, width, height)
            facts = seen.truth.facts(frame.index)
            unit = (clip.name, second)
            pictures.append(
                ScoredPicture(clip.name, clip.path.name, frame.index, unit, truth, result.detections, facts)
            )
            looked.append(result)
    return replace(seen, pictures=tuple(pictures), looked=tuple(looked))


def _every(frames: Iterator[Frame | LostFrame], step: int) -> Iterator[Frame | LostFrame]:
    return islice(frames, 0, None, step)
