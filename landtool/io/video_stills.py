"""Single pictures of a video at given times, by seeking, and the times a player knows them by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np
from av.container import InputContainer
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from landtool.io.video_clock import ticks_to_ns
from landtool.io.video_container import open_video, time_base_of, video_stream
from landtool.types import Image

_QUALITY = 72  # of a JPEG: text burnt into the picture stays legible


@dataclass(frozen=True)
class VideoTimes:
    """When a video shows its pictures. t_ns: of each, ascending, on the file's clock. end_ns: the last one's end."""

    t_ns: tuple[int, ...]
    end_ns: int
    width: int
    height: int


def read_times(path: Path) -> VideoTimes:
    """Return a video's times by its index; nothing is decoded.

    Raises InputError when it is no video that can be read, or shows no picture.
    """
    with open_video(path) as container:
        stream = video_stream(container, path)
        base = time_base_of(stream)
        shown = []
        try:
            for packet in container.demux(stream):
                if packet.pts is not None and packet.size and not packet.is_discard:
                    shown.append((packet.pts, packet.duration or 0))
        except av.FFmpegError:  # cut: what there is counts
            pass
        shown.sort()
        last = sum(shown[-1]) if shown else 0
        times = tuple(ticks_to_ns(pts, base) for pts, _ in shown)
        return VideoTimes(times, ticks_to_ns(last, base), stream.width, stream.height)


def read_stills(path: Path, t_ns: Sequence[int], width_px: int) -> list[bytes | None]:
    """Return the pictures shown at the given times as JPEGs `width_px` wide, None where none can be decoded.

    Raises InputError when the file is no video that can be read.
    """
    found: dict[int, bytes | None] = {}
    with open_video(path) as container:
        stream = video_stream(container, path)
        stream.thread_type = "AUTO"  # here a late error does not matter, and time does
        stream.codec_context.thread_count = 0
        base = time_base_of(stream)
        for wanted in sorted(set(t_ns)):
            image = _image_at(container, stream, round(wanted * 1e-9 / base))
            found[wanted] = None if image is None else as_jpeg(image, width_px)
    return [found[wanted] for wanted in t_ns]


def _image_at(container: InputContainer, stream: VideoStream, pts: int) -> Image | None:
    """Return (H, W, 3) BGR of the last picture at or before a time in ticks, None where nothing is decoded."""
    try:
        frame = _frame_at(container, stream, pts)
    except av.FFmpegError:
        return None
    return None if frame is None else np.asarray(frame.to_ndarray(format="bgr24"), dtype=np.uint8)


def _frame_at(container: InputContainer, stream: VideoStream, pts: int) -> VideoFrame | None:
    container.seek(pts, stream=stream, backward=True)
    best: VideoFrame | None = None
    for frame in container.decode(stream):
        if frame.pts is None:
            continue
        if frame.pts > pts:
            return best or frame
        best = frame
        if frame.pts == pts:
            break
    return best


def as_jpeg(image: Image, width_px: int) -> bytes | None:
    """Return a picture (H, W, 3) BGR as a JPEG at most `width_px` wide, None where it cannot be encoded."""
    height, width = image.shape[:2]
    size = width_px, max(1, round(height * width_px / width))
    small = image if width <= width_px else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return np.asarray(data).tobytes() if done else None
