"""Image and calibration messages as values, one parser a message type and encoding, in one table.

The fields of these types are fixed, so the definitions a log carries are not needed: logs with IDL definitions or
with none read as well.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration as ProtoCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage as ProtoCompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo as ProtoCompressedVideo
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage as ProtoRawImage
from google.protobuf.message import DecodeError, Message
from google.protobuf.timestamp_pb2 import Timestamp

from landtool.io.mcap_cdr import BrokenMessageError, CdrReader

_Proto = TypeVar("_Proto", bound=Message)
_Parsed = TypeVar("_Parsed")


@dataclass(frozen=True, eq=False)
class RawImage:
    """A picture as rows of pixels; step: bytes from one row to the next."""

    stamp_ns: int
    width: int
    height: int
    encoding: str
    big_endian: bool
    step: int
    data: bytes | memoryview


@dataclass(frozen=True, eq=False)
class CodedImage:
    """A compressed picture, or one picture's part of a video; format: as the message says, like `jpeg` or `h264`."""

    stamp_ns: int
    format: str
    data: bytes | memoryview


class Roi(NamedTuple):
    """The part of the sensor a CameraInfo's pictures show, in pixels before binning."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Calibration:
    """A calibration as the message has it: d any length, k 9 and p 12 numbers by rows."""

    width: int
    height: int
    model: str
    d: tuple[float, ...]
    k: tuple[float, ...]
    p: tuple[float, ...]
    binning: tuple[int, int] = (1, 1)
    roi: Roi | None = None


ImageMessage = RawImage | CodedImage


def _ros_image(data: memoryview) -> RawImage:
    cdr = CdrReader(data)
    stamp_ns, _ = cdr.stamp_ns(), cdr.string()
    height, width, encoding = cdr.uint32(), cdr.uint32(), cdr.string()
    big_endian, step = bool(cdr.uint8()), cdr.uint32()
    return RawImage(stamp_ns, width, height, encoding, big_endian, step, cdr.blob())


def _ros_compressed_image(data: memoryview) -> CodedImage:
    cdr = CdrReader(data)
    stamp_ns, _ = cdr.stamp_ns(), cdr.string()
    return CodedImage(stamp_ns, cdr.string(), cdr.blob())


def _ros_camera_info(data: memoryview) -> Calibration:
    cdr = CdrReader(data)
    cdr.stamp_ns(), cdr.string()
    height, width, model, d = cdr.uint32(), cdr.uint32(), cdr.string(), cdr.float64_sequence()
    k, _, p = cdr.float64s(9), cdr.float64s(9), cdr.float64s(12)
    binning = max(cdr.uint32(), 1), max(cdr.uint32(), 1)  # 0 means 1
    x, y, roi_height, roi_width = cdr.uint32(), cdr.uint32(), cdr.uint32(), cdr.uint32()
    roi = Roi(x, y, roi_width, roi_height) if roi_width and roi_height else None
    return Calibration(width, height, model, d, k, p, binning, roi)


def _proto_raw_image(data: memoryview) -> RawImage:
    message = parse_proto(ProtoRawImage(), data)
    return RawImage(
        proto_time_ns(message.timestamp),
        message.width,
        message.height,
        message.encoding,
        False,
        message.step,
        message.data,
    )


def _proto_compressed(message: ProtoCompressedImage | ProtoCompressedVideo) -> CodedImage:
    return CodedImage(proto_time_ns(message.timestamp), message.format, message.data)


def _proto_calibration(data: memoryview) -> Calibration:
    message = parse_proto(ProtoCalibration(), data)
    d, k, p = tuple(message.D), tuple(message.K), tuple(message.P)
    return Calibration(message.width, message.height, message.distortion_model, d, k, p)


def _json_raw_image(data: memoryview) -> RawImage:
    fields = json.loads(bytes(data))
    size = int(fields["width"]), int(fields["height"])
    pixels = base64.b64decode(fields["data"], validate=True)
    stamp_ns = _json_time_ns(fields["timestamp"])
    return RawImage(stamp_ns, *size, str(fields["encoding"]), False, int(fields["step"]), pixels)


def _json_compressed(data: memoryview) -> CodedImage:
    fields = json.loads(bytes(data))
    coded = base64.b64decode(fields["data"], validate=True)
    return CodedImage(_json_time_ns(fields["timestamp"]), str(fields["format"]), coded)


def _json_calibration(data: memoryview) -> Calibration:
    fields = json.loads(bytes(data))
    d, k, p = (tuple(float(value) for value in fields.get(name, ())) for name in "DKP")
    return Calibration(int(fields["width"]), int(fields["height"]), str(fields["distortion_model"]), d, k, p)


def _json_time_ns(fields: dict[str, int]) -> int:
    return int(fields["sec"]) * 1_000_000_000 + int(fields["nsec"])


def proto_time_ns(stamp: Timestamp) -> int:
    """Return a protobuf timestamp as nanoseconds; 0 when the message has none."""
    return stamp.seconds * 1_000_000_000 + stamp.nanos


def parse_proto(message: _Proto, data: memoryview) -> _Proto:
    """Fill a protobuf message from its bytes. Raises BrokenMessageError."""
    try:
        message.ParseFromString(bytes(data))
    except DecodeError as error:
        raise BrokenMessageError(f"the protobuf message is broken ({error})") from None
    return message


ImageParser = Callable[[memoryview], ImageMessage]
CalibrationParser = Callable[[memoryview], Calibration]

# (message type without ROS 2's "/msg/", message encoding) -> parser
IMAGE_PARSERS: dict[tuple[str, str], ImageParser] = {
    ("sensor_msgs/Image", "cdr"): _ros_image,
    ("sensor_msgs/CompressedImage", "cdr"): _ros_compressed_image,
    ("foxglove.RawImage", "protobuf"): _proto_raw_image,
    ("foxglove.CompressedImage", "protobuf"): lambda data: _proto_compressed(parse_proto(ProtoCompressedImage(), data)),
    ("foxglove.CompressedVideo", "protobuf"): lambda data: _proto_compressed(parse_proto(ProtoCompressedVideo(), data)),
    ("foxglove.RawImage", "json"): _json_raw_image,
    ("foxglove.CompressedImage", "json"): _json_compressed,
    ("foxglove.CompressedVideo", "json"): _json_compressed,
}
CALIBRATION_PARSERS: dict[tuple[str, str], CalibrationParser] = {
    ("sensor_msgs/CameraInfo", "cdr"): _ros_camera_info,
    ("foxglove.CameraCalibration", "protobuf"): _proto_calibration,
    ("foxglove.CameraCalibration", "json"): _json_calibration,
}
IMAGE_TYPES = frozenset(name for name, _ in IMAGE_PARSERS)
CALIBRATION_TYPES = frozenset(name for name, _ in CALIBRATION_PARSERS)


def plain_type(schema_name: str) -> str:
    """Return a message type's name without ROS 2's `/msg/`: `sensor_msgs/msg/Image` is `sensor_msgs/Image`."""
    return schema_name.replace("/msg/", "/")


def parse_image(parser: ImageParser, data: memoryview) -> ImageMessage:
    """Parse one image message. Raises BrokenMessageError with the reason."""
    return _guarded(parser, data)


def parse_calibration(parser: CalibrationParser, data: memoryview) -> Calibration:
    """Parse one calibration message. Raises BrokenMessageError with the reason."""
    return _guarded(parser, data)


def _guarded(parser: Callable[[memoryview], _Parsed], data: memoryview) -> _Parsed:
    try:
        return parser(data)
    except BrokenMessageError:
        raise
    except (ValueError, KeyError, TypeError) as error:
        raise BrokenMessageError(f"the message is broken ({type(error).__name__}: {error})") from None
