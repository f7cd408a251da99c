"""Image messages with another picture in them: type, stamp, frame and, where it can be, the encoding stay."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage as ProtoRawImage

from landtool.errors import UsageError
from landtool.io.image_out import encode_image, image_form
from landtool.io.mcap_cdr import CdrReader, CdrWriter
from landtool.io.mcap_decoders import VIDEO_CODECS
from landtool.io.mcap_messages import IMAGE_PARSERS, CodedImage, ImageMessage, RawImage, parse_image, parse_proto
from landtool.io.mcap_out import H264Encoder
from landtool.io.mcap_pixels import raw_from_bgr
from landtool.types import Image

Kind = tuple[str, str]  # message type without ROS 2's "/msg/", message encoding
_CODED_SUFFIXES = {"jpeg": ".jpg", "png": ".png", "webp": ".webp"}


class PictureReplacer:
    """Puts pictures into one topic's messages, in their order. notes: what could not be kept, one sentence each.

    A message whose picture did not change stays byte for byte. Of a video that ends with the first change: from there
    on every picture is encoded anew as H.264, and of a video in another codec from the start, because a message holds
    only what differs from the pictures before it.
    """

    def __init__(self, topic: str) -> None:
        self.notes: list[str] = []
        self._topic = topic
        self._video: H264Encoder | None = None

    def put(self, kind: Kind, data: memoryview, image: Image, *, changed: bool) -> bytes:
        """Return the message with the picture (H, W, 3) BGR. Raises UsageError for one its video cannot hold."""
        message = parse_image(IMAGE_PARSERS[kind], data)
        codec = None if isinstance(message, RawImage) else VIDEO_CODECS.get(message.format.strip().lower())
        if not changed and (codec is None or (codec == "h264" and self._video is None)):
            return bytes(data)
        if isinstance(message, RawImage):
            return _BUILDERS[kind](data, self._raw(message, image))
        new = self._still(message, image) if codec is None else self._video_part(message, codec, image)
        return _BUILDERS[kind](data, new)

    def without_picture(self, data: memoryview) -> bytes | None:
        """Return the message of a lost picture: as it is, but None inside a video that is encoded anew."""
        return None if self._video is not None else bytes(data)

    def _raw(self, message: RawImage, image: Image) -> RawImage:
        new = raw_from_bgr(image, message)
        if new.encoding != message.encoding:
            self._note(f"dehazed pictures of {self._topic} are {new.encoding}, as {message.encoding} cannot be written")
        elif message.encoding.endswith("16") or message.encoding.startswith("16"):
            self._note(f"dehazed pictures of {self._topic} have 8 bits of precision in their 16")
        if message.encoding in ("rgba8", "bgra8", "8UC4", "rgba16", "bgra16", "16UC4"):
            self._note(f"dehazed pictures of {self._topic} are opaque, their alpha was dropped")
        return new

    def _still(self, message: CodedImage, image: Image) -> CodedImage:
        form = image_form(message.data)
        suffix = _CODED_SUFFIXES.get(form.format)
        if suffix is None:
            self._note(f"dehazed pictures of {self._topic} are jpeg, as {message.format} cannot be written")
            return replace(message, format="jpeg", data=encode_image(image, ".jpg"))
        if form.sixteen_bit:
            self._note(f"dehazed pictures of {self._topic} have 8 bits of precision in their 16")
        if form.alpha:
            self._note(f"dehazed pictures of {self._topic} are opaque, their alpha was dropped")
        # as in `still_image`: the encoder was given another order of channels
        swapped = "compressed rgb" in message.format
        stored = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8) if swapped else image
        return replace(message, data=encode_image(stored, suffix, grey=form.grey, sixteen_bit=form.sixteen_bit))

    def _video_part(self, message: CodedImage, codec: str, image: Image) -> CodedImage:
        height, width = image.shape[:2]
        if self._video is None:
            if width % 2 or height % 2:
                reason = f"the video of {self._topic} has pictures of {width}x{height}, which h264 cannot hold"
                raise UsageError(reason, hint="convert the topic to compressed images first")
            self._video = H264Encoder(width, height)
            again = "" if codec == "h264" else f", which was {message.format}"
            self._note(f"the video of {self._topic}{again} was encoded anew as h264 from its first dehazed picture on")
        return replace(message, format="h264", data=self._video.encode(image, message.stamp_ns))

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def _ros_image(old: memoryview, new: ImageMessage) -> bytes:
    assert isinstance(new, RawImage)
    cdr = _ros_header(old).uint32(new.height, new.width).string(new.encoding)
    return cdr.uint8(int(new.big_endian)).uint32(new.step).blob(new.data).finish()


def _ros_compressed_image(old: memoryview, new: ImageMessage) -> bytes:
    assert isinstance(new, CodedImage)
    return _ros_header(old).string(new.format).blob(new.data).finish()


def _ros_header(old: memoryview) -> CdrWriter:
    """Begin a message with the header of another."""
    cdr = CdrReader(old)
    sec, nanosec, frame_id = cdr.int32(), cdr.uint32(), cdr.string()
    return CdrWriter().int32(sec).uint32(nanosec).string(frame_id)


def _fields(new: ImageMessage) -> dict[str, Any]:
    """Return what changes in a Foxglove message."""
    if isinstance(new, CodedImage):
        return {"format": new.format, "data": bytes(new.data)}
    size = {"width": new.width, "height": new.height}
    return {**size, "encoding": new.encoding, "step": new.step, "data": bytes(new.data)}


def _proto(kind: Any) -> Callable[[memoryview, ImageMessage], bytes]:
    def build(old: memoryview, new: ImageMessage) -> bytes:
        message = parse_proto(kind(), old)
        for name, value in _fields(new).items():
            setattr(message, name, value)
        return bytes(message.SerializeToString(deterministic=True))

    return build


def _json(old: memoryview, new: ImageMessage) -> bytes:
    changed = _fields(new)
    changed["data"] = base64.b64encode(changed["data"]).decode()
    return json.dumps({**json.loads(bytes(old)), **changed}).encode()


# The counterpart of IMAGE_PARSERS: (the old message, its new content) -> the new message
_BUILDERS: dict[Kind, Callable[[memoryview, ImageMessage], bytes]] = {
    ("sensor_msgs/Image", "cdr"): _ros_image,
    ("sensor_msgs/CompressedImage", "cdr"): _ros_compressed_image,
    ("foxglove.RawImage", "protobuf"): _proto(ProtoRawImage),
    ("foxglove.CompressedImage", "protobuf"): _proto(CompressedImage),
    ("foxglove.CompressedVideo", "protobuf"): _proto(CompressedVideo),
    ("foxglove.RawImage", "json"): _json,
    ("foxglove.CompressedImage", "json"): _json,
    ("foxglove.CompressedVideo", "json"): _json,
}
