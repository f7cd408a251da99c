"""A video file's container: opened, described, and read packet by packet through PyAV."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from landtool.errors import InputError
from landtool.io.container_end import has_box, is_cut
from landtool.io.damage import is_zeroed
from landtool.io.source import SourceInfo, SourceReport
from landtool.io.video_clock import VideoClock, ticks_to_ns

# Containers with times of their own that live in one local file: no playlists, devices, or bare streams.
FORMATS = "mov,matroska,avi,mpegts,mpeg,ogg,flv,asf,mxf,nut,gif,ivf"
OPTIONS = {"protocol_whitelist": "file", "format_whitelist": FORMATS}
HDR_TRANSFERS = {16: "PQ", 18: "HLG"}
# Codecs whose data is_zeroed can judge; others pad, or store plain values
ZERO_FREE = ("h264", "hevc", "vp8", "vp9", "mjpeg")


def open_video(path: Path) -> InputContainer:
    """Open a local video file, and nothing that is not one. Raises InputError that says what is wrong with it."""
    try:
        return av.open(f"file:{path.absolute()}", "r", options=OPTIONS)
    except (av.FFmpegError, UnicodeEncodeError) as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: Exception) -> InputError:
    with path.open("rb") as file:
        head = file.read(4096)
    if not head.strip(b"\0"):
        return InputError("begins with nothing but zero bytes", file=path, hint="copy it again from the camera")
    if head[4:8] in (b"ftyp", b"mdat", b"wide", b"free", b"moov") and not has_box(path, b"moov"):
        hint = "repair it with the camera's own tool, and record fragmented MP4 or MKV, which survive a power cut"
        return InputError("has no index (moov box), its recording was never finished", file=path, hint=hint)
    if head.startswith((b"#ROSBAG V", b"SQLite format 3\0")):
        kind = "a ROS 1 bag" if head.startswith(b"#") else "an SQLite file, perhaps a ROS 2 bag"
        return InputError(f"is {kind}, not an MCAP log", file=path, hint="convert it: mcap convert IN OUT.mcap")
    if isinstance(error, av.error.ArgumentError):  # the whitelist refused what FFmpeg would have read
        hint = "re-mux it with its frame rate into MP4 or MKV"
        return InputError("is a bare stream without times, or a format that is not read", file=path, hint=hint)
    if isinstance(error, av.error.EOFError):
        hint = "check that the recording ran, or re-mux it from the camera's original"
        return InputError("holds no picture, it ends after its header", file=path, hint=hint)
    hint = "give a video (MP4, MOV, MKV, WebM, AVI, TS), an MCAP log or a folder of images"
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"is no video that can be read ({reason})", file=path, hint=hint)


def video_stream(container: InputContainer, path: Path) -> VideoStream:
    """Return the first video stream, set to decode in one thread and to pair pictures with packets."""
    streams = _moving(container)
    if not streams:
        raise InputError("has no video stream", file=path, hint="give a recording with pictures")
    stream = streams[0]
    stream.thread_type = "NONE"
    stream.codec_context.thread_count = 1
    stream.codec_context.copy_opaque = True
    return stream


def _moving(container: InputContainer) -> list[VideoStream]:
    """Return the video streams that are no cover pictures."""
    attached = av.stream.Disposition.attached_pic
    return [stream for stream in container.streams.video if not stream.disposition & attached]


def time_base_of(stream: VideoStream) -> Fraction:
    """Seconds a tick of the stream's clock."""
    if stream.time_base is None:
        raise InputError("its video stream has no time base", hint="re-mux it to MP4 or MKV")
    return Fraction(stream.time_base)


def packets(container: InputContainer, stream: VideoStream, report: SourceReport) -> Iterator[Packet[VideoStream]]:
    """Yield the stream's packets that hold data; go on after an error the demuxer can step over."""
    while True:
        progress = False
        try:
            for packet in container.demux(stream):
                progress = True
                if packet.size:
                    yield packet
                elif packet.dts is not None:
                    report.skipped += 1
                    report.note("empty packets, which repeat the picture before them, are skipped")
            return
        except av.FFmpegError as error:
            report.truncated = True
            report.note(f"part of the file cannot be read ({error.strerror})")
            if not progress:
                return


def is_hidden(stream: VideoStream, packet: Packet[VideoStream]) -> bool:
    """Tell a VP8 reference that is never shown: bit 4 of its first byte. RFC 6386, 9.1."""
    return stream.codec_context.name == "vp8" and not memoryview(packet)[0] & 0x10


def packet_damage(stream: VideoStream, packet: Packet[VideoStream]) -> str:
    """Say what can be seen to be wrong with a packet before it is decoded; empty when nothing can."""
    if packet.is_corrupt:
        return "the container marks its data as damaged or cut"
    codec = stream.codec_context.name
    if codec in ZERO_FREE and is_zeroed(bytes(packet), jpeg=codec == "mjpeg"):
        return "part of its data is zeroed"
    return ""


def declared_end(container: InputContainer, stream: VideoStream) -> Fraction | None:
    """Return the stream's last moment by the container, seconds; None when it speaks of other streams too."""
    start = Fraction(stream.start_time or 0) * time_base_of(stream)
    if "avi" in container.format.name and stream.duration:
        return start + stream.duration * time_base_of(stream)
    if "matroska" in container.format.name and container.duration and len(container.streams) == 1:
        return Fraction(container.duration, av.time_base)
    return None


def index_length(container: InputContainer, stream: VideoStream) -> int:
    """Count the packets an MP4's or MOV's index lists; 0 for other containers, whose index may leave some out."""
    return len(stream.index_entries) if "mp4" in container.format.name.split(",") else 0


def early_end(path: Path, container: InputContainer, stream: VideoStream, clock: VideoClock, packets: int) -> str:
    """Say how the file ends before its container says it should; empty when it does not.

    packets: how many the stream gave; the clock has taken in all of them.
    """
    missing = index_length(container, stream) - packets
    if missing > 0:
        return f"its data ends {missing} frames before the end of its index"
    if is_cut(path, container.format.name):
        return "the file ends in the middle of its data"
    if (short_s := clock.short_of(declared_end(container, stream))) is not None:
        return f"its data ends or is unreadable {short_s:.3g} s before the end its container declares"
    return ""


def _rotation(frame: VideoFrame, notes: list[str]) -> int:
    """Clockwise degrees that make the picture upright; PyAV gives them counter-clockwise."""
    turn = -round(frame.rotation / 90) * 90 % 360
    if frame.rotation % 90:
        notes.append(f"its rotation of {-frame.rotation} degrees is taken as {turn}")
    return turn


def describe(path: Path) -> SourceInfo:
    """Read what the container says, and the first picture for what it does not."""
    with open_video(path) as container:
        stream = video_stream(container, path)
        time_base = time_base_of(stream)
        frame = _first_picture(container, stream)
        if frame is None:
            hint = "check that the recording ran, or re-mux it from the camera's original"
            raise InputError("holds no picture that can be decoded", file=path, hint=hint)
        notes: list[str] = []
        rotation_deg = _rotation(frame, notes)
        if len(_moving(container)) > 1:
            notes.append(f"it holds {len(_moving(container))} video streams, the first is read")
        if (transfer := int(frame.color_trc)) in HDR_TRANSFERS:
            notes.append(f"its grey levels follow the HDR curve {HDR_TRANSFERS[transfer]}, which is not undone")
        if stream.sample_aspect_ratio not in (None, 0, 1):
            notes.append(f"its pixels are not square ({stream.sample_aspect_ratio}); pictures are given as stored")
        duration_ns = None
        if stream.duration:
            duration_ns = ticks_to_ns(stream.duration, time_base)
        elif container.duration:
            duration_ns = ticks_to_ns(container.duration, Fraction(1, av.time_base))
        turned = rotation_deg in (90, 270)
        return SourceInfo(
            path=path,
            kind="video",
            width=frame.height if turned else frame.width,
            height=frame.width if turned else frame.height,
            has_clock=True,
            frames_declared=stream.frames or None,
            duration_ns=duration_ns,
            encoding=stream.codec_context.name,
            time_base=time_base,
            rotation_deg=rotation_deg,
            notes=tuple(notes),
        )


def _first_picture(container: InputContainer, stream: VideoStream) -> VideoFrame | None:
    for packet in packets(container, stream, SourceReport()):
        try:
            frames = stream.codec_context.decode(packet)
        except av.FFmpegError:
            continue
        if frames:
            return frames[0]
    try:
        frames = stream.codec_context.decode(None)
    except av.FFmpegError:
        return None
    return frames[0] if frames else None
