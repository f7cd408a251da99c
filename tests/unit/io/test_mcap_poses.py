"""read_poses over every message type, written by the mcap libraries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from landtool.errors import InputError, UsageError
from landtool.geometry import Pose
from landtool.io.mcap import describe_mcap
from landtool.io.mcap_poses import read_poses
from tests.unit.io.mcap_logs import START_NS, STEP_NS, Log, header, namespace


def pose_at(n: int) -> Pose:
    return Pose.from_rotvec((1.0 + n, -2.0, 3.5), (0.1, 0.05 * n, -0.4))


def quaternion(pose: Pose) -> dict[str, float]:
    return dict(zip("wxyz", pose.quaternion_wxyz.tolist(), strict=True))


def point(pose: Pose) -> dict[str, float]:
    return dict(zip("xyz", pose.translation.tolist(), strict=True))


def ros_pose(pose: Pose) -> Any:
    return namespace(position=namespace(**point(pose)), orientation=namespace(**quaternion(pose)))


def ros_transform(pose: Pose, stamp_ns: int, parent: str = "map", child: str = "base_link") -> Any:
    transform = namespace(translation=namespace(**point(pose)), rotation=namespace(**quaternion(pose)))
    return namespace(header=header(stamp_ns, parent), child_frame_id=child, transform=transform)


def odometry(pose: Pose, stamp_ns: int) -> Any:
    zero = namespace(x=0.0, y=0.0, z=0.0)
    twist = namespace(twist=namespace(linear=zero, angular=zero), covariance=[0.0] * 36)
    with_covariance = namespace(pose=ros_pose(pose), covariance=[0.0] * 36)
    return namespace(header=header(stamp_ns, "odom"), child_frame_id="base_link", pose=with_covariance, twist=twist)


ROS: dict[str, Callable[[Pose, int], Any]] = {
    "nav_msgs/msg/Odometry": odometry,
    "geometry_msgs/msg/PoseStamped": lambda pose, t: namespace(header=header(t, "map"), pose=ros_pose(pose)),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda pose, t: namespace(
        header=header(t, "map"), pose=namespace(pose=ros_pose(pose), covariance=[0.0] * 36)
    ),
    "geometry_msgs/msg/TransformStamped": ros_transform,
    "tf2_msgs/msg/TFMessage": lambda pose, t: namespace(transforms=[ros_transform(pose, t)]),
}


def frame_transform(pose: Pose, stamp_ns: int) -> FrameTransform:
    message = FrameTransform(parent_frame_id="map", child_frame_id="base_link")
    message.timestamp.seconds, message.timestamp.nanos = divmod(stamp_ns, 10**9)
    for name, value in point(pose).items():
        setattr(message.translation, name, value)
    for name, value in quaternion(pose).items():
        setattr(message.rotation, name, value)
    return message


def pose_in_frame(pose: Pose, stamp_ns: int) -> PoseInFrame:
    message = PoseInFrame(frame_id="map")
    message.timestamp.seconds, message.timestamp.nanos = divmod(stamp_ns, 10**9)
    for name, value in point(pose).items():
        setattr(message.pose.position, name, value)
    for name, value in quaternion(pose).items():
        setattr(message.pose.orientation, name, value)
    return message


def foxglove_odometry(pose: Pose, stamp_ns: int) -> Odometry:
    message = Odometry(frame_id="map", body_frame_id="base_link")
    message.timestamp.seconds, message.timestamp.nanos = divmod(stamp_ns, 10**9)
    message.pose.CopyFrom(pose_in_frame(pose, stamp_ns).pose)
    return message


FOXGLOVE: dict[str, Callable[[Pose, int], Any]] = {
    "Odometry": foxglove_odometry,
    "FrameTransform": frame_transform,
    "FrameTransforms": lambda pose, t: FrameTransforms(transforms=[frame_transform(pose, t)]),
    "PoseInFrame": pose_in_frame,
}


def assert_poses(got: tuple[tuple[int, Pose], ...], numbers: list[int]) -> None:
    assert [t_ns for t_ns, _ in got] == [START_NS + n * STEP_NS for n in numbers]
    for n, (_, pose) in zip(numbers, got, strict=True):
        np.testing.assert_allclose(pose.translation, pose_at(n).translation)
        np.testing.assert_allclose(pose.rotation, pose_at(n).rotation, atol=1e-12)


@pytest.mark.parametrize("kind", list(ROS))
def test_ros2_types(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n in range(4):
            log.ros("/ego", kind, ROS[kind](pose_at(n), START_NS + n * STEP_NS), 7 + n)
    assert_poses(read_poses(path, "/ego"), [0, 1, 2, 3])
    assert [topic.name for topic in describe_mcap(path).pose_topics] == ["/ego"]


@pytest.mark.parametrize("kind", list(FOXGLOVE))
def test_foxglove_types(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n in range(4):
            log.proto("/ego", FOXGLOVE[kind](pose_at(n), START_NS + n * STEP_NS), 7 + n)
    assert_poses(read_poses(path, "/ego"), [0, 1, 2, 3])
    assert [topic.name for topic in describe_mcap(path).pose_topics] == ["/ego"]


def test_sorted_by_stamp_and_without_repeats(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n in (0, 2, 1, 2, 3):
            stamp = START_NS + n * STEP_NS
            log.ros("/ego", "nav_msgs/msg/Odometry", odometry(pose_at(n), stamp), stamp)
    assert_poses(read_poses(path, "/ego"), [0, 1, 2, 3])


def test_zero_stamps_give_way_to_the_times_of_logging(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n in range(3):
            log.ros("/ego", "nav_msgs/msg/Odometry", odometry(pose_at(n), 0), START_NS + n * STEP_NS)
    assert_poses(read_poses(path, "/ego"), [0, 1, 2])


def tf_log(path: Path, *, second_moves: bool) -> Path:
    with Log(path) as log:
        for n in range(3):
            stamp = START_NS + n * STEP_NS
            mount = ros_transform(pose_at(n if second_moves else 9), stamp, "base_link", "camera")
            message = namespace(transforms=[mount, ros_transform(pose_at(n), stamp)])
            log.ros("/tf", "tf2_msgs/msg/TFMessage", message, stamp)
    return path


def test_the_only_moving_transform_is_meant(tmp_path: Path) -> None:
    assert_poses(read_poses(tf_log(tmp_path / "a.mcap", second_moves=False), "/tf"), [0, 1, 2])


def test_several_moving_transforms_need_a_name(tmp_path: Path) -> None:
    path = tf_log(tmp_path / "a.mcap", second_moves=True)
    with pytest.raises(UsageError, match="holds 2 transforms: base_link->camera, map->base_link") as caught:
        read_poses(path, "/tf")
    assert caught.value.hint == "name one, as /tf:base_link->camera"
    assert_poses(read_poses(path, "/tf:map->base_link"), [0, 1, 2])
    with pytest.raises(UsageError, match="has no transform map->drone; it has base_link->camera, map->base_link"):
        read_poses(path, "/tf:map->drone")


def test_topics_that_give_no_poses(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        log.ros("/ego", "nav_msgs/msg/Odometry", odometry(pose_at(0), 1), 1)
        log.ros("/chatter", "std_msgs/msg/String", namespace(data="x"), 2)
        log.raw("/broken", "geometry_msgs/msg/PoseStamped", "cdr", b"\0\1\0\0", 3)
    with pytest.raises(UsageError, match="no topic '/other'") as caught:
        read_poses(path, "/other")
    assert "/ego" in caught.value.hint
    with pytest.raises(UsageError, match="/chatter is of type 'std_msgs/msg/String'"):
        read_poses(path, "/chatter")
    with pytest.raises(InputError, match="/broken gives no poses: 1 broken"):
        read_poses(path, "/broken")


def test_a_broken_pose_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n in range(3):
            message = odometry(pose_at(n), START_NS + n * STEP_NS)
            if n == 1:
                message.pose.pose.orientation = namespace(x=0.0, y=0.0, z=0.0, w=0.0)
            log.ros("/ego", "nav_msgs/msg/Odometry", message, n)
    assert_poses(read_poses(path, "/ego"), [0, 2])
