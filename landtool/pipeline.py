"""The method, one screen long: frames in, what is known about each of them out."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator

from landtool.detect.stage import DetectStage
from landtool.tags.finder import TagFinder
from landtool.tags.stage import TagReading, TagStage
from landtool.tracking.platform import PlatformTracker
from landtool.types import Frame, FrameResult, LostFrame

SMALLEST_PX = 16  # of a picture's side: the AprilTag library crashes on two pixels and reads nothing on 12
TOO_SMALL = "the picture is too small to show a tag"
_UNREAD = TagReading((), None, "frame", TOO_SMALL)


def process(
    frames: Iterable[Frame | LostFrame], *, tags: TagStage, tracker: PlatformTracker
) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    """Yield every frame with its result, in order; memory does not grow with their number.

    A damaged picture is measured like any other, the tracker's gate and `status` guard against what it shows; a lost
    frame lets the track coast.
    """
    for frame in frames:
        if isinstance(frame, LostFrame):
            tracks, said = tracker.step(frame.t_ns, None)
            reason = _joined(frame.reason, said)
            yield frame, FrameResult(frame.index, frame.t_ns, frame.file, "damaged", reason, tracks=tracks)
            continue
        start = time.perf_counter()
        small = min(frame.image.shape[:2]) < SMALLEST_PX
        reading = _UNREAD if small else tags.read(frame, tracker.world_T_body(frame.t_ns))
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
                stage="near",
                search=reading.search,
                tags=reading.tags,
                pose=reading.pose,
                body_T_pad=body_T_pad,
                world_T_pad=world_T_pad,
                tracks=tracks,
                stage_seconds={"tags": read - start, "track": tracked - read},
            ),
        )


def find(
    frames: Iterable[Frame | LostFrame], *, detector: DetectStage, tags: TagFinder | None
) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    """Yield every frame with its boxes and tags in pixels, in order; without `tags` with its boxes only.

    The detector says where the pad is, the tags are looked for there. `search` is where the detector looked.
    """
    for frame in frames:
        if isinstance(frame, LostFrame):
            yield frame, FrameResult(frame.index, frame.t_ns, frame.file, "damaged", frame.reason)
            continue
        if min(frame.image.shape[:2]) < SMALLEST_PX:
            reason = _joined(frame.damage, TOO_SMALL)
            yield frame, FrameResult(frame.index, frame.t_ns, frame.file, frame.status, reason)
            continue
        start = time.perf_counter()
        boxes = detector.find(frame)
        detected = time.perf_counter()
        found = None if tags is None else tags.find(frame, boxes.pads)
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
                stage="near" if observed else "far",
                search=boxes.search,
                detections=boxes.detections,
                tags=observed,
                stage_seconds={"detect": detected - start} | ({} if found is None else {"tags": read - detected}),
            ),
        )


def _joined(*reasons: str) -> str:
    return "; ".join(filter(None, reasons))
