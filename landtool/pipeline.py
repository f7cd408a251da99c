"""The method, one screen long: frames in, what is known about each of them out."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

from landtool.dehaze.stage import Dehazed, DehazeStage
from landtool.detect.stage import DetectStage
from landtool.tags.finder import TagFinder
from landtool.tags.stage import TagReading, TagStage
from landtool.tracking.platform import PlatformTracker
from landtool.types import Frame, FrameResult, LostFrame

SMALLEST_PX = 16  # of a picture's side: the AprilTag library crashes on two pixels and reads nothing on 12
TOO_SMALL = "the picture is too small to show a tag"
_UNREAD = TagReading((), None, "frame", TOO_SMALL)


def process(
    frames: Iterable[Frame | LostFrame], *, tags: TagStage, tracker: PlatformTracker, dehazer: DehazeStage | None = None
) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    """Yield every frame with its result, in order; memory does not grow with their number.

    A damaged picture is measured like any other, the tracker's gate and `status` guard against what it shows; a lost
    frame lets the track coast. Tags are read in the picture as it is, and where it is hazy and none is read, in the
    dehazed one.
    """
    for frame in frames:
        if isinstance(frame, LostFrame):
            tracks, said = tracker.step(frame.t_ns, None)
            reason = _joined(frame.reason, said)
            yield frame, FrameResult(frame.index, frame.t_ns, frame.file, "damaged", reason, tracks=tracks)
            continue
        began = time.perf_counter()
        air, clear = _through_haze(frame, dehazer)
        start = time.perf_counter()
        small = min(frame.image.shape[:2]) < SMALLEST_PX
        world_T_body = tracker.world_T_body(frame.t_ns)
        reading = _UNREAD if small else tags.read(frame, world_T_body)
        if clear is not frame and not reading.tags and not small:
            reading = tags.read(clear, world_T_body)
        read = time.perf_counter()
        tracks, said = tracker.step(frame.t_ns, reading.pose)
        body_T_pad, world_T_pad = tracker.placed(frame.t_ns, reading.pose)
        tracked = time.perf_counter()
        yield (
            frame,
            FrameResult(
                frame.index,
                frame.t_ns,
                frame.file,
                frame.status,
                _joined(frame.damage, reading.reason, said),
                haze=None if air is None else air.haze,
                dehazed=clear is not frame,
                stage="near",
                search=reading.search,
                tags=reading.tags,
                pose=reading.pose,
                body_T_pad=body_T_pad,
                world_T_pad=world_T_pad,
                tracks=tracks,
                stage_seconds=_dehaze_time(air, start - began) | {"tags": read - start, "track": tracked - read},
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
        began = time.perf_counter()
        air, clear = _through_haze(frame, dehazer)
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
                haze=None if air is None else air.haze,
                dehazed=clear is not frame,
                stage="near" if observed else "far",
                search=boxes.search,
                detections=boxes.detections,
                tags=observed,
                stage_seconds=_dehaze_time(air, start - began)
                | {"detect": detected - start}
                | ({} if found is None else {"tags": read - detected}),
            ),
        )


def _through_haze(frame: Frame, dehazer: DehazeStage | None) -> tuple[Dehazed | None, Frame]:
    """Return what the dehazer says of a frame, and the frame without its haze: itself where that is left alone."""
    if dehazer is None:
        return None, frame
    air = dehazer.see(frame)
    return air, replace(frame, image=air.image) if air.dehazed else frame


def _dehaze_time(air: Dehazed | None, seconds: float) -> dict[str, float]:
    return {} if air is None else {"dehaze": seconds}


def _joined(*reasons: str) -> str:
    return "; ".join(filter(None, reasons))
