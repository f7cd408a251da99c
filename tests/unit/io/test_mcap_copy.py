"""Copies of logs with other pictures: what changes, and that nothing else does."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage as ProtoRawImage
from mcap.reader import make_reader

from landtool.errors import UsageError
from landtool.io.mcap import McapSource
from landtool.io.mcap_copy import McapCopy
from landtool.io.mcap_messages import IMAGE_PARSERS, RawImage, parse_image
from landtool.io.mcap_pixels import LAYOUTS, bgr_from_raw, raw_from_bgr
from landtool.io.mcap_replace import PictureReplacer
from landtool.types import Frame, Image
from tests.unit.io.mcap_logs import START_NS, STEP_NS, Log, even_stamps, grey, header, namespace, ros_image
from tests.unit.io.test_mcap_video import ENCODERS, packets, pictures

TOPIC, IMAGE, COMPRESSED = "/cam/image_raw", "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
Message = tuple[Any, ...]


def messages(path: Path, *, without: str = "") -> list[Message]:
    """Everything a log's messages are, but the ids of their channels."""
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(log_time_order=False)
        return [
            (c.topic, s.name if s else None, s.encoding if s else None, s.data if s else None, c.message_encoding)
            + (c.metadata, m.log_time, m.publish_time, m.sequence, m.data)
            for s, c, m in found
            if c.topic != without
        ]


def copied(source: Path, path: Path, changed: set[int], topic: str = TOPIC) -> McapCopy:
    """Copy a log with the pictures of the given numbers inverted."""
    with McapSource(source, topic=topic) as frames, McapCopy(source, path, topic) as copy:
        for frame in frames:
            if isinstance(frame, Frame):
                image = 255 - frame.image if frame.index in changed else frame.image
                copy.write(np.asarray(image, np.uint8), changed=frame.index in changed)
            else:
                copy.skip()
    return copy


def shown(path: Path, topic: str = TOPIC) -> list[Image]:
    return [frame.image for frame in McapSource(path, topic=topic) if isinstance(frame, Frame)]


def mixed_log(path: Path, **options: Any) -> Path:
    """Pictures among other topics, with an attachment, a metadata record and a channel without messages."""
    with Log(path, **options) as log:
        writer = log._writer
        writer.add_attachment(1, 2, "notes.txt", "text/plain", b"windy")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        log._channels["/said"] = writer.register_channel("/said", "cdr", schema, {"qos": "reliable"})
        log._channels["/bare"] = writer.register_channel("/bare", "text", 0)
        writer.register_channel("/silent", "cdr", schema)
        for n, stamp in enumerate(even_stamps(6)):
            log.ros(TOPIC, IMAGE, ros_image(stamp, grey(n), "mono8"), START_NS + n * STEP_NS)
            writer.add_message(log._channels["/said"], stamp + 7, f"word {n}".encode(), stamp + 3, sequence=n + 5)
            writer.add_message(log._channels["/bare"], stamp, bytes([n]), stamp)
        writer.add_metadata("flight", {"pilot": "none"})
    return path


@pytest.mark.parametrize("options", [{}, {"use_chunking": False}, {"chunk_size": 3000}])
def test_everything_else_stays(tmp_path: Path, options: dict[str, Any]) -> None:
    source = mixed_log(tmp_path / "a.mcap", **options)
    copy = copied(source, tmp_path / "b.mcap", {2, 3})
    assert copy.notes == []
    before, after = messages(source), messages(tmp_path / "b.mcap")
    assert [m[:-1] for m in after] == [m[:-1] for m in before]
    assert [m for m in after if m[0] != TOPIC] == [m for m in before if m[0] != TOPIC]
    same = [a[-1] == b[-1] for a, b in zip(before, after, strict=True) if a[0] == TOPIC]
    assert same == [True, True, False, False, True, True]
    assert [int(image[0, 0, 0]) for image in shown(tmp_path / "b.mcap")] == [0, 10, 235, 225, 40, 50]
    with (tmp_path / "b.mcap").open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        assert [(a.name, a.create_time, a.log_time, a.data) for a in reader.iter_attachments()] == [
            ("notes.txt", 1, 2, b"windy")
        ]
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        assert records["flight"] == {"pilot": "none"}
        assert records["landtool"]["dehazed_topic"] == TOPIC
        summary = reader.get_summary()
        assert summary is not None
        assert "/silent" in {channel.topic for channel in summary.channels.values()}


def test_a_chunk_that_is_lost_costs_what_was_in_it(tmp_path: Path) -> None:
    source = mixed_log(tmp_path / "a.mcap", chunk_size=3000)
    data = bytearray(source.read_bytes())
    with source.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[1]
    middle = chunk.chunk_start_offset + chunk.chunk_length - 20
    data[middle : middle + 8] = b"\xff" * 8
    source.write_bytes(data)
    copy = copied(source, tmp_path / "b.mcap", {0, 5})
    assert copy.lost_chunks == 1
    assert copy.notes == ["1 parts of the log cannot be read and were left out"]
    after = messages(tmp_path / "b.mcap")
    assert 0 < len(after) < 18
    values = [int(image[0, 0, 0]) for image in shown(tmp_path / "b.mcap")]
    assert values[0] == 255
    assert values[-1] == 205


def test_a_message_without_a_picture_stays(tmp_path: Path) -> None:
    source = tmp_path / "a.mcap"
    with Log(source) as log:
        for n, stamp in enumerate(even_stamps(3)):
            broken = {"step": 3} if n == 1 else {}
            log.ros(TOPIC, IMAGE, ros_image(stamp, grey(n), "mono8", **broken), stamp)
    copied(source, tmp_path / "b.mcap", {0, 2})
    before, after = messages(source), messages(tmp_path / "b.mcap")
    assert [a == b for a, b in zip(before, after, strict=True)] == [False, True, False]


# --- one message


def picture() -> Image:
    return np.random.default_rng(1).integers(0, 256, (6, 8, 3), np.uint8)


@pytest.mark.parametrize("encoding", sorted(LAYOUTS))
@pytest.mark.parametrize("big_endian", [False, True])
def test_raw_pixels_come_back(encoding: str, big_endian: bool) -> None:
    image = picture()
    if LAYOUTS[encoding].samples == 1:
        image[:] = image[:, :, :1]
    old = RawImage(5, 8, 6, encoding, big_endian, 100, b"")
    new = raw_from_bgr(image, old)
    subsampled = encoding.startswith(("bayer", "yuv", "uyvy", "yuyv"))
    assert new.encoding == ("bgr8" if subsampled else encoding)
    assert (new.stamp_ns, new.width, new.height, new.big_endian) == (5, 8, 6, big_endian)
    assert np.array_equal(bgr_from_raw(new), image)


def put(kind: tuple[str, str], data: bytes, image: Image) -> tuple[bytes, list[str]]:
    replacer = PictureReplacer(TOPIC)
    return replacer.put(kind, memoryview(data), image, changed=True), replacer.notes


@pytest.mark.parametrize(
    ("suffix", "is_grey"), [(".jpg", False), (".png", False), (".webp", False), (".jpg", True), (".png", True)]
)
def test_compressed_images_keep_their_kind(tmp_path: Path, suffix: str, is_grey: bool) -> None:
    old = np.full((48, 64) if is_grey else (48, 64, 3), 80, np.uint8)
    coded = cv2.imencode(suffix, old)[1].tobytes()
    form = {".jpg": "jpeg", ".png": "png", ".webp": "webp"}[suffix]
    source = tmp_path / "a.mcap"
    with Log(source) as log:
        message = namespace(header=header(START_NS, "front"), format=f"bgr8; {form} compressed bgr8", data=coded)
        log.ros(TOPIC, COMPRESSED, message, START_NS)
    copied(source, tmp_path / "b.mcap", {0})
    stored = bytes(messages(tmp_path / "b.mcap")[0][-1])
    parsed = parse_image(IMAGE_PARSERS["sensor_msgs/CompressedImage", "cdr"], memoryview(stored))
    assert parsed.stamp_ns == START_NS
    assert b"front\0" in stored
    assert parsed.format == f"bgr8; {form} compressed bgr8"  # type: ignore[union-attr]
    back = cv2.imdecode(np.frombuffer(parsed.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert back is not None
    assert back.shape == old.shape
    assert np.abs(back.astype(int) - 175).max() <= 1


def test_a_deep_png_stays_deep() -> None:
    coded = cv2.imencode(".png", np.full((6, 8), 5000, np.uint16))[1].tobytes()
    old = CompressedImage(format="mono16; png compressed ", data=coded, frame_id="front")
    image = np.full((6, 8, 3), 200, np.uint8)
    data, notes = put(("foxglove.CompressedImage", "protobuf"), old.SerializeToString(), image)
    new = CompressedImage.FromString(data)
    assert (new.frame_id, new.format) == ("front", old.format)
    back = cv2.imdecode(np.frombuffer(new.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert back is not None
    assert back.dtype == np.uint16
    assert set(back.ravel()) == {200 * 257}
    assert notes == [f"dehazed pictures of {TOPIC} have 8 bits of precision in their 16"]


def test_the_order_a_publisher_was_given_is_kept(tmp_path: Path) -> None:
    source = tmp_path / "a.mcap"
    rgb = np.zeros((16, 16, 3), np.uint8)
    rgb[:] = (10, 90, 200)
    with Log(source) as log:
        coded = cv2.imencode(".png", rgb)[1].tobytes()
        message = namespace(header=header(START_NS), format="rgb8; png compressed rgb8", data=coded)
        log.ros(TOPIC, COMPRESSED, message, START_NS)
    copied(source, tmp_path / "b.mcap", {0})
    assert shown(source)[0][0, 0].tolist() == [200, 90, 10]
    assert shown(tmp_path / "b.mcap")[0][0, 0].tolist() == [55, 165, 245]


def test_foxglove_messages_keep_what_is_not_the_picture() -> None:
    image = picture()
    old = ProtoRawImage(frame_id="front", width=8, height=6, encoding="rgb8", step=24, data=bytes(144))
    old.timestamp.FromNanoseconds(START_NS)
    new = ProtoRawImage.FromString(put(("foxglove.RawImage", "protobuf"), old.SerializeToString(), image)[0])
    assert np.array_equal(np.frombuffer(new.data, np.uint8).reshape(6, 8, 3), image[:, :, ::-1])
    new.data = old.data
    assert new == old
    fields = {"timestamp": {"sec": 5, "nsec": 6}, "frame_id": "front", "width": 8, "height": 6, "own": "word"}
    fields |= {"encoding": "rgb8", "step": 24, "data": "A" * 192}
    text, _ = put(("foxglove.RawImage", "json"), json.dumps(fields).encode(), image)
    assert {**json.loads(text), "data": ""} == {**fields, "data": ""}
    parsed = parse_image(IMAGE_PARSERS["foxglove.RawImage", "json"], memoryview(text))
    assert isinstance(parsed, RawImage)
    assert np.array_equal(bgr_from_raw(parsed), image)


def test_a_bayer_pattern_becomes_colour_and_says_so() -> None:
    old = ProtoRawImage(width=8, height=6, encoding="bayer_rggb8", step=8, data=bytes(48))
    data, notes = put(("foxglove.RawImage", "protobuf"), old.SerializeToString(), picture())
    new = ProtoRawImage.FromString(data)
    assert (new.encoding, new.step, len(new.data)) == ("bgr8", 24, 144)
    assert notes == [f"dehazed pictures of {TOPIC} are bgr8, as bayer_rggb8 cannot be written"]


# --- videos


def video_log(path: Path, form: str) -> Path:
    with Log(path) as log:
        for n, (_, data) in enumerate(packets(*ENCODERS[form])):
            message = CompressedVideo(frame_id="front", data=data, format=form)
            message.timestamp.FromNanoseconds(START_NS + n * STEP_NS)
            log.proto(TOPIC, message, START_NS + n * STEP_NS)
    return path


@pytest.mark.parametrize("form", ["h264", "h265", "vp9"])
def test_a_video_is_encoded_anew_from_its_first_change(tmp_path: Path, form: str) -> None:
    source, out = video_log(tmp_path / "a.mcap", form), tmp_path / "b.mcap"
    changed = set(range(7, 12))
    copy = copied(source, out, changed)
    before, after = messages(source), messages(out)
    assert [m[:-1] for m in before] == [m[:-1] for m in after]
    kept = [a == b for a, b in zip(before, after, strict=True)]
    assert kept == [form == "h264" and n < 7 for n in range(20)]
    assert len(copy.notes) == 1
    assert ("which was" in copy.notes[0]) == (form != "h264")
    for n, (image, was) in enumerate(zip(shown(out), pictures(), strict=True)):
        wanted = 255 - was.astype(int) if n in changed else was.astype(int)
        assert np.abs(image - wanted).mean() < 4.0, n


def test_a_video_without_change_stays(tmp_path: Path) -> None:
    source = video_log(tmp_path / "a.mcap", "h264")
    assert copied(source, tmp_path / "b.mcap", set()).notes == []
    assert messages(source) == messages(tmp_path / "b.mcap")


def test_a_lost_picture_is_left_out_of_a_video_encoded_anew(tmp_path: Path) -> None:
    source, out = tmp_path / "a.mcap", tmp_path / "b.mcap"
    with Log(source) as log:
        for n, (_, data) in enumerate(packets(*ENCODERS["h264"])):
            log.proto(TOPIC, CompressedVideo(data=b"" if n == 8 else data, format="h264"), START_NS + n * STEP_NS)
    copied(source, out, {6})
    assert len(messages(out)) == len(messages(source)) - 1
    assert all(isinstance(frame, Frame) for frame in McapSource(out))


def test_an_odd_video_is_refused() -> None:
    with pytest.raises(UsageError, match="pictures of 95x64, which h264 cannot hold"):
        put(("foxglove.CompressedVideo", "protobuf"), CompressedVideo(format="h264").SerializeToString(),
            np.zeros((64, 95, 3), np.uint8))  # fmt: skip
