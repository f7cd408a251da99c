"""The method, one screen long: frames in, what is known about each of them out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Protocol

from landtool.dehaze.stage import Dehazed, DehazeStage
from landtool.detect.stage import DetectStage
from landtool.geometry import Pose
from landtool.landing.found import Found
from landtool.landing.main_track import MainTrack
from landtool.landing.stages import StageSwitch, altitude_m
from landtool.tags.finder import TagFinder
from landtool.tracking.platform import ExpectedPad, PlatformTracker
from landtool.types import Frame, FrameResult, LostFrame, Stage

SMALLEST_PX = 16  # of a picture's side: the AprilTag library crashes on two pixels and reads nothing on 12
TOO_SMALL = "the picture is too small to show a tag"


class Finder(Protocol):
    """What finds and measures the pads of a frame: `landtool.landing.finder.PadFinder`, or the paper's way."""

    def find(
        self,
        frame: Frame,
        clear: Callable[[], Frame],
        stage: Stage,
        expected: Sequence[ExpectedPad],
        world_T_body: Pose | None,
    ) -> Found:
        """Look at one frame. clear: gives it without its haze. expected: where the tracks' pads should be."""
        ...

    def keep(self, found: Found, taken: Sequence[int | None], living: Sequence[int]) -> None:
        """Take in which track each found pad went to, None for none, and which tracks live."""
        ...


def process(
    frames: Iterable[Frame | LostFrame],
    *,
    finder: Finder,
    switch: StageSwitch,
    tracker: PlatformTracker,
    body_T_camera: Pose,
    dehazer: DehazeStage | None = None,
) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    """Yield every frame with its result, in order; memory does not grow with their number.

    What the tracks expect says how high the drone is, the height which stage the frame belongs to, and both where is
    looked for what; the poses that are found go into the tracks. A damaged picture is measured like any other, the
    tracker's gate and `status` guard against what it shows; a lost frame lets the tracks coast.
    """
    main = MainTrack()
    for frame in frames:
        if isinstance(frame, LostFrame):
            stepped = tracker.step(frame.t_ns, ())
            reason, world_T_body = _joined(frame.reason, stepped.said), tracker.world_T_body(frame.t_ns)
            lost = FrameResult(frame.index, frame.t_ns, frame.file, "damaged", reason, world_T_body=world_T_body)
            yield frame, replace(lost, tracks=stepped.tracks)
            continue
        view = _View(frame, dehazer)
        world_T_body, expected = tracker.world_T_body(frame.t_ns), tracker.expected(frame.t_ns)
        height_m = _height_m(expected, body_T_camera, world_T_body)
        stage = switch.at(height_m)
        if min(frame.image.shape[:2]) < SMALLEST_PX:
            found = Found(search="frame", reason=TOO_SMALL)
        else:
            found = finder.find(frame, view.clear, stage, expected, world_T_body)
        looked = time.perf_counter()
        poses = tuple(pad.pose for pad in found.pads)
        stepped = tracker.step(frame.t_ns, poses)
        finder.keep(found, stepped.taken, tuple(track.track_id for track in stepped.tracks))
        looked_for = tuple(pad.track_id for pad in found.pads)
        pose, others = main.of(poses, looked_for, stepped.taken, stepped.tracks)
        body_T_pad, world_T_pad = tracker.placed(frame.t_ns, pose)
        changed = switch.note
        if pose is not None:
            height_m = altitude_m(body_T_camera, pose.camera_T_pad, world_T_body)
            if not expected:  # nothing told the height before
                stage = switch.at(height_m)
                changed = switch.note
        seconds = view.seconds | dict(found.seconds)
        tracked = time.perf_counter() - looked
        yield (
            frame,
            FrameResult(
                frame.index,
                frame.t_ns,
                frame.file,
                frame.status,
                _joined(frame.damage, changed, found.reason, stepped.said),
                haze=view.haze,
                dehazed=view.was_dehazed,
                stage=stage,
                search=found.search,
                detections=found.detections,
                tags=found.tags,
                pose=pose,
                other_poses=others,
                altitude_m=height_m,
                world_T_body=world_T_body,
                body_T_pad=body_T_pad,
                world_T_pad=world_T_pad,
                tracks=stepped.tracks,
                stage_seconds=seconds | {"track": tracked},
            ),
        )


def find(
    frames: Iterable[Frame | LostFrame],
    *,
    detector: DetectStage,
    tags: TagFinder | None,
    dehazer: DehazeStage | None = None,
) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    """Yield every frame with its boxes and tags in pixels, in order; without `tags` with its boxes only.

    The detector says where the pad is, the tags are looked for there. `search` is where the detector looked. It sees
    the dehazed picture, and where that shows nothing the picture as it is; with the tags it is the other way round.
    """
    for frame in frames:
        if isinstance(frame, LostFrame):
            yield frame, FrameResult(frame.index, frame.t_ns, frame.file, "damaged", frame.reason)
            continue
        if min(frame.image.shape[:2]) < SMALLEST_PX:
            reason = _joined(frame.damage, TOO_SMALL)
            yield frame, FrameResult(frame.index, frame.t_ns, frame.file, frame.status, reason)
            continue
        view = _View(frame, dehazer)
        clear = view.clear()
        start = time.perf_counter()
        boxes = detector.find(clear)
        if clear is not frame and not boxes.detections:
            boxes = detector.find(frame)
        detected = time.perf_counter()
        found = None if tags is None else tags.find(frame, boxes.pads)
        if tags is not None and found is not None and not found.tags and clear is not frame:
            found = tags.find(clear, boxes.pads)
        read = time.perf_counter()
        observed = () if found is None else found.tags
        yield (
            frame,
            FrameResult(
                frame.index,
                frame.t_ns,
                frame.file,
                frame.status,
                _joined(
                    frame.damage,
                    "" if boxes.detections else "no box",
                    "" if found is None or observed else "no tag read",
                ),
                haze=view.haze,
                dehazed=view.was_dehazed,
                stage="near" if observed else "far",
                search=boxes.search,
                detections=boxes.detections,
                tags=observed,
                stage_seconds=view.seconds
                | {"detect": detected - start}
                | ({} if found is None else {"tags": read - detected}),
            ),
        )


class _View:
    """A frame as it is and, where it is hazy, without its haze, which is taken off when somebody asks for it."""

    def __init__(self, frame: Frame, dehazer: DehazeStage | None) -> None:
        began = time.perf_counter()
        self._frame = frame
        self._clear: Frame | None = None
        self._air: Dehazed | None = None if dehazer is None else dehazer.see(frame)
        self._spent = time.perf_counter() - began

    def clear(self) -> Frame:
        """Return the frame without its haze; itself where it is left alone."""
        if self._air is None or not self._air.dehazed:
            return self._frame
        if self._clear is None:
            began = time.perf_counter()
            self._clear = replace(self._frame, image=self._air.image)
            self._spent += time.perf_counter() - began
        return self._clear

    @property
    def haze(self) -> float | None:
        """The haze that is guessed, None where nobody asked."""
        return None if self._air is None else self._air.haze

    @property
    def was_dehazed(self) -> bool:
        """Whether somebody looked at the dehazed picture."""
        return self._clear is not None

    @property
    def seconds(self) -> dict[str, float]:
        """The time dehazing took, as a stage."""
        return {} if self._air is None else {"dehaze": self._spent}


def _height_m(expected: Sequence[ExpectedPad], body_T_camera: Pose, world_T_body: Pose | None) -> float | None:
    """Return the drone's height over the first expected pad; before there is one, over the world's ground."""
    if expected:
        return altitude_m(body_T_camera, expected[0].camera_T_pad, world_T_body)
    return None if world_T_body is None else float(world_T_body.translation[2])


def _joined(*reasons: str) -> str:
    return "; ".join(dict.fromkeys(filter(None, reasons)))
