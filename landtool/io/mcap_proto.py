"""Values as Foxglove's protobuf messages have them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Pose_pb2 import Pose as ProtoPose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.schema import build_file_descriptor_set

from landtool.geometry import Pose

Bgr = tuple[int, int, int]
_TYPES: dict[str, Any] = {
    kind.DESCRIPTOR.full_name: kind
    for kind in (
        *(RawImage, CompressedImage, CompressedVideo, CameraCalibration),
        *(PoseInFrame, FrameTransforms, Odometry),
        *(ImageAnnotations, SceneUpdate, Log),
    )
}


class Built(NamedTuple):
    """A message ready to be logged: its type's full name and its bytes."""

    type: str
    data: bytes


def built(message: Any) -> Built:
    """Return a message as it is logged."""
    return Built(message.DESCRIPTOR.full_name, message.SerializeToString(deterministic=True))


def definition(type_name: str) -> bytes:
    """Return a type's FileDescriptorSet."""
    return bytes(build_file_descriptor_set(_TYPES[type_name]).SerializeToString(deterministic=True))


def stamp(stamp_ns: int) -> Timestamp:
    """Return a time."""
    seconds, nanos = divmod(stamp_ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def vector(values: Sequence[float]) -> Any:
    """Return a vector of three."""
    x, y, z = map(float, values)
    return Vector3(x=x, y=y, z=z)


def rotation(pose: Pose) -> Any:
    """Return a pose's rotation."""
    w, x, y, z = pose.quaternion_wxyz.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def proto_pose(pose: Pose) -> Any:
    """Return a pose."""
    return ProtoPose(position=vector(pose.translation.tolist()), orientation=rotation(pose))


def color(bgr: Bgr, alpha: float = 1.0) -> Any:
    """Return a colour; alpha 0 is not seen."""
    b, g, r = (value / 255.0 for value in bgr)
    return Color(r=r, g=g, b=b, a=alpha)
