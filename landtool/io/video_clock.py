"""The times of a video's pictures, in exact arithmetic."""

from __future__ import annotations

import heapq
from fractions import Fraction

from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from landtool.io.source import SourceReport

NS = 1_000_000_000


def ticks_to_ns(ticks: int, time_base: Fraction) -> int:
    """Ticks of `time_base` seconds each as nanoseconds, rounded half to even, exact before that."""
    return round(ticks * time_base * NS)


class VideoClock:
    """Gives every picture of one pass its time, and notes what had to be derived or runs backwards."""

    def __init__(self, time_base: Fraction, rate: Fraction | None, report: SourceReport) -> None:
        self.time_base, self.report = time_base, report
        self.step = round(1 / (rate * time_base)) if rate else 0
        self.undated: list[int] = []  # heap of the dts of packets without a pts
        self.last: int | None = None  # pts given last
        self.end: int | None = None  # end of the last packet in presentation order
        self.disorder = 0

    def packet(self, packet: Packet[VideoStream]) -> None:
        """Take in a packet's times before it is decoded."""
        if packet.pts is not None:
            end = packet.pts + (packet.duration or self.step)
            self.end = end if self.end is None else max(self.end, end)
        elif packet.dts is not None:
            heapq.heappush(self.undated, packet.dts)

    def t_ns(self, frame: VideoFrame) -> int:
        """Nanoseconds of a picture: its pts, or what stands in for it, with a note."""
        pts = frame.pts if frame.pts is not None else self._derived()
        if self.last is not None and pts <= self.last:
            self.disorder += 1
        self.last = pts
        return ticks_to_ns(pts, self.time_base)

    def lost_ns(self, pts: int | None) -> int:
        """Nanoseconds of a frame no picture came of."""
        return ticks_to_ns(self._derived() if pts is None else pts, self.time_base)

    def _derived(self) -> int:
        # Pictures come in presentation order, so the smallest decoding time left over is this one's.
        if self.undated:
            self.report.note("pictures without a presentation time were given their decoding times, in order")
            return heapq.heappop(self.undated)
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
            self.report.note(f"{self.disorder} pictures have a time not after the one before; kept as recorded")
