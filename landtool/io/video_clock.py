"""The times of a video's pictures, in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

from av.container import InputContainer
from av.packet import Packet
from av.video.stream import VideoStream

from landtool.io.source import SourceReport

NS = 1_000_000_000


def ticks_to_ns(ticks: int, time_base: Fraction) -> int:
    """Ticks of `time_base` seconds each as nanoseconds, rounded half to even, exact before that."""
    return round(ticks * time_base * NS)


class VideoClock:
    """Gives every picture of one pass its time, and notes what had to be derived or runs backwards."""

    def __init__(self, container: InputContainer, stream: VideoStream, report: SourceReport) -> None:
        self.time_base = Fraction(stream.time_base or 1)
        self.report = report
        rate = stream.average_rate
        self.step = round(1 / (rate * self.time_base)) if rate else 0  # ticks from one picture to the next
        # AVI stores no presentation times; what FFmpeg makes up for it is wrong as soon as pictures are reordered.
        self.dated = not (container.format.name == "avi" and stream.codec_context.has_b_frames)
        self.slots: list[int] = []  # decoding times of undated packets that no picture has taken yet
        self.last: int | None = None  # pts given last
        self.end: int | None = None  # end of the last packet in presentation order
        self.disorder = 0

    def packet(self, packet: Packet[VideoStream]) -> int | None:
        """Take in a packet before it is decoded; return its own pts, None where it has none to be trusted."""
        pts = packet.pts if packet.pts is not None else packet.dts
        if packet.is_discard or pts is None:
            return packet.pts
        end = pts + (packet.duration or self.step)
        self.end = end if self.end is None else max(self.end, end)
        if self.dated and packet.pts is not None:
            return packet.pts
        self.slots.append(pts)
        return None

    def t_ns(self, pts: int | None) -> int:
        """Nanoseconds of the next frame in presentation order, from its pts or from what stands in for it."""
        if pts is None:
            pts = self._derived()
        if self.last is not None and pts <= self.last:
            self.disorder += 1
        self.last = pts
        return ticks_to_ns(pts, self.time_base)

    def _derived(self) -> int:
        if self.slots:
            # Pictures come in presentation order, so the smallest decoding time left over is this one's.
            self.report.note("the file has no presentation times for pictures; decoding times stand in, in order")
            pts = min(self.slots)
            self.slots.remove(pts)
            return pts
        self.report.note("pictures without any time were placed one frame after the one before")
        return 0 if self.last is None else self.last + self.step

    def short_of(self, declared_end_s: Fraction | None) -> float | None:
        """Seconds the data ends before the declared end, None when it reaches it within two frames or 0.1 s."""
        if declared_end_s is None or self.end is None:
            return None
        short_s = declared_end_s - self.end * self.time_base
        return float(short_s) if short_s > max(2 * self.step * self.time_base, Fraction(1, 10)) else None

    def note_order(self) -> None:
        """Note times that repeat or step back; they were given out as they are."""
        if self.disorder:
            self.report.note(f"pictures with a time not after the one before, kept as recorded: {self.disorder}")
