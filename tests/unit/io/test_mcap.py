"""McapSource and describe_mcap over logs written by the mcap libraries: topics, clocks, cameras, damage."""

from __future__ import annotations

import base64
import json
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.writer import CompressionType

from landtool.errors import InputError, LandtoolError, UsageError
from landtool.io.mcap import McapSource, describe_mcap
from landtool.types import Frame, LostFrame
from tests.unit.io.mcap_logs import (
    NO_INDEX,
    PLAIN,
    START_NS,
    STEP_NS,
    Log,
    even_stamps,
    grey,
    namespace,
    ros_camera_info,
    ros_image,
    write_images,
)

IMAGE, COMPRESSED, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"


def numbers(frames: list[Frame | LostFrame]) -> list[int | None]:
    """Which pictures came, read off their grey level; None for a lost one."""
    return [int(frame.image[0, 0, 0]) // 10 if isinstance(frame, Frame) else None for frame in frames]


def read(path: Path, topic: str | None = None) -> tuple[McapSource, list[Frame | LostFrame]]:
    source = McapSource(path, topic=topic)
    return source, list(source)


# --- the plain case


def test_reads_every_image_with_its_stamp(tmp_path: Path) -> None:
    source, frames = read(write_images(tmp_path / "a.mcap", even_stamps(10)))
    assert numbers(frames) == list(range(10))
    assert [frame.index for frame in frames] == list(range(10))
    assert [frame.t_ns for frame in frames] == even_stamps(10)
    info = source.info
    assert (info.kind, info.width, info.height, info.encoding) == ("mcap", 64, 48, "mono8")
    assert (info.topic, info.frames_declared, info.has_clock) == ("/camera/image_raw", 10, True)
    assert info.duration_ns == 9 * STEP_NS
    assert source.report.complete
    assert source.report.decoded == source.report.declared == 10


def test_every_pass_starts_afresh(tmp_path: Path) -> None:
    with McapSource(write_images(tmp_path / "a.mcap", even_stamps(5))) as source:
        first = iter(source)
        next(first)
        assert numbers(list(source)) == list(range(5))
        assert source.report.decoded == 5
        assert list(first) == []  # the pass given up is closed


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("options", [{}, {"use_chunking": False}, NO_INDEX, {**NO_INDEX, "use_chunking": False}])
def test_with_and_without_chunks_index_and_compression(
    tmp_path: Path, compression: CompressionType, options: dict[str, Any]
) -> None:
    path = write_images(tmp_path / "a.mcap", even_stamps(6), compression=compression, chunk_size=5000, **options)
    source, frames = read(path)
    assert numbers(frames) == list(range(6))
    assert source.report.complete
    assert source.info.frames_declared == 6


# --- which topic


def test_two_image_topics_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        jpeg = cv2.imencode(".jpg", grey(3))[1].tobytes()
        for n, stamp in enumerate(even_stamps(3)):
            image = ros_image(stamp, grey(n), "mono8")
            log.ros("/cam/image_raw", IMAGE, image, stamp)
            coded = namespace(header=image.header, format="mono8; jpeg compressed ", data=jpeg)
            log.ros("/cam/image_raw/compressed", COMPRESSED, coded, stamp)
    with pytest.raises(UsageError) as caught:
        McapSource(path)
    assert "/cam/image_raw (sensor_msgs/msg/Image, 3)" in str(caught.value)
    assert "/cam/image_raw/compressed (sensor_msgs/msg/CompressedImage, 3)" in str(caught.value)
    assert caught.value.hint == "choose one with --topic"
    assert numbers(read(path, "/cam/image_raw")[1]) == [0, 1, 2]
    assert numbers(read(path, "/cam/image_raw/compressed")[1]) == [3, 3, 3]
    with pytest.raises(UsageError, match="no image topic '/cam/other'"):
        McapSource(path, topic="/cam/other")


def test_no_image_topic_lists_what_there_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.ros("/chatter", "std_msgs/msg/String", namespace(data="hello"), 5)
    with pytest.raises(InputError, match=r"no image topic; it holds /chatter \(std_msgs/msg/String, 1\)"):
        McapSource(path)


def test_an_image_topic_without_messages_does_not_make_a_choice_necessary(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log._schemas["x"] = log._writer.register_schema(IMAGE, "ros2msg", b"")
        log._writer.register_channel("/empty/image_raw", "cdr", log._schemas["x"])
        log.ros("/cam/image_raw", IMAGE, ros_image(7, grey(1), "mono8"), 9)
    assert McapSource(path).info.topic == "/cam/image_raw"
    with pytest.raises(InputError, match="/empty/image_raw has no messages"):
        McapSource(path, topic="/empty/image_raw")


def test_an_encoding_that_is_not_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.raw("/cam/image", "sensor_msgs/Image", "ros1", b"\0" * 40, 5)
    with pytest.raises(InputError, match="encoded as 'ros1'"):
        McapSource(path)


@pytest.mark.parametrize(("encoding", "text"), [("", b""), ("ros2idl", b"module sensor_msgs {};")])
def test_definitions_are_not_needed(tmp_path: Path, encoding: str, text: bytes) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.ros("/with", IMAGE, ros_image(5, grey(3), "mono8"), 5)
        log._schemas[IMAGE] = log._writer.register_schema(IMAGE, encoding, text)
        log.ros("/without", IMAGE, ros_image(5, grey(4), "mono8"), 5)
    assert numbers(read(path, "/without")[1]) == [4]


def test_one_topic_published_by_two_channels_is_one(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.ros("/cam/image_raw", IMAGE, ros_image(1_000, grey(0), "mono8"), 1_000)
        log._channels.clear()
        log.ros("/cam/image_raw", IMAGE, ros_image(2_000, grey(1), "mono8"), 2_000)
    assert numbers(read(path)[1]) == [0, 1]


# --- which clock


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        ([0] * 6, "are all 0"),
        ([START_NS] * 6, "are all the same"),
        (even_stamps(6)[::-1], "go back 5 times"),
        ([*even_stamps(5), 0], "go back once"),
    ],
)
def test_stamps_that_do_not_increase_give_way_to_the_log(tmp_path: Path, stamps: list[int], said: str) -> None:
    source, frames = read(write_images(tmp_path / "a.mcap", stamps))
    assert [frame.t_ns for frame in frames] == [START_NS + n * STEP_NS for n in range(6)]
    assert any(said in note for note in source.info.notes)
    assert any(said in note for note in source.report.notes)
    assert source.report.complete


def test_a_few_repeated_stamps_are_no_reason(tmp_path: Path) -> None:
    stamps = even_stamps(6)
    stamps[3] = stamps[2]
    source, frames = read(write_images(tmp_path / "a.mcap", stamps))
    assert [frame.t_ns for frame in frames] == stamps
    assert source.info.notes[0] == "times of /camera/image_raw that repeat the one before: 1"


def test_stamps_out_of_order_like_the_log_itself_are_kept_and_said(tmp_path: Path) -> None:
    stamps = [START_NS + n * STEP_NS for n in (0, 1, 3, 2, 4)]
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n, stamp in enumerate(stamps):
            log.ros("/camera/image_raw", IMAGE, ros_image(stamp, grey(n), "mono8"), stamp + 1000)
    source, frames = read(path)
    assert [frame.t_ns for frame in frames] == stamps
    assert any("go back once" in note for note in source.info.notes)


def test_a_single_image_keeps_its_stamp(tmp_path: Path) -> None:
    assert [frame.t_ns for frame in read(write_images(tmp_path / "a.mcap", [123]))[1]] == [123]


# --- which camera


def camera_log(path: Path, infos: dict[str, Any], image_topic: str = "/cam/image_raw") -> Path:
    with Log(path) as log:
        for topic, info in infos.items():
            log.ros(topic, INFO, info, START_NS)
        log.ros(image_topic, IMAGE, ros_image(START_NS, grey(1), "mono8"), START_NS)
    return path


@pytest.mark.parametrize("image_topic", ["/cam/image_raw", "/cam/image_raw/compressed"])
def test_camera_info_beside_the_image(tmp_path: Path, image_topic: str) -> None:
    infos = {
        "/cam/camera_info": ros_camera_info(1, 64, 48),
        "/cam2/camera_info": ros_camera_info(1, 64, 48, k=[9.0, 0, 1, 0, 9.0, 1, 0, 0, 1]),
    }
    camera = McapSource(camera_log(tmp_path / "a.mcap", infos, image_topic)).info.camera
    assert camera is not None
    assert (camera.width, camera.height) == (64, 48)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (500.0, 510.0, 31.5, 23.5)
    assert (camera.model, camera.distortion) == ("plumb_bob", (0.1, -0.2, 0.001, 0.002, 0.05))


@pytest.mark.parametrize(
    ("said", "d", "model", "distortion"),
    [
        ("plumb_bob", [1.0, 2, 3, 4], "plumb_bob", (1, 2, 3, 4, 0)),
        ("plumb_bob", [], "plumb_bob", (0, 0, 0, 0, 0)),
        ("", [], "plumb_bob", (0, 0, 0, 0, 0)),
        ("rational_polynomial", [1.0, 2, 3, 4, 5, 6, 7, 8], "rational_polynomial", (1, 2, 3, 4, 5, 6, 7, 8)),
        ("rational_polynomial", [1.0, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0], "rational_polynomial", tuple(range(1, 9))),
        ("equidistant", [1.0, 2, 3, 4], "equidistant", (1, 2, 3, 4)),
    ],
)
def test_distortion_models(tmp_path: Path, said: str, d: list[float], model: str, distortion: tuple[float]) -> None:
    info = ros_camera_info(1, 64, 48, distortion_model=said, d=d)
    camera = McapSource(camera_log(tmp_path / "a.mcap", {"/cam/camera_info": info})).info.camera
    assert camera is not None
    assert (camera.model, camera.distortion) == (model, distortion)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"k": [0.0] * 9}, "uncalibrated"),
        ({"distortion_model": "thin_prism"}, "'thin_prism' is not known"),
        ({"distortion_model": "equidistant", "d": [1.0, 2.0]}, "2 coefficients do not fit"),
        ({"distortion_model": "rational_polynomial", "d": [1.0] * 14}, "14 coefficients do not fit"),
        ({"d": [float("nan")] * 5}, "not a finite number"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_said(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    info = ros_camera_info(1, 64, 48, **changes)
    source = McapSource(camera_log(tmp_path / "a.mcap", {"/cam/camera_info": info}))
    assert source.info.camera is None
    assert any(said in note and "/cam/camera_info" in note for note in source.info.notes)


def test_the_first_valid_calibration_counts(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n, k0 in enumerate([0.0, 300.0, 400.0]):
            info = ros_camera_info(1, 64, 48, k=[k0, 0, 1, 0, 300.0, 1, 0, 0, 1])
            log.ros("/cam/camera_info", INFO, info, START_NS + n)
        log.ros("/cam/image_raw", IMAGE, ros_image(START_NS, grey(1), "mono8"), START_NS)
    camera = McapSource(path).info.camera
    assert camera is not None
    assert camera.fx == 300.0


def test_rectified_pictures_are_described_by_p(tmp_path: Path) -> None:
    path = camera_log(tmp_path / "a.mcap", {"/cam/camera_info": ros_camera_info(1, 64, 48)}, "/cam/image_rect_color")
    camera = McapSource(path).info.camera
    assert camera is not None
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (400.0, 410.0, 30.0, 20.0)
    assert not camera.has_distortion


def test_binning_and_region_of_interest_are_applied(tmp_path: Path) -> None:
    roi = namespace(x_offset=20, y_offset=10, height=96, width=128, do_rectify=False)
    info = ros_camera_info(1, 200, 150, roi=roi, binning_x=2, binning_y=2)
    camera = McapSource(camera_log(tmp_path / "a.mcap", {"/cam/camera_info": info})).info.camera
    assert camera is not None
    assert (camera.width, camera.height, camera.fx) == (64, 48, 250.0)
    assert camera.cx == pytest.approx((31.5 - 20 + 0.5) / 2 - 0.5)


def test_no_calibration_topic_is_said(tmp_path: Path) -> None:
    path = camera_log(tmp_path / "a.mcap", {"/other/camera_info": ros_camera_info(1, 64, 48)})
    source = McapSource(path)
    assert source.info.camera is None
    assert source.info.notes == ("no calibration topic belongs to /cam/image_raw",)


def foxglove_calibration(fx: float, model: str = "plumb_bob", d: tuple[float, ...] = ()) -> CameraCalibration:
    calibration = CameraCalibration(width=64, height=48, distortion_model=model)
    calibration.K.extend([fx, 0, 31.5, 0, fx, 23.5, 0, 0, 1])
    calibration.D.extend(d)
    return calibration


def foxglove_image(number: int, stamp_ns: int) -> RawImage:
    image = RawImage(width=64, height=48, encoding="mono8", step=64, data=grey(number).tobytes())
    image.timestamp.seconds, image.timestamp.nanos = divmod(stamp_ns, 1_000_000_000)
    return image


def test_foxglove_calibration_with_the_longest_common_prefix(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.proto("/drone/down/calibration", foxglove_calibration(300, "kannala_brandt", (1, 2, 3, 4)), 1)
        log.proto("/drone/front/calibration", foxglove_calibration(400), 1)
        log.proto("/drone/down/image", foxglove_image(2, START_NS), START_NS)
    source, frames = read(path)
    assert numbers(frames) == [2]
    assert frames[0].t_ns == START_NS
    camera = source.info.camera
    assert camera is not None
    assert (camera.fx, camera.model, camera.distortion) == (300.0, "equidistant", (1, 2, 3, 4))


@pytest.mark.parametrize("images", [1, 2])
def test_a_calibration_without_common_prefix_only_when_it_is_the_only_one(tmp_path: Path, images: int) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.proto("/calib", foxglove_calibration(300), 1)
        for n in range(images):
            log.proto(f"/image{n}", foxglove_image(n, START_NS), START_NS)
    assert (McapSource(path, topic="/image0").info.camera is not None) == (images == 1)


# --- compressed images


@pytest.mark.parametrize(
    ("suffix", "form", "swapped"),
    [
        (".png", "png", False),
        (".webp", "webp", False),
        (".jpg", "jpeg", False),
        (".jpg", "bgr8; jpeg compressed bgr8", False),
        (".jpg", "rgb8; jpeg compressed bgr8", False),
        (".png", "rgb8; png compressed rgb8", True),
    ],
)
def test_compressed_images(tmp_path: Path, suffix: str, form: str, swapped: bool) -> None:
    picture = np.full((48, 64, 3), (10, 120, 240), np.uint8)
    stored = picture[..., ::-1] if swapped else picture
    data = cv2.imencode(suffix, np.ascontiguousarray(stored))[1].tobytes()
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        image = ros_image(START_NS, grey(0), "mono8")
        log.ros("/c", COMPRESSED, namespace(header=image.header, format=form, data=data), START_NS)
        message = CompressedImage(data=data, format=form)
        message.timestamp.seconds = 5
        log.proto("/f", message, START_NS)
    for topic in ("/c", "/f"):
        source, frames = read(path, topic)
        assert isinstance(frames[0], Frame)
        assert np.abs(frames[0].image.astype(int) - picture).max() <= 3
        assert source.info.encoding == form


def test_foxglove_json(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    stamp = {"sec": START_NS // 10**9, "nsec": START_NS % 10**9}
    raw = {"timestamp": stamp, "width": 64, "height": 48, "encoding": "mono8", "step": 64}
    raw["data"] = base64.b64encode(grey(4).tobytes()).decode()
    png = base64.b64encode(cv2.imencode(".png", grey(5))[1].tobytes()).decode()
    calibration = {"width": 64, "height": 48, "distortion_model": "plumb_bob", "D": [], "P": []}
    calibration["K"] = [300, 0, 31.5, 0, 300, 23.5, 0, 0, 1]
    messages: list[tuple[str, str, dict[str, Any]]] = [
        ("/cam/raw", "foxglove.RawImage", raw),
        ("/cam/png", "foxglove.CompressedImage", {"timestamp": stamp, "format": "png", "data": png}),
        ("/cam/calibration", "foxglove.CameraCalibration", calibration),
    ]
    with Log(path) as log:
        for topic, kind, fields in messages:
            log.raw(topic, kind, "json", json.dumps(fields).encode(), START_NS)
        log.raw("/cam/raw", "foxglove.RawImage", "json", b'{"width": 3', START_NS)
    source, frames = read(path, "/cam/raw")
    assert numbers(frames) == [4, None]
    assert frames[0].t_ns == START_NS
    assert source.info.camera is not None
    assert numbers(read(path, "/cam/png")[1]) == [5]


# --- damage


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ({"step": 10}, "step of 10 bytes"),
        ({"data": b"\0" * 100}, "has 100 bytes of 3072"),
        ({"encoding": "32FC1"}, "not supported"),
        (b"", "has only 0 bytes"),
        (b"\0\1\0\0\0\0", "ends after 6 bytes"),
        (b"\0\x42\0\0" + b"\0" * 60, "CDR kind 0x0042"),
        (b"\0\1\0\0" + b"\xff" * 60, "ends after 64 bytes"),
    ],
)
def test_a_broken_message_costs_itself(tmp_path: Path, broken: Any, reason: str) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n, stamp in enumerate(even_stamps(5)):
            if n == 2 and isinstance(broken, bytes):
                log.raw("/camera/image_raw", IMAGE, "cdr", broken, stamp)
            else:
                image = ros_image(stamp, grey(n), "mono8")
                vars(image).update(broken if n == 2 else {})
                log.ros("/camera/image_raw", IMAGE, image, stamp)
    source, frames = read(path)
    assert numbers(frames) == [0, 1, None, 3, 4]
    assert isinstance(frames[2], LostFrame)
    assert reason in frames[2].reason
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4]
    assert (source.report.decoded, source.report.lost, source.report.complete) == (4, 1, False)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("kind", ["cut", "garbage", "empty"])
def test_a_broken_compressed_image_costs_itself(tmp_path: Path, suffix: str, kind: str, capfd: Any) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (48, 64, 3), np.uint8)
    good = cv2.imencode(suffix, noise)[1].tobytes()
    bad = {"cut": good[: len(good) // 2], "garbage": b"no picture at all", "empty": b""}[kind]
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n, stamp in enumerate(even_stamps(3)):
            coded = namespace(
                header=ros_image(stamp, grey(0), "mono8").header, format="x", data=bad if n == 1 else good
            )
            log.ros("/c", COMPRESSED, coded, stamp)
    source, frames = read(path)
    assert [type(frame) for frame in frames] == [Frame, LostFrame, Frame]
    assert frames[1].t_ns == even_stamps(3)[1]
    assert source.report.lost == 1
    assert capfd.readouterr() == ("", "")


def test_nothing_but_broken_messages_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.ros("/c", IMAGE, ros_image(1, grey(0), "odd"), 1)
    with pytest.raises(InputError, match=r"not one of the 1 messages of /c gives a picture .*'odd'"):
        McapSource(path)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk_size", [50_000, 10_000_000])
def test_a_cut_log_gives_every_whole_message(tmp_path: Path, compression: CompressionType, chunk_size: int) -> None:
    path = tmp_path / "a.mcap"
    rng = np.random.default_rng(2)
    with Log(path, compression=compression, chunk_size=chunk_size) as log:
        for n, stamp in enumerate(even_stamps(20)):
            noise = rng.integers(10 * n, 10 * n + 10, (240, 320), np.uint8)
            log.ros("/camera/image_raw", IMAGE, ros_image(stamp, noise, "mono8"), stamp)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    source, frames = read(path)
    # LZ4 and zstd give their data in blocks of up to 4 MiB and 128 KiB, what is behind the last whole one is gone
    assert 7 <= len(frames) <= 10
    assert numbers(frames) == list(range(len(frames)))
    assert source.report.truncated
    assert not source.report.complete
    assert any("the log is cut at byte" in note for note in source.report.notes)


def test_any_cut_gives_a_prefix_or_a_clear_error(tmp_path: Path) -> None:
    whole = write_images(tmp_path / "a.mcap", even_stamps(4), chunk_size=4000, **PLAIN).read_bytes()
    path = tmp_path / "cut.mcap"
    first = whole.find(b"mono8\0") + 18 + 48 * 64  # the first picture's last byte
    for length in range(1, len(whole), 97):
        path.write_bytes(whole[:length])
        if length < first:
            with pytest.raises(InputError, match=r"cut\.mcap: .*; "):
                read(path)
        else:
            source, frames = read(path)
            assert numbers(frames) == list(range(len(frames)))
            assert len(frames) >= 1
            assert source.report.truncated or len(frames) == 4


def corrupt(path: Path, number: int) -> None:
    """Flip a bit in the picture `number` of an uncompressed log."""
    data = bytearray(path.read_bytes())
    at = data.find(bytes([10 * number]) * 1000)
    data[at + 500] ^= 1
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("options", [PLAIN, {**PLAIN, **NO_INDEX}])
def test_a_chunk_with_a_wrong_crc_is_lost_and_the_rest_read(tmp_path: Path, options: dict[str, Any]) -> None:
    path = write_images(tmp_path / "a.mcap", even_stamps(8), chunk_size=6000, **options)  # two pictures a chunk
    corrupt(path, 3)
    source, frames = read(path)
    indexed = options is PLAIN
    assert numbers(frames) == ([0, 1, None, None, 4, 5, 6, 7] if indexed else [0, 1, None, 4, 5, 6, 7])
    assert [frame.index for frame in frames] == list(range(len(frames)))
    lost = frames[2]
    assert isinstance(lost, LostFrame)
    assert "CRC" in lost.reason
    assert not source.report.complete
    assert source.report.lost == (2 if indexed else 1)


def test_a_lost_chunk_takes_the_times_of_logging_when_they_are_the_clock(tmp_path: Path) -> None:
    path = write_images(tmp_path / "a.mcap", [0] * 6, chunk_size=6000, **PLAIN)
    corrupt(path, 2)
    assert [frame.t_ns for frame in read(path)[1]] == [START_NS + n * STEP_NS for n in range(6)]


def test_a_lost_chunk_without_pictures_costs_no_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path, chunk_size=3000, **PLAIN) as log:
        for n, stamp in enumerate(even_stamps(3)):
            log.ros("/camera/image_raw", IMAGE, ros_image(stamp, grey(n), "mono8"), stamp)
            log.ros("/chatter", "std_msgs/msg/String", namespace(data=f"text{n}" * 1000), stamp)
    data = bytearray(path.read_bytes())
    data[data.find(b"text1" * 10)] ^= 1
    path.write_bytes(bytes(data))
    source, frames = read(path)
    assert numbers(frames) == [0, 1, 2]
    assert source.report.complete


def test_zeroed_parts_are_stepped_over_by_the_index(tmp_path: Path) -> None:
    path = write_images(tmp_path / "a.mcap", even_stamps(20), chunk_size=6000, **PLAIN)
    data = bytearray(path.read_bytes())
    start = len(data) // 3
    data[start : start + len(data) // 10] = bytes(len(data) // 10)
    path.write_bytes(bytes(data))
    source, frames = read(path)
    seen = [number for number in numbers(frames) if number is not None]
    assert seen == sorted(seen)
    assert len(seen) >= 14
    assert seen[-1] == 19
    assert source.report.lost
    assert not source.report.complete


def with_compression(path: Path, name: bytes) -> None:
    """Rename the compression in every chunk of an LZ4 or zstd log; the new name has the length of the old."""
    data = path.read_bytes()
    old = struct.pack("<I", 4) + b"zstd"
    assert old in data
    path.write_bytes(data.replace(old, struct.pack("<I", 4) + name))


@pytest.mark.parametrize("options", [{}, NO_INDEX])
def test_an_unknown_compression_is_named(tmp_path: Path, options: dict[str, Any]) -> None:
    path = write_images(tmp_path / "a.mcap", even_stamps(4), **options)
    with_compression(path, b"brot")
    with pytest.raises(InputError, match="compression 'brot' is not known") as caught:
        McapSource(path)
    assert caught.value.file == str(path)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is no MCAP log"),
        (b"just a text, called a log", "is no MCAP log"),
        (b"\x89MCAP0\r\n", "is cut before its first topic"),
        (b"\x89MCAP0\r\n" + b"\0" * 200, "is cut before its first topic"),
        (b"\x89MCAP0\r\n" * 2, "is cut before its first topic"),
    ],
)
def test_files_that_are_no_logs(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=reason):
        McapSource(path)
    with pytest.raises(InputError, match=reason):
        describe_mcap(path)


def test_random_damage_never_escapes_as_another_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    whole = write_images(tmp_path / "a.mcap", even_stamps(4), chunk_size=4000).read_bytes()
    path = tmp_path / "b.mcap"
    for _ in range(150):
        data = bytearray(whole)
        for at in rng.integers(8, len(data), 6):
            data[at] = rng.integers(0, 256)
        path.write_bytes(bytes(data))
        with suppress(LandtoolError):
            _, frames = read(path)
            assert [frame.index for frame in frames] == list(range(len(frames)))


# --- the summary


@pytest.mark.parametrize("options", [{}, NO_INDEX])
def test_describe(tmp_path: Path, options: dict[str, Any]) -> None:
    path = tmp_path / "a.mcap"
    with Log(path, **options) as log:
        log.ros("/cam/camera_info", INFO, ros_camera_info(1, 64, 48), START_NS)
        for n in range(3):
            log.ros("/cam/image_raw", IMAGE, ros_image(1, grey(n), "mono8"), START_NS + n * STEP_NS)
        log.ros("/chatter", "std_msgs/msg/String", namespace(data="x"), START_NS)
    summary = describe_mcap(path)
    assert (summary.profile, summary.library) == ("ros2", "test")
    assert (summary.start_ns, summary.end_ns) == (START_NS, START_NS + 2 * STEP_NS)
    assert summary.indexed == (not options)
    assert [(t.name, t.type, t.encoding, t.count) for t in summary.topics] == [
        ("/cam/camera_info", INFO, "cdr", 1),
        ("/cam/image_raw", IMAGE, "cdr", 3),
        ("/chatter", "std_msgs/msg/String", "cdr", 1),
    ]
    assert [topic.name for topic in summary.image_topics] == ["/cam/image_raw"]
    assert [topic.name for topic in summary.camera_topics] == ["/cam/camera_info"]
    camera_topic = summary.camera_topic_of("/cam/image_raw")
    assert camera_topic is not None
    assert camera_topic.name == "/cam/camera_info"
    assert bool(summary.problems) == bool(options)


def test_describe_of_a_cut_log_says_so(tmp_path: Path) -> None:
    path = write_images(tmp_path / "a.mcap", even_stamps(8), chunk_size=6000, **PLAIN)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    summary = describe_mcap(path)
    assert not summary.indexed
    assert summary.image_topics[0].count in (3, 4)
    assert any("cut at byte" in problem for problem in summary.problems)
