"""track.mcap of hand-made results, read by the mcap library's own reader and decoder."""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from landtool import __version__
from landtool.camera import Camera
from landtool.draw import Overlay
from landtool.errors import InputError, UsageError
from landtool.geometry import Pose
from landtool.io.calibration import read_camera
from landtool.io.mcap import McapSource
from landtool.io.mcap_poses import read_poses
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.results_log.sink import McapSink
from landtool.sink import SinkSetup
from landtool.sinks import VideoSink, write_all
from landtool.types import (
    Detection,
    Frame,
    FrameResult,
    LostFrame,
    PadPose,
    Prediction,
    TagObservation,
    Track,
)

START_NS = 1_700_000_000_999_999_999
STEP_NS = 33_333_333
CAMERA = Camera(160, 120, 150.0, 151.0, 80.0, 59.0)
FISHEYE = replace(CAMERA, model="equidistant", distortion=(0.1, 0.0, 0.0, 0.0))
PAD = PadSpec()
WORLD_T_BODY = Pose.from_rotvec((4.0, 5.0, 6.0), (0.0, 0.0, 0.3))
CORNERS = np.array([[70.0, 50.0], [90.0, 50.0], [90.0, 70.0], [70.0, 70.0]])
EVERY_FRAME = ("/camera/image", "/camera/calibration", "/camera/annotations", "/landing/annotated", "/landing/scene")


def track_at(n: int) -> Track:
    state = np.array([4.0 + 0.1 * n, 5.0, 1.0, -0.5])
    covariance = np.arange(16.0).reshape(4, 4) * 1e-3
    covariance = covariance + covariance.T + np.eye(4)
    later = [Prediction(h, state[:2] + h * state[2:], np.eye(2)) for h in (0.25, 0.5)]
    return Track(1, "confirmed", "world", state, covariance, 1.0, 0.5, later[1].xy_m, tuple(later))


def result_at(n: int, **changes: Any) -> FrameResult:
    camera_T_pad = Pose.from_rotvec((0.1 * n, -0.05, 4.0), (np.pi - 0.1, 0.0, 0.0))
    pose = PadPose(camera_T_pad, np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) * 1e-4, "tag", 0.1, 0.2)
    body_T_pad = STRAIGHT_DOWN @ camera_T_pad
    values: dict[str, Any] = {
        "stage": "near",
        "detections": (Detection("pad", 0.75, 40.0, 30.0, 120.5, 90.25),),
        "tags": (TagObservation("tag36h11", 5, 0, 50.0, CORNERS, np.eye(8)),),
        "pose": pose,
        "world_T_body": WORLD_T_BODY,
        "body_T_pad": body_T_pad,
        "world_T_pad": WORLD_T_BODY @ body_T_pad,
        "tracks": (track_at(n),),
    }
    return FrameResult(n, START_NS + n * STEP_NS, **{**values, **changes})


def frame_at(result: FrameResult) -> Frame:
    picture = np.full((CAMERA.height, CAMERA.width, 3), 60, np.uint8)
    picture[40:60, 50:80] = (30, 20, 200)
    return Frame(result.index, result.t_ns, picture)


def camera_T_world(_: FrameResult) -> Pose:
    return (WORLD_T_BODY @ STRAIGHT_DOWN).inverse()


def setup_in(folder: Path) -> SinkSetup:
    return SinkSetup(
        folder,
        overlay=Overlay(CAMERA, PAD),
        camera=CAMERA,
        pad=PAD,
        body_T_camera=STRAIGHT_DOWN,
        camera_T_reference=camera_T_world,
        provenance=lambda: {"command": "track", "inputs": json.dumps([{"path": "a.mp4", "sha256": "ab"}])},
        recording=Path("a.mp4"),
    )


@dataclass
class Read:
    """A log as others read it: (log time, publish time, message) by topic, and the rest."""

    topics: dict[str, list[tuple[int, int, Any]]] = field(default_factory=lambda: defaultdict(list))
    schemas: dict[str, str] = field(default_factory=dict)
    log_times: list[int] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)

    def messages(self, topic: str) -> list[Any]:
        return [message for _, _, message in self.topics[topic]]


def read(path: Path) -> Read:
    log = Read()
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, record, message in reader.iter_decoded_messages(log_time_order=False):
            assert schema is not None
            log.topics[channel.topic].append((record.log_time, record.publish_time, message))
            log.schemas[channel.topic] = schema.name
            log.log_times.append(record.log_time)
        log.metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        log.attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
    return log


def ns(stamp: Any) -> int:
    return int(stamp.seconds) * 10**9 + int(stamp.nanos)


def written(folder: Path, results: list[FrameResult], setup: SinkSetup | None = None) -> Read:
    with McapSink(setup or setup_in(folder)) as sink:
        write_all(((frame_at(result), result) for result in results), [sink])
    return read(folder / "track.mcap")


def position(pose: Any) -> list[float]:
    return [pose.position.x, pose.position.y, pose.position.z]


def quaternion(turn: Any) -> list[float]:
    return [turn.w, turn.x, turn.y, turn.z]


def test_every_frame_has_all_its_messages_with_its_time(tmp_path: Path) -> None:
    log = written(tmp_path, [result_at(n) for n in range(4)])
    times = [START_NS + n * STEP_NS for n in range(4)]
    for topic in (*EVERY_FRAME, "/landing/pose", "/landing/track", "/tf"):
        assert [(logged, said) for logged, said, _ in log.topics[topic]] == [(t, t) for t in times], topic
    for topic in (*EVERY_FRAME[:-1], "/landing/pose", "/landing/track", "/landing/status"):
        assert {ns(m.timestamp) for m in log.messages(topic)} <= set(times), topic
    assert {m.frame_id for t in (*EVERY_FRAME[:2], "/landing/annotated", "/landing/pose") for m in log.messages(t)} == {
        "camera_optical"
    }
    assert log.schemas == {
        "/camera/image": "foxglove.CompressedImage",
        "/camera/calibration": "foxglove.CameraCalibration",
        "/camera/annotations": "foxglove.ImageAnnotations",
        "/landing/annotated": "foxglove.CompressedImage",
        "/landing/pose": "foxglove.PoseInFrame",
        "/landing/track": "foxglove.Odometry",
        "/landing/scene": "foxglove.SceneUpdate",
        "/landing/status": "foxglove.Log",
        "/tf": "foxglove.FrameTransforms",
    }


def test_boxes_tags_and_the_target_are_marked_half_a_pixel_on(tmp_path: Path) -> None:
    result = result_at(1)
    [message] = written(tmp_path, [result]).messages("/camera/annotations")
    box, tag, outline, ahead = ([(p.x, p.y) for p in line.points] for line in message.points)
    assert box == [(40.5, 30.5), (121.0, 30.5), (121.0, 90.75), (40.5, 90.75)]
    np.testing.assert_allclose(tag, CORNERS + 0.5)
    assert result.pose is not None
    camera_T_pad = result.pose.camera_T_pad
    np.testing.assert_allclose(outline, CAMERA.project(camera_T_pad.apply(PAD.outline_m)) + 0.5)
    assert [text.text for text in message.texts] == ["pad 0.75", "5", "tag 4.00 m", "+0.25 s", "+0.5 s"]
    track = result.tracks[0]
    assert result.world_T_pad is not None
    height = result.world_T_pad.translation[2]
    places = [[*xy, height] for xy in (track.state[:2], *(p.xy_m for p in track.predictions))]
    np.testing.assert_allclose(ahead, CAMERA.project(camera_T_world(result).apply(np.array(places))) + 0.5)


def test_the_distance_is_written_in_the_picture_when_the_target_is_larger(tmp_path: Path) -> None:
    near = PadPose(Pose.from_rotvec((0.0, 0.0, 0.5), (np.pi, 0.0, 0.0)), np.eye(6), "target", 0.1, 0.2)
    behind = replace(near, camera_T_pad=Pose.from_rotvec((0.0, 0.0, -0.5), (np.pi, 0.0, 0.0)))
    log = written(tmp_path, [result_at(0, pose=near, other_poses=(behind,), tracks=(), tags=(), detections=())])
    [text] = log.messages("/camera/annotations")[0].texts
    assert text.text == "target 0.50 m"
    assert 0 <= text.position.x < CAMERA.width
    assert 0 <= text.position.y <= CAMERA.height


def test_poses_transforms_and_track_are_the_results(tmp_path: Path) -> None:
    results = [result_at(n) for n in range(3)]
    log = written(tmp_path, results)
    for result, pose, tree, odometry in zip(
        results, log.messages("/landing/pose"), log.messages("/tf"), log.messages("/landing/track"), strict=True
    ):
        assert result.pose is not None
        assert result.world_T_pad is not None
        camera_T_pad = result.pose.camera_T_pad
        assert position(pose.pose) == camera_T_pad.translation.tolist()
        assert quaternion(pose.pose.orientation) == camera_T_pad.quaternion_wxyz.tolist()
        edges = {(t.parent_frame_id, t.child_frame_id): t for t in tree.transforms}
        place = [*result.tracks[0].state[:2], result.world_T_pad.translation[2]]
        expected = {
            ("map", "base_link"): WORLD_T_BODY,
            ("base_link", "camera_optical"): STRAIGHT_DOWN,
            ("camera_optical", "pad"): camera_T_pad,
            ("map", "platform"): Pose(np.eye(3), np.array(place)),
        }
        assert set(edges) == set(expected)
        for name, wanted in expected.items():
            moved = edges[name].translation
            assert [moved.x, moved.y, moved.z] == wanted.translation.tolist()
            assert quaternion(edges[name].rotation) == wanted.quaternion_wxyz.tolist()
            assert ns(edges[name].timestamp) == result.t_ns
        track = result.tracks[0]
        assert (odometry.frame_id, odometry.body_frame_id) == ("map", "platform")
        assert position(odometry.pose) == place
        assert [odometry.linear_velocity.x, odometry.linear_velocity.y] == track.state[2:].tolist()
        where, speed = (np.reshape(c, (6, 6)) for c in (odometry.pose_covariance, odometry.velocity_covariance))
        assert where[:2, :2].tolist() == track.covariance[:2, :2].tolist()
        assert speed[:2, :2].tolist() == track.covariance[2:, 2:].tolist()
        assert np.count_nonzero(where) == np.count_nonzero(speed) == 4


def test_the_scene_holds_the_pad_the_ellipsoid_and_the_track(tmp_path: Path) -> None:
    other = replace(result_at(5).pose, method="box")  # type: ignore[type-var]
    [scene] = written(tmp_path, [result_at(1, other_poses=(other,))]).messages("/landing/scene")
    pad, second, track = scene.entities
    assert [(e.id, e.frame_id) for e in scene.entities] == [
        ("pad", "camera_optical"),
        ("pad 2", "camera_optical"),
        ("track 1", "map"),
    ]
    assert all(e.lifetime.seconds + e.lifetime.nanos > 0 for e in scene.entities)
    assert [pad.cubes[0].size.x, pad.cylinders[0].size.x, pad.cylinders[1].size.x] == pytest.approx([1.1, 1.0, 0.84])
    assert sorted([pad.spheres[0].size.x, pad.spheres[0].size.y, pad.spheres[0].size.z]) == pytest.approx(
        [0.02, 0.02 * 2**0.5, 0.02 * 3**0.5]
    )
    assert (pad.cubes[0].color.a, second.cubes[0].color.a) == (1.0, pytest.approx(0.35))
    assert len(track.lines[0].points) == 3


def test_the_status_says_stage_and_reason_where_they_change(tmp_path: Path) -> None:
    results = [
        result_at(0, stage="far", reason="no box"),
        result_at(1, stage="far", reason="no box"),
        result_at(2),
        result_at(3, status="damaged", reason="concealed"),
        result_at(4, stage=None),
        result_at(5),
    ]
    log = written(tmp_path, results)
    said = [((t - START_NS) // STEP_NS, m.message, m.level) for t, _, m in log.topics["/landing/status"]]
    assert said == [(0, "far: no box", 2), (2, "near", 2), (3, "near: concealed", 3), (5, "near", 2)]


def test_unknown_things_have_no_messages(tmp_path: Path) -> None:
    nothing = FrameResult(0, START_NS)
    log = written(tmp_path, [nothing], SinkSetup(tmp_path))
    assert set(log.topics) == {"/camera/image", "/camera/annotations", "/landing/annotated"}
    assert log.attachments == {}
    assert not log.messages("/camera/annotations")[0].points


def test_a_track_without_a_height_is_not_placed(tmp_path: Path) -> None:
    log = written(tmp_path, [result_at(0, pose=None, body_T_pad=None, world_T_pad=None)])
    assert "/landing/track" not in log.topics
    assert len(log.messages("/tf")[0].transforms) == 2


def test_lost_frames_have_no_pictures_but_a_track_that_coasts(tmp_path: Path) -> None:
    lost = result_at(1, pose=None, body_T_pad=None, world_T_pad=None, detections=(), tags=(), status="damaged")
    unknown = LostFrame(2, None, "no picture")
    with McapSink(setup_in(tmp_path)) as sink:
        sink.write(frame_at(result_at(0)), result_at(0))
        sink.write(LostFrame(1, lost.t_ns, "no picture"), lost)
        sink.write(unknown, FrameResult(2, None))
        sink.write(frame_at(result_at(3)), result_at(3))
    log = read(tmp_path / "track.mcap")
    assert (len(log.topics["/camera/image"]), len(log.topics["/landing/track"])) == (2, 3)
    height = [m.pose.position.z for m in log.messages("/landing/track")]
    assert height[1] == height[0]


def test_the_time_of_logging_never_goes_back(tmp_path: Path) -> None:
    order = (0, 3, 1, 1, 4)
    log = written(tmp_path, [result_at(n) for n in order])
    assert log.log_times == sorted(log.log_times)
    images, marks = (log.messages(t) for t in ("/camera/image", "/camera/annotations"))
    assert [ns(m.timestamp) for m in images] == [START_NS + n * STEP_NS for n in order]
    assert [ns(m.timestamp) for m in marks] == [START_NS + n * STEP_NS for n in order]
    assert [said for _, said, _ in log.topics["/camera/image"]] == [ns(m.timestamp) for m in images]


def test_metadata_and_attachments(tmp_path: Path) -> None:
    assumed = replace(CAMERA, assumed="pinhole of 60 degrees")
    log = written(tmp_path, [result_at(0)], replace(setup_in(tmp_path), camera=assumed))
    facts = log.metadata["landtool"]
    assert (facts["version"], facts["command"], facts["camera_assumed"]) == (__version__, "track", assumed.assumed)
    assert json.loads(facts["inputs"]) == [{"path": "a.mp4", "sha256": "ab"}]
    (tmp_path / "camera.yaml").write_bytes(log.attachments["camera.yaml"])
    (tmp_path / "pad.toml").write_bytes(log.attachments["pad.toml"])
    assert replace(read_camera(tmp_path / "camera.yaml"), assumed="") == CAMERA
    assert PadSpec.read(tmp_path / "pad.toml") == PAD


def test_a_fisheye_goes_by_foxgloves_name(tmp_path: Path) -> None:
    log = written(tmp_path, [result_at(0)], replace(setup_in(tmp_path), camera=FISHEYE))
    assert log.messages("/camera/calibration")[0].distortion_model == "kannala_brandt"
    assert McapSource(tmp_path / "track.mcap", topic="/camera/image").info.camera == FISHEYE


def test_a_picture_of_another_size_has_no_calibration(tmp_path: Path) -> None:
    log = written(tmp_path, [result_at(0)], replace(setup_in(tmp_path), camera=CAMERA.scaled(320, 240)))
    assert "/camera/calibration" not in log.topics
    assert len(log.messages("/camera/annotations")[0].points) == 2  # box and tag: pixels need no camera


def test_landtool_reads_its_own_log(tmp_path: Path) -> None:
    results = [result_at(n) for n in range(3)]
    written(tmp_path, results)
    source = McapSource(tmp_path / "track.mcap", topic="/camera/image")
    frames = [frame for frame in source if isinstance(frame, Frame)]
    assert [frame.t_ns for frame in frames] == [result.t_ns for result in results]
    assert source.info.camera == CAMERA
    assert np.abs(frames[0].image.astype(int) - frame_at(results[0]).image).mean() < 2.0
    poses = read_poses(tmp_path / "track.mcap", "/tf:map->base_link")
    assert [t_ns for t_ns, _ in poses] == [result.t_ns for result in results]
    tracked = read_poses(tmp_path / "track.mcap", "/landing/track")
    assert [pose.translation[0] for _, pose in tracked] == [result.tracks[0].state[0] for result in results]


def test_a_picture_is_drawn_once_for_all_sinks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    draw = Overlay.draw

    def counted(self: Overlay, frame: Frame, result: FrameResult, seen_from: Pose | None = None) -> Any:
        drawn.append(frame.index)
        return draw(self, frame, result, seen_from)

    monkeypatch.setattr(Overlay, "draw", counted)
    setup = setup_in(tmp_path)
    with VideoSink(setup) as video, McapSink(setup) as log:
        write_all(((frame_at(r), r) for r in (result_at(n) for n in range(3))), [video, log])
    assert drawn == [0, 1, 2]
    [first, *_] = read(tmp_path / "track.mcap").messages("/landing/annotated")
    image = cv2.imdecode(np.frombuffer(first.data, np.uint8), cv2.IMREAD_COLOR)
    expected = draw(Overlay(CAMERA, PAD), frame_at(result_at(0)), result_at(0), camera_T_world(result_at(0)))
    assert image is not None
    assert np.abs(image.astype(int) - expected).mean() < 4.0


def test_frames_without_a_clock_are_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught, McapSink(replace(setup_in(tmp_path), has_clock=False)):
        pytest.fail("the block must not run")
    assert str(caught.value) == (
        "a.mp4: frames without times cannot be written to an MCAP log; give the clock with --fps"
    )
    with pytest.raises(UsageError, match=r"frame 0 has no time.*--fps"):
        written(tmp_path, [replace(result_at(0), t_ns=None)])
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_described_leaves_nothing(tmp_path: Path) -> None:
    def gone() -> dict[str, str]:
        raise InputError("cannot be read")

    with pytest.raises(InputError):
        written(tmp_path, [result_at(0)], replace(setup_in(tmp_path), provenance=gone))
    assert list(tmp_path.iterdir()) == []


def test_same_results_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        written(tmp_path / name, [result_at(n) for n in range(2)])
    assert (tmp_path / "a/track.mcap").read_bytes() == (tmp_path / "b/track.mcap").read_bytes()
