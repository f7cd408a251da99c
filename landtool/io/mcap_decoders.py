"""From image messages to pictures: raw pixels, JPEG, PNG, WebP, and video with one picture a message."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import av
import cv2
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter

from landtool.io.mcap_cdr import BrokenMessageError
from landtool.io.mcap_messages import CodedImage, ImageMessage, RawImage
from landtool.io.mcap_pixels import bgr_from_raw
from landtool.types import Image

VideoCodec = Literal["h264", "hevc", "vp9", "av1"]
# what a message calls its format -> FFmpeg's name of the codec
VIDEO_CODECS: dict[str, VideoCodec] = {"h264": "h264", "h265": "hevc", "hevc": "hevc", "vp9": "vp9", "av1": "av1"}
# A message's picture is given up when this many later messages went in and it did not come out: H.264 and H.265
# hold back 16 at most.
_HELD_BACK = 17
_OUTPUT_CORRUPT = 1 << 3  # AV_CODEC_FLAG_OUTPUT_CORRUPT
_KEEP_AS_STORED = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION  # the calibration is of the stored pixels


@dataclass(frozen=True, eq=False)
class Picture:
    """What came of the message `number`: an image (H, W, 3) BGR, perhaps with damage, or none and the reason."""

    number: int
    image: Image | None
    damage: str = ""


class PictureDecoder:
    """Turns one topic's messages into pictures, in the messages' order.

    Every message is given to `feed` or, when it could not be read, to `lose`; both return what is ready by then. A
    video decoder may hold pictures back, `flush` gives the last ones. Broken messages are pictures without image.
    """

    def __init__(self) -> None:
        self._video: _VideoDecoder | None = None

    def feed(self, number: int, message: ImageMessage) -> list[Picture]:
        """Take in a message; its number is greater than all before."""
        codec = None if isinstance(message, RawImage) else VIDEO_CODECS.get(message.format.strip().lower())
        done = self.flush() if self._video and self._video.codec != codec else []
        if codec is not None and isinstance(message, CodedImage):
            self._video = self._video or _VideoDecoder(codec)
            return done + self._video.feed(number, message.data)
        try:
            return [*done, Picture(number, still_image(message))]
        except BrokenMessageError as error:
            return [*done, Picture(number, None, str(error))]

    def lose(self, number: int, reason: str) -> list[Picture]:
        """Take note of a message that could not be read."""
        return self._video.lose(number, reason) if self._video else [Picture(number, None, reason)]

    def flush(self) -> list[Picture]:
        """Return what was held back; the next message starts afresh."""
        video, self._video = self._video, None
        return video.flush() if video else []


def still_image(message: ImageMessage) -> Image:
    """Return (H, W, 3) BGR of a raw image, JPEG, PNG or WebP. Raises BrokenMessageError."""
    if isinstance(message, RawImage):
        return bgr_from_raw(message)
    if "compresseddepth" in message.format.lower():
        raise BrokenMessageError(f"the format '{message.format}' is a depth image, not a picture")
    data = np.frombuffer(message.data, dtype=np.uint8)
    if not len(data):
        raise BrokenMessageError("the message has no image data")
    if data[:4].tobytes() == b"\x89PNG" and b"IEND" not in data[-64:].tobytes():
        raise BrokenMessageError("the PNG image is cut short")
    try:
        image = cv2.imdecode(data, _KEEP_AS_STORED)
    except cv2.error:
        image = None
    if image is None:
        raise BrokenMessageError(f"the {message.format or 'compressed'} image is broken or of a kind not supported")
    # image_transport says which order the encoder was given; it is BGR but for some publishers
    swapped = "compressed rgb" in message.format
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if swapped else image, dtype=np.uint8)


@dataclass(eq=False)
class _Slot:
    """A message given to the decoder and what came out of it so far."""

    number: int
    image: Image | None = None
    key: bool = False
    damage: str = ""

    @property
    def done(self) -> bool:
        return self.image is not None or bool(self.damage)


class _VideoDecoder:
    """One packet a message; pictures are matched to their messages by number, so a lost one is known by name."""

    def __init__(self, codec: VideoCodec) -> None:
        self.codec = codec
        context = av.CodecContext.create(codec, "r")
        assert isinstance(context, VideoCodecContext)
        context.thread_type = "NONE"  # as in video.py: more threads only hold pictures back
        context.thread_count = 1
        self._context = context
        self._reformatter = VideoReformatter()
        self._slots: deque[_Slot] = deque()
        self._reference_lost = True  # no key frame yet

    def feed(self, number: int, data: bytes | memoryview) -> list[Picture]:
        slot = _Slot(number)
        self._slots.append(slot)
        if not len(data):
            slot.damage = "the message has no video data"  # an empty packet would end the stream
            return self._ready()
        packet = av.Packet(bytes(data))
        packet.pts = packet.dts = number
        try:
            self._match(self._context.decode(packet))
        except av.FFmpegError as error:
            slot.damage = f"the video data cannot be decoded ({error.strerror})"
        return self._ready()

    def lose(self, number: int, reason: str) -> list[Picture]:
        self._slots.append(_Slot(number, damage=reason))
        return self._ready()

    def flush(self) -> list[Picture]:
        with suppress(av.FFmpegError):  # the slots left open say what is missing
            self._match(self._context.decode(None))
        return self._ready(limit=0)

    def _match(self, frames: list[VideoFrame]) -> None:
        """Put each picture into its message's slot; one whose message was given up comes too late."""
        for frame in frames:
            slot = next((slot for slot in self._slots if slot.number == frame.pts), None)
            if slot is None:
                continue
            array = self._reformatter.reformat(frame, format="bgr24", threads=1).to_ndarray()
            slot.image, slot.key = np.ascontiguousarray(array, dtype=np.uint8), frame.key_frame
            if frame.is_corrupt:
                slot.damage = "the decoder found damage and filled it in"
            # from the first good picture on damaged ones are wanted too, marked as such
            self._context.flags |= _OUTPUT_CORRUPT

    def _ready(self, limit: int = _HELD_BACK) -> list[Picture]:
        """Return the pictures whose turn it is: in order, and no longer waited for."""
        ready = []
        while self._slots and (self._slots[0].done or len(self._slots) > limit):
            slot = self._slots.popleft()
            if slot.image is None:
                waiting = "no key frame came before it" if self._reference_lost else "no picture came of its data"
                slot.damage = slot.damage or waiting
                self._reference_lost = True
            elif slot.key and not slot.damage:
                self._reference_lost = False
            elif self._reference_lost:
                slot.damage = slot.damage or "a picture it builds on is lost"
            ready.append(Picture(slot.number, slot.image, slot.damage))
        return ready
