"""H.264 video in MP4 or MOV that plays everywhere, with the source's own times."""

from __future__ import annotations

import errno
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType

import av
import cv2
import numpy as np
from av.container import OutputContainer
from av.video.frame import VideoFrame
from av.video.reformatter import ColorRange, Colorspace, Interpolation, VideoReformatter
from av.video.stream import VideoStream
from numpy.typing import NDArray

from landtool.errors import OutputError, UsageError
from landtool.types import Image

NS = 1_000_000_000
FINE = Fraction(1, 1_000_000)  # for clocks an MP4 cannot hold: at most 0.5 us off, and 35 minutes between two pictures
MAX_TIMESCALE = 10_000_000  # 3.5 minutes between two pictures
MAX_STEP = 2**31 - 1  # ticks between two pictures: what FFmpeg lets an MP4 hold
KEY_FRAME_S = 2  # seconds between key frames: what a seek costs, and what a killed recording may lose
BT709, LIMITED = 1, 1  # ITU-T H.273 codes
# The endings this can write, with FFmpeg's name of the container
VIDEO_FORMATS = {".mp4": "mp4", ".m4v": "mp4", ".mov": "mov"}
FRAME_DURATION = 1 << 8  # AV_CODEC_FLAG_FRAME_DURATION: packets last as long as their pictures
X264 = {"preset": "veryfast", "crf": "20"}
# For pictures to look at: half the time, as near to the picture, a fifth larger at the most. Without looking ahead
# (mbtree) it would be larger by a quarter.
X264_QUICK = {"preset": "superfast", "crf": "19.7", "x264-params": "mbtree=1:rc-lookahead=10"}
# x264's look ahead at small pictures differs by a bit from run to run; without it the same pictures are the same bytes.
SMALL = 640 * 360  # pixels
X264_SMALL = {"x264-params": "mbtree=0"}
# Fragments while recording, so that a killed one can be read up to its last second; turned into a plain file with one
# index when it is closed. The index waits for the first pictures (delay_moov), or a later start would be lost.
MUXER = {"movflags": "hybrid_fragmented+frag_keyframe+delay_moov", "flush_packets": "1"}


class VideoWriter:
    """Writes pictures as H.264 (yuv420p, BT.709) with times that read back exactly as given.

    path: the ending `.mov` makes a MOV, any other an MP4.

    width, height: pixels of the pictures; an odd side is padded by one replicated row or column, as 4:2:0 needs.
    time_base: the source's own (`SourceInfo.time_base`), then every t_ns of that source reads back the same, a later
    start included. None for a clock in nanoseconds (MCAP): times count from the first picture in microseconds, each
    at most 0.5 us off. fps: for pictures without times only; picture n is at n / fps.
    quick: for pictures to look at rather than to measure in. It takes half the time, the file is a little larger, and
    colours (not their brightness) may be off by half a pixel.
    `notes` says what could not be kept: a start before zero moves to zero, a time not after the one before moves to
    the next tick, a gap longer than `MAX_STEP` ticks (a clock that was set on the way) is closed, a picture of another
    size is scaled to fit. Raises UsageError for pictures without times and no
    fps, OutputError when encoding or writing fails. Not atomic by itself: give it a temporary path.
    """

    def __init__(
        self,
        path: Path,
        width: int,
        height: int,
        time_base: Fraction | None = None,
        *,
        fps: Fraction | None = None,
        quick: bool = False,
    ) -> None:
        if fps is not None and fps <= 0:
            raise UsageError(f"a rate of {fps} pictures a second is impossible", hint="give --fps above 0")
        self.path, self.width, self.height, self.fps = Path(path), width, height, fps
        self._format = VIDEO_FORMATS.get(self.path.suffix.lower(), "mp4")
        self.written = 0
        self.bumped = 0
        self.resized = 0
        self.closed_s = Fraction(0)  # the gaps that were closed, together
        self._base = 1 / fps if fps is not None else time_base
        self.time_base = self._base if self._base and self._base.denominator <= MAX_TIMESCALE else FINE
        self._origin: Fraction | None = None  # seconds taken off every time
        self._held: tuple[VideoFrame, int] | None = None  # the last picture and its pts; the next one's time ends it
        self._step = 1  # ticks between the last two pictures
        self._stream: VideoStream | None = None
        self._quick = quick
        self._to_yuv = _quick_yuv if quick else _Reformatter()
        self._container: OutputContainer | None = self._open()

    @property
    def notes(self) -> list[str]:
        """What could not be kept as given, one sentence each."""
        notes = []
        rounded = self.time_base != self._base
        if self._origin:
            start = f"time 0 of the written video is {float(self._origin):.9f} s on the source's clock"
            notes.append(f"{start}, its times are rounded to microseconds" if rounded else start)
        elif rounded:
            notes.append("the written video's times are rounded to microseconds")
        if self.width % 2 or self.height % 2:
            notes.append("an odd side was padded by one pixel, as H.264 players need it even")
        if self.bumped:
            notes.append(f"pictures not later than the one before, moved to the next tick: {self.bumped}")
        if self.closed_s:
            notes.append(f"{float(self.closed_s):.9g} s without a picture do not fit an MP4 and were left out of it")
        if self.resized:
            notes.append(f"pictures of another size, scaled to {self.width}x{self.height}: {self.resized}")
        return notes

    def write(self, image: Image, t_ns: int | None) -> None:
        """Add one picture: (H, W, 3) BGR uint8, and its time in ns on the source's clock (None with `fps`)."""
        if self._container is None:
            raise OutputError("is closed already", file=self.path)
        pts = self._pts(t_ns)
        frame = self._frame(image)
        if self._held is not None:
            self._step = pts - self._held[1]
            self._encode(*self._held, self._container)
        self._held = (frame, pts)
        self.written += 1

    def close(self) -> None:
        """Finish the file. Raises OutputError when that fails or no picture was given; may be called again."""
        container = self._container
        if container is None:
            return
        try:
            if self._held is None:
                raise OutputError("no picture was written to it", file=self.path, hint="check the input")
            # Nothing ends the last picture: it stays as long as the one before it.
            self._encode(*self._held, container)
            self._mux(None, container)
        except BaseException:
            self.abandon()
            raise
        self._container = None
        try:
            container.close()
        except (av.FFmpegError, OSError) as error:
            raise self._failed(error) from None

    def abandon(self) -> None:
        """Release the file as it is; what was written of it can be read, but is not whole."""
        container, self._container = self._container, None
        if container is not None:
            with suppress(av.FFmpegError, OSError):  # an error led here, this one would hide it
                container.close()

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def _pts(self, t_ns: int | None) -> int:
        if self.fps is not None:
            return self.written
        if t_ns is None:
            raise UsageError("its pictures have no times", file=self.path, hint="say how many a second with --fps")
        time_s = Fraction(t_ns, NS)
        if self._origin is None:
            # An epoch clock starts at its first picture. MP4 holds a later start, but none before zero.
            self._origin = time_s if self._base is None else min(time_s, Fraction(0))
        pts = round((time_s - self._origin - self.closed_s) / self.time_base)
        if self._held is not None and pts - self._held[1] > MAX_STEP:
            left_out = pts - self._held[1] - self._step
            self.closed_s += left_out * self.time_base
            pts -= left_out
        if self._held is not None and pts <= self._held[1]:
            self.bumped += 1
            pts = self._held[1] + 1
        return pts

    def _frame(self, image: Image) -> VideoFrame:
        if image.shape[:2] != (self.height, self.width):
            self.resized += 1
            image = np.asarray(cv2.resize(image, (self.width, self.height), interpolation=cv2.INTER_AREA), np.uint8)
        if self.width % 2 or self.height % 2:
            image = np.pad(image, ((0, self.height % 2), (0, self.width % 2), (0, 0)), mode="edge")
        return self._to_yuv(np.ascontiguousarray(image))

    def _encode(self, frame: VideoFrame, pts: int, container: OutputContainer) -> None:
        frame.pts, frame.time_base, frame.duration = pts, self.time_base, self._step
        self._mux(frame, container)

    def _mux(self, frame: VideoFrame | None, container: OutputContainer) -> None:
        try:
            if self._stream is None:
                self._stream = self._start(container)
            container.mux(self._stream.encode(frame))
        except (av.FFmpegError, OSError) as error:
            raise self._failed(error) from None

    def _open(self) -> OutputContainer:
        # The movie's own scale counts a later start; left at milliseconds it would round it.
        scale = str(self.time_base.denominator)
        options = MUXER | {"video_track_timescale": scale, "movie_timescale": scale}
        try:
            self.path.open("wb").close()  # PyAV opens it with the first picture only; a bad place shall be said now
            return av.open(str(self.path), "w", format=self._format, options=options)
        except (av.FFmpegError, OSError) as error:
            raise self._failed(error) from None

    def _start(self, container: OutputContainer) -> VideoStream:
        # Only the encoder's level and the key frames' distance follow from this rate; the times do not. The first
        # two pictures may be one tick or an hour apart, and a level beyond any player's helps nobody.
        rate = min(max(1 / (self._step * self.time_base), Fraction(1)), Fraction(240)).limit_denominator(1001)
        options = X264_QUICK if self._quick else X264
        if self.width * self.height < SMALL:
            options = options | X264_SMALL
        stream = container.add_stream("libx264", rate=rate, options=dict(options))
        stream.width, stream.height = self.width + self.width % 2, self.height + self.height % 2
        stream.pix_fmt = "yuv420p"
        stream.time_base = self.time_base
        codec = stream.codec_context
        codec.time_base = self.time_base
        codec.flags |= FRAME_DURATION
        codec.max_b_frames = 0
        codec.gop_size = min(max(1, round(KEY_FRAME_S * rate)), 250)
        codec.thread_count = 2
        codec.colorspace, codec.color_range = BT709, LIMITED
        codec.color_primaries = codec.color_trc = BT709
        return stream

    def _failed(self, error: Exception) -> OutputError:
        code = getattr(error, "errno", None)
        hint = "free some space or choose another -o" if code == errno.ENOSPC else "check the folder or another -o"
        return OutputError(
            f"cannot be written ({getattr(error, 'strerror', None) or error})", file=self.path, hint=hint
        )


class _Reformatter:
    """Pictures (H, W, 3) BGR uint8 of even sides to yuv420p, BT.709 limited, by FFmpeg's scaler."""

    def __init__(self) -> None:
        self._reformatter = VideoReformatter()

    def __call__(self, image: Image) -> VideoFrame:
        bgr = VideoFrame.from_ndarray(image, format="bgr24")
        # Without accurate rounding every conversion darkens by up to two levels.
        return self._reformatter.reformat(
            bgr,
            format="yuv420p",
            dst_colorspace=Colorspace.ITU709,
            dst_color_range=ColorRange.MPEG,
            interpolation=Interpolation.BILINEAR | Interpolation.ACCURATE_RND,
            threads=1,
        )


def _quick_yuv(image: Image) -> VideoFrame:
    """As `_Reformatter`, in a third of the time; each colour is the mean of its four pixels."""
    height, width = image.shape[:2]
    frame = VideoFrame(width, height, "yuv420p")
    yuv = cv2.transform(image, _YUV_OF_BGR)
    cv2.extractChannel(yuv, 0, dst=_plane(frame, 0))
    for number in (1, 2):
        full = cv2.extractChannel(yuv, number)
        cv2.resize(full, (width // 2, height // 2), dst=_plane(frame, number), interpolation=cv2.INTER_AREA)
    return frame


def _yuv_of_bgr() -> NDArray[np.float64]:
    """Return the matrix (3, 4) of Y', Cb, Cr from b, g, r, 1: ITU-R BT.709, all 8 bits, limited range."""
    # Y' = 16 + 219 E, Cb = 128 + 224 (B - E) / 1.8556, Cr = 128 + 224 (R - E) / 1.5748,
    # E = 0.0722 B + 0.7152 G + 0.2126 R
    light, blue, red = np.array([0.0722, 0.7152, 0.2126]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    rows = np.stack([219.0 * light, 224.0 * (blue - light) / 1.8556, 224.0 * (red - light) / 1.5748]) / 255.0
    return np.column_stack([rows, [16.0, 128.0, 128.0]])


def _plane(frame: VideoFrame, number: int) -> Image:
    """Return a plane of a frame as an array (height, width) that can be written to."""
    plane = frame.planes[number]
    rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)  # type: ignore[call-overload]
    return np.asarray(rows[:, : plane.width])


_YUV_OF_BGR = _yuv_of_bgr()
