"""The method, one screen long: frames in, what is known about each of them out."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator

from landtool.tags.stage import TagReading, TagStage
from landtool.tracking.platform import PlatformTracker
from landtool.types import Frame, FrameResult, LostFrame

SMALLEST_PX = 16  # of a picture's side: the AprilTag library crashes on two pixels and reads nothing on 12
_TOO_SMALL = TagReading((), None, "frame", "the picture is too small to show a tag")


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
        reading = _TOO_SMALL if small else tags.read(frame, tracker.world_T_body(frame.t_ns))
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


def _joined(*reasons: str) -> str:
    return "; ".join(filter(None, reasons))
