"""The drone's own poses from an MCAP topic: odometry, stamped poses and transforms of ROS 2 and Foxglove."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Pose_pb2 import Pose as ProtoPose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from mcap.records import Channel, Schema

from landtool.errors import InputError, UsageError
from landtool.geometry import Pose
from landtool.io.mcap_cdr import BrokenMessageError, CdrReader
from landtool.io.mcap_clock import ClockCheck
from landtool.io.mcap_messages import parse_proto, plain_type, proto_time_ns
from landtool.io.mcap_stream import LogMessage, LogReader


@dataclass(frozen=True, eq=False)
class StampedTransform:
    """`parent_T_child` at one time; child is empty where the message does not name it."""

    stamp_ns: int
    parent: str
    child: str
    pose: Pose


def _ros_pose(cdr: CdrReader) -> Pose:
    """Read a geometry_msgs/Pose or Transform: x y z, then the quaternion x y z w."""
    x, y, z, qx, qy, qz, qw = cdr.float64s(7)
    return Pose.from_quaternion((x, y, z), (qw, qx, qy, qz))


def _ros_stamped(data: memoryview) -> list[StampedTransform]:
    cdr = CdrReader(data)
    return [StampedTransform(cdr.stamp_ns(), cdr.string(), "", _ros_pose(cdr))]


def _ros_with_child(cdr: CdrReader) -> StampedTransform:
    return StampedTransform(cdr.stamp_ns(), cdr.string(), cdr.string(), _ros_pose(cdr))


def _ros_tf(data: memoryview) -> list[StampedTransform]:
    cdr = CdrReader(data)
    return [_ros_with_child(cdr) for _ in range(cdr.uint32())]


def _proto_pose(data: memoryview) -> list[StampedTransform]:
    message = parse_proto(PoseInFrame(), data)
    return [StampedTransform(proto_time_ns(message.timestamp), message.frame_id, "", _of_proto(message.pose))]


def _proto_odometry(data: memoryview) -> list[StampedTransform]:
    message = parse_proto(Odometry(), data)
    stamp_ns = proto_time_ns(message.timestamp)
    return [StampedTransform(stamp_ns, message.frame_id, message.body_frame_id, _of_proto(message.pose))]


def _of_proto(message: ProtoPose) -> Pose:
    p, q = message.position, message.orientation
    return Pose.from_quaternion((p.x, p.y, p.z), (q.w, q.x, q.y, q.z))


def _proto_transform(message: FrameTransform) -> StampedTransform:
    p, q = message.translation, message.rotation
    pose = Pose.from_quaternion((p.x, p.y, p.z), (q.w, q.x, q.y, q.z))
    stamp_ns = proto_time_ns(message.timestamp)
    return StampedTransform(stamp_ns, message.parent_frame_id, message.child_frame_id, pose)


def _proto_transforms(data: memoryview) -> list[StampedTransform]:
    return [_proto_transform(transform) for transform in parse_proto(FrameTransforms(), data).transforms]


PoseParser = Callable[[memoryview], list[StampedTransform]]
# (message type without ROS 2's "/msg/", message encoding) -> parser
POSE_PARSERS: dict[tuple[str, str], PoseParser] = {
    ("nav_msgs/Odometry", "cdr"): lambda data: [_ros_with_child(CdrReader(data))],
    ("geometry_msgs/PoseStamped", "cdr"): _ros_stamped,
    ("geometry_msgs/PoseWithCovarianceStamped", "cdr"): _ros_stamped,
    ("geometry_msgs/TransformStamped", "cdr"): lambda data: [_ros_with_child(CdrReader(data))],
    ("tf2_msgs/TFMessage", "cdr"): _ros_tf,
    ("foxglove.Odometry", "protobuf"): _proto_odometry,
    ("foxglove.PoseInFrame", "protobuf"): _proto_pose,
    ("foxglove.FrameTransform", "protobuf"): lambda data: [_proto_transform(parse_proto(FrameTransform(), data))],
    ("foxglove.FrameTransforms", "protobuf"): _proto_transforms,
}
POSE_TYPES = frozenset(name for name, _ in POSE_PARSERS)
_HINT = f"give a topic of {', '.join(sorted(POSE_TYPES))}"


def read_poses(path: Path, topic: str) -> tuple[tuple[int, Pose], ...]:
    """Return (t_ns, world_T_body) from a pose topic, sorted by time, repeated times left out.

    topic: its name; of a topic with several transforms `NAME:PARENT->CHILD`, such as `/tf:map->base_link`, or just
    the name when only one of them moves. Times are the messages' stamps by the same rule as the pictures' are.
    Messages that are broken are left out. Raises UsageError for a topic that is not there, is of no pose type or
    holds several moving transforms, InputError when it gives no poses.
    """
    name, pair = _split(topic)
    reader = LogReader(path)
    found, broken = _collect(reader, path, name)
    parent, child = pair or _only_moving(found, path, name)
    rows = [row for row in found if (row.transform.parent, row.transform.child) == (parent, child)]
    if not rows:
        known = ", ".join(f"{a}->{b}" for a, b in _pairs(found)) or f"nothing ({broken} broken messages)"
        if pair:
            raise UsageError(f"{name} has no transform {parent}->{child}; it has {known}", file=path, hint=_HINT)
        raise InputError(f"{name} gives no poses: {broken} broken messages", file=path, hint=_HINT)
    clock = ClockCheck()
    for row in rows:
        clock.add(row.transform.stamp_ns, row.log_time_ns)
    timed: dict[int, Pose] = {}
    for row in rows:
        timed.setdefault(clock.t_ns(row.transform.stamp_ns, row.log_time_ns), row.transform.pose)
    return tuple(sorted(timed.items(), key=lambda item: item[0]))


@dataclass(frozen=True, eq=False)
class _Row:
    transform: StampedTransform
    log_time_ns: int


def _split(topic: str) -> tuple[str, tuple[str, str] | None]:
    name, colon, pair = topic.partition(":")
    parent, arrow, child = pair.partition("->")
    return (name, (parent, child)) if colon and arrow else (topic, None)


def _collect(reader: LogReader, path: Path, name: str) -> tuple[list[_Row], int]:
    """Read the topic's transforms; also the number of messages that were broken."""
    rows: list[_Row] = []
    broken = 0
    for event in reader.read({name}):
        if not isinstance(event, LogMessage):
            continue
        parser = _parser(event.channel, reader.schemas, path)
        try:
            rows += [_Row(transform, event.log_time_ns) for transform in parser(event.data)]
        except (BrokenMessageError, ValueError):  # ValueError: a quaternion of length 0
            broken += 1
    if not rows and not broken and name not in {channel.topic for channel in reader.channels.values()}:
        fitting = sorted(_pose_topics(reader))
        raise UsageError(
            f"has no topic '{name}'", file=path, hint=f"its pose topics are {', '.join(fitting) or 'none'}"
        )
    return rows, broken


def _parser(channel: Channel, schemas: dict[int, Schema], path: Path) -> PoseParser:
    schema = schemas.get(channel.schema_id)
    kind = schema.name if schema else ""
    parser = POSE_PARSERS.get((plain_type(kind), channel.message_encoding))
    if parser is None:
        reason = (
            f"{channel.topic} is of type '{kind}' ({channel.message_encoding}), which holds no pose that can be read"
        )
        raise UsageError(reason, file=path, hint=_HINT)
    return parser


def _pose_topics(reader: LogReader) -> Iterator[str]:
    for channel in reader.channels.values():
        schema = reader.schemas.get(channel.schema_id)
        if schema and (plain_type(schema.name), channel.message_encoding) in POSE_PARSERS:
            yield channel.topic


def _pairs(rows: Iterable[_Row]) -> list[tuple[str, str]]:
    return sorted({(row.transform.parent, row.transform.child) for row in rows})


def _only_moving(rows: list[_Row], path: Path, name: str) -> tuple[str, str]:
    """Return the only pair of frames, or the only one whose transform changes."""
    pairs = _pairs(rows)
    if len(pairs) > 1:
        moving = [pair for pair in pairs if _moves(row.transform for row in rows if _pair_of(row) == pair)]
        pairs = moving or pairs
    if len(pairs) > 1:
        known = ", ".join(f"{parent}->{child}" for parent, child in pairs)
        hint = f"name one, as {name}:{pairs[0][0]}->{pairs[0][1]}"
        raise UsageError(f"{name} holds {len(pairs)} transforms: {known}", file=path, hint=hint)
    return pairs[0] if pairs else ("", "")


def _pair_of(row: _Row) -> tuple[str, str]:
    return row.transform.parent, row.transform.child


def _moves(transforms: Iterable[StampedTransform]) -> bool:
    values = {(*t.pose.translation.tolist(), *t.pose.rotation.ravel().tolist()) for t in transforms}
    return len(values) > 1
