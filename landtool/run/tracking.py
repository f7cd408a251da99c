"""One recording through the whole method: poses, track, prediction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from landtool.camera import Camera
from landtool.config import AUTO_TONE, BOUNDS, TrackConfig
from landtool.detect.stage import BoxDetector, DetectStage
from landtool.draw import Overlay
from landtool.errors import InputError, UsageError
from landtool.geometry import Pose
from landtool.io.calibration import match_camera, read_camera
from landtool.io.local import local_file, nearest
from landtool.io.poses import STRAIGHT_DOWN, EgoPoses, read_ego, read_mount
from landtool.io.source import SourceInfo
from landtool.landing.finder import PadFinder
from landtool.landing.measure import PadMeasurer
from landtool.landing.paper import PaperFinder
from landtool.landing.stages import StageSwitch, readable_altitude_m
from landtool.landing.tags import TagLook
from landtool.pad import PadSpec
from landtool.pipeline import SMALLEST_PX, Finder, process
from landtool.run.detection import load_detector
from landtool.run.haze import dehaze_stage
from landtool.run.recording import OnFrame, RunOutcome, RunParts, RunRequest, run_recording
from landtool.run.smoothing import add_smoothed
from landtool.run.tags import tag_reader
from landtool.summary import Summary
from landtool.target.tone_gauge import ToneGauge
from landtool.tone import Tone, parse_tone
from landtool.tracking.ego import EgoTrajectory
from landtool.tracking.platform import PlatformTracker

if TYPE_CHECKING:
    from landtool.detect.detector import Detector

_SAME_CAMERA_PX = 0.5


@dataclass(frozen=True)
class RunFiles:
    """What the files that settings name hold. paths: all of them.

    camera: None where no file is named. ego: None too where the name is that of a topic in the log. detector: None for
    a pad without the ring the network looks for; model: its file.
    """

    paths: tuple[Path, ...]
    camera: Camera | None
    pad: PadSpec
    body_T_camera: Pose
    ego: EgoTrajectory | None
    detector: Detector | None
    model: Path | None


@dataclass(frozen=True)
class _Setup:
    """What a run needs, resolved from its settings, their files and its input."""

    camera: Camera
    pad: PadSpec
    body_T_camera: Pose
    ego: EgoTrajectory | None
    detector: Detector | None
    notes: list[str] = field(default_factory=list)


def read_files(config: TrackConfig) -> RunFiles:
    """Read the files the settings name; it takes no recording, so what is wrong with them is said at once.

    Raises UsageError for a file that cannot be opened and a pad without tags, InputError as the files' readers do.
    """
    ego = Path(config.ego) if config.ego and Path(config.ego).exists() else None
    paths = tuple(local_file(path) for path in (config.camera, config.pad, config.mount, ego) if path is not None)
    pad = pad_of(config)
    if not pad.tags:
        raise UsageError("the pad has no tag to read", file=config.pad, hint="add [[tags]] to it")
    return RunFiles(
        paths,
        read_camera(config.camera, config.camera_name) if config.camera else None,
        pad,
        read_mount(config.mount) if config.mount else STRAIGHT_DOWN,
        EgoTrajectory(read_ego(ego)) if ego else None,
        *((None, None) if pad.ring is None else load_detector(config.detector)),
    )


def pad_of(config: TrackConfig) -> PadSpec:
    """Return the pad that settings name, pad v1 where they name none.

    Raises UsageError and InputError as its reader does, InputError for an impossible size.
    """
    pad = PadSpec.read(config.pad) if config.pad else PadSpec()
    pad = pad if config.diameter_m is None else pad.scaled(config.diameter_m)
    low, high = BOUNDS["diameter_m"]
    if not low <= pad.diameter_m <= high:
        hint = f"it is in metres, {low:g} to {high:g}"
        raise InputError(f"diameter_m = {pad.diameter_m:g} is impossible", file=config.pad, hint=hint)
    return pad


def track(
    path: Path,
    folder: Path,
    config: TrackConfig,
    *,
    files: RunFiles | None = None,
    overwrite: bool = False,
    on_start: Callable[[SourceInfo], None] | None = None,
    on_frame: OnFrame | None = None,
) -> RunOutcome:
    """Track the pad through one recording and write what was found into `folder`, whole or not at all.

    files: what `read_files` returned for this config, where several recordings share it.
    Raises UsageError, InputError and OutputError as the parts do.
    """
    read = files or read_files(config)

    def prepare(info: SourceInfo) -> RunParts:
        setup = _resolve(config, read, info)
        tracker = PlatformTracker(config.tracker, setup.body_T_camera, setup.ego, record=config.smooth)
        switch = StageSwitch(config.switch_altitude_m or readable_altitude_m(setup.camera, setup.pad))
        gauge = ToneGauge(setup.pad, setup.camera, "srgb") if config.tags.tone == AUTO_TONE else None
        nis_dof = 4 if config.tracker.measurement == "paper" else 2
        return RunParts(
            lambda frames: process(
                frames,
                finder=make_finder(config, setup.camera, setup.pad, setup.body_T_camera, setup.detector, gauge),
                switch=switch,
                tracker=tracker,
                body_T_camera=setup.body_T_camera,
                dehazer=dehaze_stage(config.dehaze, config.dehazer),
            ),
            Summary(
                setup.camera,
                setup.pad,
                switch_altitude_m=switch.altitude_m,
                nis_dof=nis_dof,
                tone=gauge.estimate if gauge is not None else lambda: None,
            ),
            Overlay(setup.camera, setup.pad),
            camera_T_reference=lambda result: tracker.camera_T_reference(result.t_ns),
            camera=setup.camera,
            pad=setup.pad,
            body_T_camera=setup.body_T_camera,
            nis_dof=nis_dof,
            finish=lambda made: add_smoothed(made, tracker.smoothed()) if config.smooth else None,
            notes=tuple(setup.notes),
        )

    request = RunRequest("track", path, folder, config, read.paths, read.model, overwrite, on_start, on_frame)
    return run_recording(request, prepare)


def _resolve(config: TrackConfig, files: RunFiles, info: SourceInfo) -> _Setup:
    if min(info.width, info.height) < SMALLEST_PX:
        reason = f"its pictures of {info.width}x{info.height} pixels are too small to show a tag"
        raise InputError(reason, file=info.path, hint="give the original recording")
    notes: list[str] = []
    if files.pad.ring is None:
        notes.append("the pad has no ring: it is measured by its tags alone, and found by nothing but them")
    camera = _camera(config, files.camera, info, notes)
    ego = files.ego or _ego_topic(config.ego, info)
    idle = [name for name, given in (("--ego", ego is not None), ("--smooth", config.smooth)) if given]
    if idle and not info.has_clock:
        notes.append(f"without a clock there is no track, and {' and '.join(idle)} did nothing; give it with --fps")
    return _Setup(camera, files.pad, files.body_T_camera, ego, files.detector, notes)


def _camera(config: TrackConfig, given: Camera | None, info: SourceInfo, notes: list[str]) -> Camera:
    """Return the camera of the pictures as they are given out: matched in size, turned as they were."""
    camera = given or info.camera
    if config.hfov_deg is not None:
        camera = Camera.from_hfov(info.width, info.height, config.hfov_deg)
    elif camera is None:
        hint = "pass --camera FILE, or --hfov DEG if nobody has measured it"
        raise UsageError("no camera calibration", file=info.path, hint=hint)
    if given is not None and info.camera is not None and _differ(given, info.camera):
        notes.append("the recording has a calibration of its own, which differs from the one given and is not used")
    if camera.assumed:
        notes.append(f"camera assumed: {camera.assumed}")
    if config.hfov_deg is not None:
        return camera
    try:
        return match_camera(_turned(camera, info, notes), info.width, info.height, scale=config.scale_intrinsics)
    except InputError as error:
        raise InputError(error.reason, file=config.camera or info.path, hint=error.hint) from error


def _differ(a: Camera, b: Camera) -> bool:
    """Whether two calibrations put anything more than half a pixel apart."""
    size = (a.width, a.height)
    if size != (b.width, b.height):
        return True
    edges = np.array([[0.0, 0.0], [a.width / 2.0, a.height / 2.0], [a.width - 1.0, a.height - 1.0]])
    rays = np.column_stack([a.normalize(edges), np.ones(len(edges))])
    apart = np.abs(b.project(rays) - edges)
    return not bool((apart < _SAME_CAMERA_PX).all())


def _turned(camera: Camera, info: SourceInfo, notes: list[str]) -> Camera:
    turned = camera.of_turned(info.quarter_turns, info.width, info.height)
    if info.quarter_turns and turned is camera:
        notes.append("the calibration has the size of the turned pictures and is taken as theirs")
    elif info.quarter_turns:
        notes.append(f"the pictures are turned by {info.rotation_deg} degrees, the intrinsics with them")
    return turned


def _ego_topic(topic: str | None, info: SourceInfo) -> EgoTrajectory | None:
    """Read the drone's own poses from a topic of the log; None when no topic is named."""
    if topic is None:
        return None
    if info.kind != "mcap":
        hint = f"{nearest(Path(topic))} (topics are in MCAP logs only)"
        raise UsageError("does not exist", file=topic, hint=hint)
    from landtool.io.mcap_poses import read_poses

    stamped = read_poses(info.path, topic)
    stamps = np.array([t_ns for t_ns, _ in stamped], dtype=np.int64)
    places = np.array([pose.translation for _, pose in stamped])
    return EgoTrajectory(EgoPoses(stamps, places, np.array([pose.quaternion_wxyz for _, pose in stamped])))


def make_finder(
    config: TrackConfig,
    camera: Camera,
    pad: PadSpec,
    body_T_camera: Pose,
    detector: BoxDetector | None,
    gauge: ToneGauge | None,
) -> Finder:
    """Return what finds and measures pads as the settings say; gauge: of the tone curve, None where it is known."""
    tone: Tone = "srgb" if gauge is not None or config.tags.tone == AUTO_TONE else parse_tone(config.tags.tone)
    measurer = PadMeasurer(camera, pad, tone)
    tags = TagLook(tag_reader(config.tags, pad), camera, pad)
    stage = None if detector is None else DetectStage(detector, regions=config.policy == "fuse", tone=tone)
    if config.policy == "paper":
        return PaperFinder(measurer, tags, stage, body_T_camera)
    return PadFinder(measurer, tags, stage, body_T_camera, everywhere=config.tags.which == "all", gauge=gauge)
