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
from landtool.evaluate.clock import check_clock
from landtool.evaluate.dataset import Clip
from landtool.evaluate.detection_metrics import ScoredPicture
from landtool.evaluate.pose_errors import unit
from landtool.geometry import Pose
from landtool.io.run_record import StageTime
from landtool.io.source import open_source
from landtool.pad import PadSpec
from landtool.run.looking import boxes
from landtool.run.tracking import RunFiles, pad_of, read_files, track
from landtool.types import Frame, FrameResult, LostFrame

OnPicture = Callable[[], None]


@dataclass(frozen=True, eq=False)
class Followed:
    """A recording as `landtool track` followed it: results of every frame, with what it was followed, how long it took.

    timings: by stage.
    """

    results: tuple[FrameResult, ...]
    camera: Camera
    pad: PadSpec
    body_T_camera: Pose
    timings: Mapping[str, StageTime]
    wall_s: float


@dataclass(frozen=True, eq=False)
class SeenClip:
    """What was seen in a recording.

    followed: None where only the network was asked. pictures: frames with their boxes, those whose truth is known.
    looked: the network's own results. notes: what is to be said of it. lossy: it could not be decoded whole.
    """

    name: str
    truth: ClipTruth
    followed: Followed | None = None
    pictures: tuple[ScoredPicture, ...] = ()
    looked: tuple[FrameResult, ...] = ()
    notes: tuple[str, ...] = ()
    lossy: bool = False


def see_clip(
    clip: Clip, detector: Detector, config: TrackConfig, evaluation: EvalConfig, runs: Path, *, on_picture: OnPicture
) -> SeenClip:
    """Follow a clip into the folder runs/<its name>, and show its frames to the network, as the stages need it.

    Raises UsageError and InputError as `track` and the truth's reader do.
    """
    settings = _of_clip(clip, config, evaluation)
    seen = SeenClip(clip.name, read_clip_truth(clip.truth))
    is_asked = "pose" in evaluation.stages or "track" in evaluation.stages
    if is_asked and seen.truth.has_poses:  # of boxes alone no calibration is needed
        files = read_files(settings)
        seen = _followed(seen, clip, settings, files, runs / clip.name, on_picture)
    if "detection" in evaluation.stages and seen.truth.has_boxes:
        seen = _looked_at(seen, clip, detector, settings, evaluation.every, on_picture)
    return replace(seen, notes=(*seen.notes, *_unmatched(seen, evaluation.every)))


def _unmatched(seen: SeenClip, every: int) -> Iterator[str]:
    """Yield what recording and truth do not have of each other."""
    results = seen.followed.results if seen.followed is not None else seen.looked
    check = check_clock(seen.name, results, seen.truth)
    if check.frames_without_truth:
        yield f"{seen.name}: frames without truth: {check.frames_without_truth} of {check.frames}"
    if check.truth_without_frames and (seen.followed is not None or (seen.looked and every == 1)):
        count = f"{check.truth_without_frames} of {len(seen.truth.frames)}"
        yield f"{seen.name}: frames of the truth that the recording does not have: {count}"


def _of_clip(clip: Clip, config: TrackConfig, evaluation: EvalConfig) -> TrackConfig:
    """Return the settings with the files beside the clip put in; what lies beside it is its own and wins."""
    tables = ("csv", "plot") if "csv" in evaluation.save else ()
    changes: dict[str, object] = {"save": (*tables, *(("video",) if "video" in evaluation.save else ()))}
    if not clip.path.is_dir():  # a video has its own clock
        changes["fps"] = None
    if clip.path.suffix.lower() != ".mcap":
        changes["topic"] = None
    if clip.camera is not None:
        changes |= {"camera": clip.camera, "camera_name": None, "hfov_deg": None}
    if clip.pad is not None:
        changes |= {"pad": clip.pad, "diameter_m": None}
    if not evaluation.ego:
        changes["ego"] = None
    elif clip.ego is not None:
        changes["ego"] = str(clip.ego)
    return replace(config, **changes)  # type: ignore[arg-type]


def _followed(
    seen: SeenClip, clip: Clip, config: TrackConfig, files: RunFiles, folder: Path, on_picture: OnPicture
) -> SeenClip:
    results: list[FrameResult] = []

    def keep(_frame: Frame | LostFrame, result: FrameResult) -> None:
        results.append(result)
        on_picture()

    folder.parent.mkdir(parents=True, exist_ok=True)
    outcome = track(clip.path, folder, config, files=files, on_frame=keep)
    assert outcome.camera is not None, "a track has a camera"
    mount = files.body_T_camera
    followed = Followed(tuple(results), outcome.camera, files.pad, mount, outcome.timings, outcome.wall_s)
    notes = tuple(f"{clip.name}: {note}" for note in outcome.notes)
    return replace(seen, followed=followed, notes=notes, lossy=outcome.exit_code != 0)


def _looked_at(
    seen: SeenClip,
    clip: Clip,
    detector: Detector,
    config: TrackConfig,
    every: int,
    on_picture: OnPicture,
) -> SeenClip:
    pictures, looked = [], []
    pad = pad_of(config)
    with open_source(clip.path, topic=config.topic, fps=config.fps) as source:
        for frame, result in boxes(_every(iter(source), every), detector, pad, config):
            on_picture()
            looked.append(result)
            true = seen.truth.at(frame.index, frame.t_ns)
            if isinstance(frame, LostFrame) or true is None:
                continue
            height, width = frame.image.shape[:2]
            labelled = seen.truth.labelled(frame.index, clip.path, width, height, frame.t_ns)
            same = unit(clip.name, frame.index, frame.t_ns)
            seen_there = clip.name, clip.path.name, frame.index, same, labelled, result.detections, true.facts
            pictures.append(ScoredPicture(*seen_there))
    said = (f"{clip.name}: {note}" for note in (*source.info.notes, *source.report.notes))
    notes = tuple(dict.fromkeys((*seen.notes, *said)))
    lossy = seen.lossy or not source.report.complete
    return replace(seen, pictures=tuple(pictures), looked=tuple(looked), notes=notes, lossy=lossy)


def _every(frames: Iterator[Frame | LostFrame], step: int) -> Iterator[Frame | LostFrame]:
    return islice(frames, 0, None, step)
