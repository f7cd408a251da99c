"""McapImageWriter: read back by the mcap libraries' own readers and by McapSource."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory
from mcap_ros2.decoder import DecoderFactory as Ros2Factory

from landtool import __version__
from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Pose
from landtool.io.mcap import McapSource, describe_mcap
from landtool.io.mcap_build import McapSchema, Motion, Transform
from landtool.io.mcap_out import McapEncoding, McapImageWriter
from landtool.io.mcap_poses import read_poses
from landtool.types import Frame

START_NS = 1_700_000_000_999_999_999
CAMERA = Camera(64, 48, 50.0, 51.0, 31.0, 23.0, "rational_polynomial", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8))
FISHEYE = Camera(64, 48, 50.0, 51.0, 31.0, 23.0, "equidistant", (0.1, 0.2, 0.3, 0.4))
SCHEMAS: tuple[McapSchema, ...] = ("ros2", "foxglove")
ENCODINGS: tuple[McapEncoding, ...] = ("raw", "jpeg", "png", "h264")


def frames(count: int = 5, width: int = 64, height: int = 48) -> list[Frame]:
    """Smooth colour pictures that move; uneven times."""
    y, x = np.mgrid[:height, :width]
    pictures = [np.dstack([3 * x + 5 * n, 4 * y, 2 * (x + y) + 20]).clip(0, 255).astype(np.uint8) for n in range(count)]
    return [Frame(n, START_NS + n * 33_333_333 + n * n, picture) for n, picture in enumerate(pictures)]


def write(path: Path, schema: McapSchema, encoding: McapEncoding, **options: Any) -> list[Frame]:
    given = frames()
    settings = {"topic": "/cam/image", "frame_id": "cam_optical", "camera": CAMERA, **options}
    with McapImageWriter(path, schema=schema, encoding=encoding, **settings) as writer:
        for frame in given:
            writer.write(frame)
    assert writer.written == len(given)
    return given


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_round_trip(tmp_path: Path, schema: McapSchema, encoding: McapEncoding) -> None:
    given = write(tmp_path / "a.mcap", schema, encoding)
    source = McapSource(tmp_path / "a.mcap")
    got = list(source)
    assert [frame.t_ns for frame in got] == [frame.t_ns for frame in given]
    assert source.info.camera == CAMERA
    assert source.info.notes == ()
    assert source.report.complete
    limit = {"raw": 0.0, "png": 0.0, "jpeg": 2.0, "h264": 3.0}[encoding]
    for ours, theirs in zip(got, given, strict=True):
        assert isinstance(ours, Frame)
        assert np.abs(ours.image.astype(int) - theirs.image).mean() <= limit


@pytest.mark.parametrize("schema", SCHEMAS)
def test_fisheye_lenses_go_by_each_schemas_own_name(tmp_path: Path, schema: McapSchema) -> None:
    write(tmp_path / "a.mcap", schema, "raw", camera=FISHEYE)
    assert McapSource(tmp_path / "a.mcap").info.camera == FISHEYE


def decoded(path: Path) -> list[tuple[Any, Any, Any, Any]]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[Ros2Factory(), ProtobufFactory()])
        return list(reader.iter_decoded_messages())


def test_ros2_as_others_read_it(tmp_path: Path) -> None:
    given = write(tmp_path / "a.mcap", "ros2", "raw", topic="/cam/image_raw")
    messages = decoded(tmp_path / "a.mcap")
    assert [item[1].topic for item in messages] == ["/cam/camera_info", "/cam/image_raw"] * 5
    assert {item[0].encoding for item in messages} == {"ros2msg"}
    for (_, _, info_log, info), (_, _, image_log, image), frame in zip(
        messages[::2], messages[1::2], given, strict=True
    ):
        assert info_log.log_time == image_log.log_time == frame.t_ns
        stamp = image.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == frame.t_ns
        assert (info.header.stamp.sec, info.header.stamp.nanosec) == (stamp.sec, stamp.nanosec)
        assert image.header.frame_id == info.header.frame_id == "cam_optical"
        assert (image.height, image.width, image.encoding, image.step) == (48, 64, "bgr8", 192)
        assert image.data == frame.image.tobytes()
        assert (info.width, info.height, info.distortion_model) == (64, 48, "rational_polynomial")
        assert list(info.d) == list(CAMERA.distortion)
        assert list(info.k) == CAMERA.matrix.ravel().tolist()
        assert list(info.p) == [50, 0, 31, 0, 0, 51, 23, 0, 0, 0, 1, 0]


@pytest.mark.parametrize(("encoding", "kind"), [("jpeg", "CompressedImage"), ("h264", "CompressedVideo")])
def test_foxglove_as_others_read_it(tmp_path: Path, encoding: McapEncoding, kind: str) -> None:
    given = write(tmp_path / "a.mcap", "foxglove", encoding)
    messages = decoded(tmp_path / "a.mcap")
    assert [item[0].name for item in messages] == ["foxglove.CameraCalibration", f"foxglove.{kind}"] * 5
    assert [item[1].topic for item in messages[:2]] == ["/cam/calibration", "/cam/image"]
    for (_, _, log, message), frame in zip(messages[1::2], given, strict=True):
        assert log.log_time == frame.t_ns
        assert message.timestamp.seconds * 10**9 + message.timestamp.nanos == frame.t_ns
        assert (message.frame_id, message.format) == ("cam_optical", encoding)
        if encoding == "jpeg":
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
            assert image is not None
            assert image.shape == (48, 64, 3)


def nal_types(data: bytes) -> list[int]:
    assert data.startswith((b"\0\0\1", b"\0\0\0\1"))
    return [unit[0] & 31 for unit in data.split(b"\0\0\1")[1:]]


def test_h264_has_parameter_sets_in_every_key_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    picture = frames(1)[0].image
    with McapImageWriter(path, schema="foxglove", topic="/v", frame_id="", camera=None, encoding="h264") as writer:
        for n in range(8):
            writer.write(Frame(n, START_NS + n * 400_000_000, np.roll(picture, n, axis=1)))
    types = [nal_types(message.data) for _, _, _, message in decoded(path)]
    keys = [n for n, units in enumerate(types) if 5 in units]
    assert keys == [0, 3, 6]  # the first at or after a second
    assert all({7, 8} <= set(types[n]) for n in keys)
    assert all(1 in units for n, units in enumerate(types) if n not in keys)


def test_h264_refuses_odd_sizes_and_changes_of_size(tmp_path: Path) -> None:
    with McapImageWriter(
        tmp_path / "a.mcap", schema="foxglove", topic="/v", frame_id="", camera=None, encoding="h264"
    ) as writer:
        with pytest.raises(UsageError, match="63x48"):
            writer.write(frames(1, width=63)[0])
        writer.write(frames(1)[0])
        with pytest.raises(UsageError, match="change the picture size"):
            writer.write(frames(1, width=62)[0])


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_same_input_same_bytes(tmp_path: Path, schema: McapSchema, encoding: McapEncoding) -> None:
    for name in ("a", "b"):
        write(tmp_path / f"{name}.mcap", schema, encoding)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.parametrize("schema", SCHEMAS)
def test_file_level_facts(tmp_path: Path, schema: McapSchema) -> None:
    path = tmp_path / "a.mcap"
    write(path, schema, "png", metadata={"input": "clip.mp4"})
    summary = describe_mcap(path)
    assert summary.profile == ("ros2" if schema == "ros2" else "")
    assert summary.library == f"landtool/{__version__}"
    assert summary.indexed
    assert not summary.problems
    assert {topic.count for topic in summary.topics} == {5}
    with path.open("rb") as file:
        records = list(make_reader(file).iter_metadata())
    assert [(record.name, record.metadata) for record in records] == [
        ("landtool", {"version": __version__, "input": "clip.mp4"})
    ]


@pytest.mark.parametrize(
    ("topic", "calibration"),
    [
        ("/cam/image_raw", "/cam/camera_info"),
        ("/cam/image_raw/compressed", "/cam/camera_info"),
        ("/image", "/camera_info"),
    ],
)
def test_camera_info_lies_beside_the_image(tmp_path: Path, topic: str, calibration: str) -> None:
    write(tmp_path / "a.mcap", "ros2", "jpeg", topic=topic)
    assert [t.name for t in describe_mcap(tmp_path / "a.mcap").camera_topics] == [calibration]
    assert McapSource(tmp_path / "a.mcap").info.camera == CAMERA


@pytest.mark.parametrize("t_ns", [None, -1, 2**31 * 10**9])
def test_times_a_log_cannot_hold_are_refused(tmp_path: Path, t_ns: int | None) -> None:
    picture = frames(1)[0].image
    with (
        McapImageWriter(
            tmp_path / "a.mcap", schema="ros2", topic="/c", frame_id="", camera=None, encoding="raw"
        ) as writer,
        pytest.raises(UsageError, match="times" if t_ns is None else "does not fit"),
    ):
        writer.write(Frame(0, t_ns, picture))


@pytest.mark.parametrize("schema", SCHEMAS)
def test_poses_read_back(tmp_path: Path, schema: McapSchema) -> None:
    path = tmp_path / "a.mcap"
    poses = [(START_NS + n, Pose.from_rotvec((n, 2.0, -3.0), (0.1 * n, 0.2, 0.3))) for n in range(4)]
    with McapImageWriter(path, schema=schema, topic="/c", frame_id="", camera=None, encoding="raw") as writer:
        for t_ns, pose in poses:
            writer.write_pose("/drone/pose", t_ns, pose, frame_id="map")
    got = read_poses(path, "/drone/pose")
    assert [t_ns for t_ns, _ in got] == [t_ns for t_ns, _ in poses]
    for (_, ours), (_, theirs) in zip(got, poses, strict=True):
        np.testing.assert_allclose(ours.translation, theirs.translation)
        np.testing.assert_allclose(ours.rotation, theirs.rotation, atol=1e-12)
    assert len(decoded(path)) == 4


def test_an_error_inside_leaves_no_open_file_and_passes_on(tmp_path: Path) -> None:
    with (
        pytest.raises(RuntimeError, match="stop"),
        McapImageWriter(
            tmp_path / "a.mcap", schema="ros2", topic="/c", frame_id="", camera=None, encoding="raw"
        ) as writer,
    ):
        raise RuntimeError("stop")
    assert writer._log.closed


MOTION = Motion(
    "map",
    "base_link",
    Pose.from_quaternion((1.0, 2.0, 3.0), (0.5, 0.5, -0.5, 0.5)),
    (0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
    np.arange(36.0).reshape(6, 6),
    np.arange(36.0, 72.0).reshape(6, 6),
)


def xyz(value: Any) -> tuple[float, float, float]:
    return value.x, value.y, value.z


def wxyz(value: Any) -> tuple[float, ...]:
    return value.w, value.x, value.y, value.z


@pytest.mark.parametrize("schema", SCHEMAS)
def test_odometry_as_others_read_it(tmp_path: Path, schema: McapSchema) -> None:
    with McapImageWriter(
        tmp_path / "a.mcap", schema=schema, topic="/c", frame_id="", camera=None, encoding="raw"
    ) as log:
        log.write_odometry("/odometry", START_NS, MOTION)
    [(kind, channel, record, message)] = decoded(tmp_path / "a.mcap")
    assert (channel.topic, record.log_time) == ("/odometry", START_NS)
    if schema == "ros2":
        assert kind.name == "nav_msgs/msg/Odometry"
        assert (message.header.frame_id, message.child_frame_id) == ("map", "base_link")
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == START_NS
        pose, covariance = message.pose.pose, message.pose.covariance
        linear, angular, spread = message.twist.twist.linear, message.twist.twist.angular, message.twist.covariance
    else:
        assert kind.name == "foxglove.Odometry"
        assert (message.frame_id, message.body_frame_id) == ("map", "base_link")
        assert message.timestamp.seconds * 10**9 + message.timestamp.nanos == START_NS
        pose, covariance = message.pose, message.pose_covariance
        linear, angular, spread = message.linear_velocity, message.angular_velocity, message.velocity_covariance
    assert xyz(pose.position) == (1.0, 2.0, 3.0)
    assert wxyz(pose.orientation) == pytest.approx((0.5, 0.5, -0.5, 0.5))
    assert (*xyz(linear), *xyz(angular)) == MOTION.twist
    assert np.array(covariance).reshape(6, 6).tolist() == MOTION.pose_covariance.tolist()
    assert np.array(spread).reshape(6, 6).tolist() == MOTION.twist_covariance.tolist()


@pytest.mark.parametrize("schema", SCHEMAS)
def test_transforms_as_others_read_them(tmp_path: Path, schema: McapSchema) -> None:
    edges = [Transform("map", "base_link", MOTION.pose), Transform("base_link", "camera", MOTION.pose.inverse())]
    with McapImageWriter(
        tmp_path / "a.mcap", schema=schema, topic="/c", frame_id="", camera=None, encoding="raw"
    ) as log:
        log.write_transforms("/tf", START_NS, edges)
    [(kind, _, _, message)] = decoded(tmp_path / "a.mcap")
    assert kind.name == {"ros2": "tf2_msgs/msg/TFMessage", "foxglove": "foxglove.FrameTransforms"}[schema]
    for given, read in zip(edges, message.transforms, strict=True):
        if schema == "ros2":
            frames, inner = (read.header.frame_id, read.child_frame_id), read.transform
            stamp_ns = read.header.stamp.sec * 10**9 + read.header.stamp.nanosec
        else:
            frames, inner = (read.parent_frame_id, read.child_frame_id), read
            stamp_ns = read.timestamp.seconds * 10**9 + read.timestamp.nanos
        assert (frames, stamp_ns) == ((given.parent, given.child), START_NS)
        assert xyz(inner.translation) == pytest.approx(given.pose.translation)
        assert wxyz(inner.rotation) == pytest.approx(given.pose.quaternion_wxyz)
    read_back = read_poses(tmp_path / "a.mcap", "/tf:map->base_link")
    assert [t_ns for t_ns, _ in read_back] == [START_NS]


@pytest.mark.parametrize("schema", SCHEMAS)
def test_odometry_is_a_drones_own_pose(tmp_path: Path, schema: McapSchema) -> None:
    with McapImageWriter(
        tmp_path / "a.mcap", schema=schema, topic="/c", frame_id="", camera=None, encoding="raw"
    ) as log:
        log.write_odometry("/odometry", START_NS, MOTION)
    [(t_ns, pose)] = read_poses(tmp_path / "a.mcap", "/odometry")
    assert t_ns == START_NS
    assert pose.translation == pytest.approx((1.0, 2.0, 3.0))
    assert pose.angle_to(MOTION.pose) < 1e-9


@pytest.mark.parametrize("grey", [False, True])
def test_h264_keeps_the_brightness(tmp_path: Path, grey: bool) -> None:
    """The stream's luma is BT.709's; FFmpeg's default rounding makes it half a level darker."""
    blocks = np.random.default_rng(0).integers(20, 236, (6, 8, 1 if grey else 3), np.uint8)
    picture = np.ascontiguousarray(np.kron(np.broadcast_to(blocks, (6, 8, 3)), np.ones((32, 32, 1), np.uint8)))
    path = tmp_path / "a.mcap"
    with McapImageWriter(path, schema="foxglove", topic="/v", frame_id="", camera=None, encoding="h264") as writer:
        writer.write(Frame(0, START_NS, picture))
    [(_, _, _, message)] = decoded(path)
    context = av.CodecContext.create("h264", "r")
    [frame] = [*context.decode(av.Packet(message.data)), *context.decode(None)]  # type: ignore[attr-defined]
    luma = frame.to_ndarray()[:192]
    exact = 16.0 + 219.0 / 255.0 * (picture @ np.array([0.0722, 0.7152, 0.2126]))
    assert abs(exact.mean() - luma.mean()) < 0.25


def test_the_time_of_logging_never_goes_back(tmp_path: Path) -> None:
    picture = frames(1)[0].image
    steps = (0, 40, 20, 20, 60)  # ms
    with McapImageWriter(
        tmp_path / "a.mcap", schema="foxglove", topic="/c", frame_id="", camera=CAMERA, encoding="png"
    ) as writer:
        for n, step in enumerate(steps):
            writer.write(Frame(n, START_NS + step * 10**6, picture))
    for topic in ("/c", "/calibration"):
        messages = [item for item in decoded(tmp_path / "a.mcap") if item[1].topic == topic]
        assert [(m[2].log_time - START_NS) // 10**6 for m in messages] == [0, 40, 40, 40, 60]
        stamps = [m[3].timestamp.seconds * 10**9 + m[3].timestamp.nanos - START_NS for m in messages]
        assert [stamp // 10**6 for stamp in stamps] == list(steps)
