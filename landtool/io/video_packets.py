"""What a video's packets tell without decoding a picture: container, times, damage that shows from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from landtool.io.source import SourceReport
from landtool.io.video_clock import VideoClock, ticks_to_ns
from landtool.io.video_container import early_end, is_hidden, open_video, packet_damage, packets, video_stream


@dataclass(frozen=True)
class PacketSurvey:
    """A video stream as its packets show it.

    container: the format's full name. profile: the codec's, empty when it has none. times_ns: of the packets that
    become pictures. in_order: whether these are in the recorded order, so that steps back can be seen; where pictures
    are stored reordered they were sorted, and only decoding tells. damaged: packets seen to be damaged.
    key_frames: pictures decoding can begin at. truncated: the data ends early. notes: one sentence each.
    """

    container: str
    profile: str
    pixel_format: str
    times_ns: tuple[int, ...]
    in_order: bool
    damaged: int
    key_frames: int
    truncated: bool
    notes: tuple[str, ...]


def survey_packets(path: Path) -> PacketSurvey:
    """Read all packets of a video's first stream. Raises InputError when the file is no video."""
    report = SourceReport()
    with open_video(path) as container:
        stream = video_stream(container, path)
        clock = VideoClock(container, stream, report)
        count = damaged = key_frames = 0
        ticks: list[int] = []
        for packet in packets(container, stream, report):
            count += 1
            pts = clock.packet(packet)
            if packet.is_discard or is_hidden(stream, packet):
                continue
            damaged += bool(packet_damage(stream, packet))
            key_frames += packet.is_keyframe
            if pts is not None:
                ticks.append(pts)
        end = early_end(path, container, stream, clock, count)
        in_order = not stream.codec_context.has_b_frames
        return PacketSurvey(
            container=container.format.long_name,
            profile=stream.codec_context.profile or "",
            pixel_format=stream.codec_context.pix_fmt or "",
            times_ns=_times_ns(clock, ticks, in_order),
            in_order=in_order,
            damaged=damaged,
            key_frames=key_frames,
            truncated=report.truncated or bool(end),
            notes=tuple(note for note in (*report.notes, end) if note),
        )


def _times_ns(clock: VideoClock, ticks: Sequence[int], in_order: bool) -> tuple[int, ...]:
    if clock.slots or not in_order:  # decoding times stand in for missing ones in order of size
        ticks = sorted([*ticks, *clock.slots])
    return tuple(ticks_to_ns(tick, clock.time_base) for tick in ticks)
