"""CDR: byte orders, alignment of both versions, and agreement with mcap-ros2-support's own decoder."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic

from landtool.io.mcap_cdr import BrokenMessageError, CdrReader, CdrWriter
from landtool.io.mcap_messages import CALIBRATION_PARSERS, IMAGE_PARSERS, Calibration, RawImage
from tests.unit.io.mcap_logs import DEFINITIONS, ros_camera_info

INFO = "sensor_msgs/msg/CameraInfo"


def image_bytes(order: str, kind: int, frame_id: bytes) -> bytes:
    """Lay out a 2x1 mono8 sensor_msgs/Image by hand; `frame_id` of every length moves the fields behind it."""
    body = bytearray(struct.pack(f"{order}iI", 12, 34))

    def align(size: int) -> None:
        body.extend(bytes(-len(body) % size))

    def string(text: bytes) -> None:
        align(4)
        body.extend(struct.pack(f"{order}I", len(text) + 1) + text + b"\0")

    string(frame_id)
    align(4)
    body.extend(struct.pack(f"{order}II", 1, 2))
    string(b"mono8")
    body.extend(b"\x01")  # is_bigendian
    align(4)
    body.extend(struct.pack(f"{order}II", 2, 2) + b"\x07\x08")
    return bytes([0, kind, 0, 0]) + bytes(body)


@pytest.mark.parametrize("length", range(5))
@pytest.mark.parametrize(("order", "kind"), [(">", 0), ("<", 1), (">", 6), ("<", 7)])
def test_images_in_both_byte_orders(order: str, kind: int, length: int) -> None:
    data = image_bytes(order, kind, b"f" * length)
    message = IMAGE_PARSERS["sensor_msgs/Image", "cdr"](memoryview(data))
    assert isinstance(message, RawImage)
    assert message.stamp_ns == 12_000_000_034
    assert (message.width, message.height, message.encoding, message.step) == (2, 1, "mono8", 2)
    assert message.big_endian
    assert bytes(message.data) == b"\x07\x08"


@pytest.mark.parametrize("model", ["", "a", "ab", "abc", "abcd", "plumb_bob", "rational_polynomial"])
@pytest.mark.parametrize("count", [0, 1, 5, 8])
def test_float64_alignment_is_the_other_librarys(model: str, count: int) -> None:
    info = ros_camera_info(5, 640, 480, distortion_model=model, d=[0.5 + n for n in range(count)])
    data = bytes(serialize_dynamic(INFO, DEFINITIONS[INFO])[INFO](info))
    got = CALIBRATION_PARSERS["sensor_msgs/CameraInfo", "cdr"](memoryview(data))
    assert got == Calibration(640, 480, model, tuple(info.d), tuple(info.k), tuple(info.p))


def test_xcdr2_aligns_float64_to_4() -> None:
    data = bytes([0, 7, 0, 0]) + struct.pack("<Id", 9, 2.5)
    reader = CdrReader(data)
    assert (reader.uint32(), reader.float64s(1)) == (9, (2.5,))
    reader = CdrReader(bytes([0, 1, 0, 0]) + struct.pack("<I4xd", 9, 2.5))
    assert (reader.uint32(), reader.float64s(1)) == (9, (2.5,))


@pytest.mark.parametrize("name", ["", "a", "abc", "frame"])
def test_what_is_written_is_what_the_other_library_reads(name: str) -> None:
    writer = CdrWriter().stamp_ns(-1).string(name).uint32(3, 4).string("equidistant").float64_sequence((1.5, 2.5))
    writer.float64s(range(9)).float64s(range(9)).float64s(range(12)).uint32(0, 0).uint32(1, 2, 3, 4).uint8(1)
    info: Any = generate_dynamic(INFO, DEFINITIONS[INFO])[INFO](writer.finish())
    assert (info.header.stamp.sec, info.header.stamp.nanosec, info.header.frame_id) == (-1, 999_999_999, name)
    assert (info.height, info.width, list(info.d), list(info.p)) == (3, 4, [1.5, 2.5], list(range(12)))
    assert (info.roi.x_offset, info.roi.width, info.roi.do_rectify) == (1, 4, True)


def test_a_time_beyond_int32_seconds_overflows() -> None:
    with pytest.raises(OverflowError):
        CdrWriter().stamp_ns(2**31 * 10**9)


@pytest.mark.parametrize("data", [b"", b"\0\1\0", b"\1\1\0\0", b"\0\2\0\0\0\0\0\0"])
def test_a_header_that_is_no_cdr_is_broken(data: bytes) -> None:
    with pytest.raises(BrokenMessageError):
        CdrReader(data)


def test_every_cut_is_a_broken_message() -> None:
    data = image_bytes("<", 1, b"frame")
    for length in range(len(data)):
        with pytest.raises(BrokenMessageError):
            IMAGE_PARSERS["sensor_msgs/Image", "cdr"](memoryview(data[:length]))
