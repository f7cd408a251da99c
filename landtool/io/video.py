"""Video files, read packet by packet through PyAV, with the container's own times.

One thread decodes. Frame threading was measured on the two-core machines this is meant for: it gains nothing over a
reader that runs ahead (`prefetch`), reports an error some packets late, and loses pictures when it ends on one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import av
import cv2
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter
from av.video.stream import VideoStream

from landtool.io.source import SourceReport
from landtool.io.video_clock import VideoClock
from landtool.io.video_container import (
    describe,
    early_end,
    index_length,
    is_hidden,
    open_video,
    packet_damage,
    packets,
    video_stream,
)
from landtool.types import Frame, Image, LostFrame

OUTPUT_CORRUPT = 1 << 3  # AV_CODEC_FLAG_OUTPUT_CORRUPT
HELD_BACK = 3  # pictures
MAX_REORDER = 32  # packets; H.264 and HEVC allow 16
TURNS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}


class VideoSource:
    """A local video file as a `Source`: every picture of its first video stream, in presentation order.

    Times are the stream's own pts, exact to the nanosecond; a negative or later start is kept. Rotation metadata is
    applied. Colours follow the stream's own matrix and range; where it does not say, FFmpeg's rule holds (BT.601,
    limited). Raises InputError when not one picture can be got.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.report = SourceReport()
        self._passes: list[Generator[Frame | LostFrame, None, None]] = []
        self.info = describe(self.path)

    def __iter__(self) -> Iterator[Frame | LostFrame]:
        self.close()
        self.report = SourceReport(declared=self.info.frames_declared, notes=list(self.info.notes))
        frames = _Pass(self.path, self.report, self.info.rotation_deg).frames()
        self._passes.append(frames)
        return frames

    def close(self) -> None:
        """End the pass under way, if any, and release its file."""
        while self._passes:
            self._passes.pop().close()

    def __enter__(self) -> VideoSource:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass(eq=False)
class _Sent:
    """A packet given to the decoder, and what came of it."""

    number: int
    pts: int | None
    hidden: bool
    error: str = ""
    damage: str = ""
    second_field: bool = False


def _is_past(sent: _Sent, number: int, pts: int | None) -> bool:
    """Tell whether a packet's picture would have come before the given one. Decoders give them in order of pts."""
    if sent.pts is None or pts is None:
        return sent.number < number - (0 if sent.error else MAX_REORDER)
    return sent.pts < pts


def _sent(frame: VideoFrame) -> _Sent | None:
    return frame.opaque if isinstance(frame.opaque, _Sent) else None


def _pts(frame: VideoFrame) -> int | None:
    """Return a picture's own pts; where its packet had none PyAV puts the decoding time, in another order."""
    sent = _sent(frame)
    return frame.pts if sent is None or sent.pts is not None else None


class _Pass:
    """One pass over the file: pairs every picture with its packet, so that what is missing is known by name."""

    def __init__(self, path: Path, report: SourceReport, rotation_deg: int) -> None:
        self.path, self.report, self.rotation_deg = path, report, rotation_deg
        self.packets = 0
        self.index = 0
        self.errors = 0
        self.pending: dict[int, _Sent] = {}
        self.to_bgr = _Converter()

    def frames(self) -> Generator[Frame | LostFrame, None, None]:
        """Yield pictures and losses in presentation order. The file is open only while this runs."""
        with open_video(self.path) as container:
            stream = video_stream(container, self.path)
            self.clock = VideoClock(container, stream, self.report)
            for frame in self._held_back(self._decode(container, stream)):
                yield from self._give(frame)
            yield from self._lost(list(self.pending.values()))
            self._check_end(container, stream)

    def _held_back(self, frames: Iterator[VideoFrame]) -> Iterator[VideoFrame]:
        """Give pictures a few later: one may come after its successor, in some streams by design, else by damage.

        So what comes late is not taken for lost. The order is the decoder's own, but after an error, when it may keep
        a picture back across the gap, it is that of the times.
        """
        held: list[VideoFrame] = []
        for frame in frames:
            held.append(frame)
            if self.errors and all(_pts(other) is not None for other in held):
                held.sort(key=lambda other: _pts(other) or 0)
            if len(held) > HELD_BACK:
                yield held.pop(0)
        yield from held

    def _decode(self, container: InputContainer, stream: VideoStream) -> Iterator[VideoFrame]:
        codec = stream.codec_context
        for packet in packets(container, stream, self.report):
            for frame in self._decode_one(stream, packet):
                yield frame
                # From the first good picture on, take damaged ones too, marked; before it they are pre-roll.
                codec.flags |= OUTPUT_CORRUPT
        for frame in self._flush(stream):
            yield frame

    def _decode_one(self, stream: VideoStream, packet: Packet[VideoStream]) -> list[VideoFrame]:
        self.packets += 1
        if packet.is_discard:
            self.report.skipped += 1
        sent = _Sent(self.packets, self.clock.packet(packet), packet.is_discard or is_hidden(stream, packet))
        sent.damage = packet_damage(stream, packet)
        packet.opaque = sent
        if not packet.is_discard:
            self.pending[sent.number] = sent
        try:
            frames = stream.codec_context.decode(packet)
        except av.FFmpegError as error:
            self.errors += 1
            sent.error = f"its data cannot be decoded ({error.strerror})"
            return []
        return [self._matched(frame) for frame in frames]

    def _flush(self, stream: VideoStream) -> list[VideoFrame]:
        try:
            return [self._matched(frame) for frame in stream.codec_context.decode(None)]
        except av.FFmpegError as error:
            self.report.note(f"the decoder could not finish its last pictures ({error.strerror})")
            return []

    def _matched(self, frame: VideoFrame) -> VideoFrame:
        sent = _sent(frame)
        if sent is not None:
            self.pending.pop(sent.number, None)
            follower = self.pending.get(sent.number + 1)
            if follower is not None and frame.interlaced_frame:
                follower.second_field = True
        return frame

    def _give(self, frame: VideoFrame) -> Iterator[Frame | LostFrame]:
        sent, pts = _sent(frame), _pts(frame)
        if sent is not None:
            done = [p for p in self.pending.values() if _is_past(p, sent.number, pts)]
            yield from self._lost(done)
        damage = sent.damage if sent is not None else ""
        if frame.is_corrupt:
            damage = damage or "the decoder found damage and filled it in"
        t_ns = self.clock.t_ns(pts)
        image = self.to_bgr(frame, self.rotation_deg, self.report)
        self.report.decoded += 1
        self.report.damaged += bool(damage)
        yield Frame(self._next_index(), t_ns, image, damage=damage)

    def _lost(self, done: list[_Sent]) -> Iterator[LostFrame]:
        for sent in sorted(done, key=lambda p: (p.pts or 0, p.number)):
            del self.pending[sent.number]
            preroll = self.report.decoded == 0 and not (sent.error or sent.damage)
            if not sent.error and (sent.hidden or sent.second_field or preroll):
                self.report.skipped += 1
                continue
            self.report.lost += 1
            reason = sent.error or sent.damage or "no picture came of its data"
            yield LostFrame(self._next_index(), self.clock.t_ns(sent.pts), reason)

    def _next_index(self) -> int:
        self.index += 1
        return self.index - 1

    def _check_end(self, container: InputContainer, stream: VideoStream) -> None:
        """Note a file that ends before its container says it should."""
        indexed = index_length(container, stream)
        if indexed:  # an edit list may leave out frames the container counts
            self.report.skipped += max(0, stream.frames - indexed)
        end = early_end(self.path, container, stream, self.clock, self.packets)
        if end:
            self.report.truncated = True
            self.report.note(end)
        if self.report.damaged or self.report.lost:
            self.report.note("pictures after damage may show its traces until the next key frame")
        self.clock.note_order()


class _Converter:
    """Pictures of any pixel format to upright (H, W, 3) BGR uint8."""

    def __init__(self) -> None:
        self.reformatter = VideoReformatter()
        self.size: tuple[int, int] | None = None

    def __call__(self, frame: VideoFrame, rotation_deg: int, report: SourceReport) -> Image:
        if self.size not in (None, (frame.width, frame.height)):
            report.note(f"the picture size changes to {frame.width}x{frame.height} on the way")
        self.size = (frame.width, frame.height)
        array = self.reformatter.reformat(frame, format="bgr24", threads=1).to_ndarray()
        image: Image = np.ascontiguousarray(array)
        return np.asarray(cv2.rotate(image, TURNS[rotation_deg]), np.uint8) if rotation_deg else image
