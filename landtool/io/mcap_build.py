"""Messages landtool writes to MCAP logs, in two dialects: ROS 2 (CDR) and Foxglove (protobuf)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.io.mcap_cdr import CdrWriter
from landtool.io.mcap_proto import Built, built, definition, proto_pose, rotation, stamp, vector
from landtool.io.mcap_schemas import ROS2_DEFINITIONS
from landtool.types import Image

McapSchema = Literal["ros2", "foxglove"]


class Transform(NamedTuple):
    """`parent_T_child` between two frames by their ids."""

    parent: str
    child: str
    pose: Pose


class Motion(NamedTuple):
    """An odometry: the pose of a body and how it moves.

    frame_id: of the world, child_frame_id: of the body. twist: (6,) velocity in m/s along the body's axes, turning in
    rad/s about them. pose_covariance: (6, 6) of x y z in m and of turns about the world's axes in rad.
    twist_covariance: (6, 6) of the twist. What is not known is 0.
    """

    frame_id: str
    child_frame_id: str
    pose: Pose
    twist: Sequence[float]
    pose_covariance: Array
    twist_covariance: Array


class Dialect(Protocol):
    """One way to write the messages. Stamps are in ns, images (H, W, 3) BGR uint8."""

    profile: str
    message_encoding: str
    schema_encoding: str
    calibration_name: str  # last name of the calibration topic beside the image's

    def definition(self, type_name: str) -> bytes:
        """Return the schema of a type in `schema_encoding`."""
        ...

    def raw_image(self, stamp_ns: int, frame_id: str, image: Image) -> Built:
        """Build an image message of pixels, encoding bgr8."""
        ...

    def coded_image(self, stamp_ns: int, frame_id: str, data: bytes, form: str) -> Built:
        """Build a message of a compressed image (jpeg, png) or of one picture of a video (h264)."""
        ...

    def calibration(self, stamp_ns: int, frame_id: str, camera: Camera) -> Built:
        """Build a calibration message."""
        ...

    def pose(self, stamp_ns: int, frame_id: str, pose: Pose) -> Built:
        """Build a message of a pose in a frame."""
        ...

    def odometry(self, stamp_ns: int, motion: Motion) -> Built:
        """Build an odometry message."""
        ...

    def transforms(self, stamp_ns: int, transforms: Sequence[Transform]) -> Built:
        """Build a message of several transforms at one time."""
        ...


class Ros2Dialect:
    """sensor_msgs and geometry_msgs, little-endian CDR."""

    profile = "ros2"
    message_encoding = "cdr"
    schema_encoding = "ros2msg"
    calibration_name = "camera_info"

    def definition(self, type_name: str) -> bytes:
        """Return a definition as text."""
        return ROS2_DEFINITIONS[type_name].encode()

    def raw_image(self, stamp_ns: int, frame_id: str, image: Image) -> Built:
        """Build an Image."""
        height, width = image.shape[:2]
        cdr = CdrWriter().stamp_ns(stamp_ns).string(frame_id).uint32(height, width).string("bgr8")
        return Built("sensor_msgs/msg/Image", cdr.uint8(0).uint32(3 * width).blob(image.tobytes()).finish())

    def coded_image(self, stamp_ns: int, frame_id: str, data: bytes, form: str) -> Built:
        """Build a CompressedImage."""
        cdr = CdrWriter().stamp_ns(stamp_ns).string(frame_id).string(form).blob(data)
        return Built("sensor_msgs/msg/CompressedImage", cdr.finish())

    def calibration(self, stamp_ns: int, frame_id: str, camera: Camera) -> Built:
        """Build a CameraInfo."""
        cdr = CdrWriter().stamp_ns(stamp_ns).string(frame_id).uint32(camera.height, camera.width)
        cdr.string(camera.model).float64_sequence(camera.distortion)
        cdr.float64s(_k(camera)).float64s(_R).float64s(_p(camera))
        cdr.uint32(0, 0).uint32(0, 0, 0, 0).uint8(0)  # no binning, the whole picture, not rectified
        return Built("sensor_msgs/msg/CameraInfo", cdr.finish())

    def pose(self, stamp_ns: int, frame_id: str, pose: Pose) -> Built:
        """Build a PoseStamped."""
        cdr = CdrWriter().stamp_ns(stamp_ns).string(frame_id).float64s(_xyz_xyzw(pose))
        return Built("geometry_msgs/msg/PoseStamped", cdr.finish())

    def odometry(self, stamp_ns: int, motion: Motion) -> Built:
        """Build a nav_msgs/Odometry."""
        cdr = CdrWriter().stamp_ns(stamp_ns).string(motion.frame_id).string(motion.child_frame_id)
        cdr.float64s(_xyz_xyzw(motion.pose)).float64s(motion.pose_covariance.ravel().tolist())
        cdr.float64s(motion.twist).float64s(motion.twist_covariance.ravel().tolist())
        return Built("nav_msgs/msg/Odometry", cdr.finish())

    def transforms(self, stamp_ns: int, transforms: Sequence[Transform]) -> Built:
        """Build a TFMessage."""
        cdr = CdrWriter().uint32(len(transforms))
        for parent, child, pose in transforms:
            cdr.stamp_ns(stamp_ns).string(parent).string(child).float64s(_xyz_xyzw(pose))
        return Built("tf2_msgs/msg/TFMessage", cdr.finish())


class FoxgloveDialect:
    """Foxglove's protobuf schemas."""

    profile = ""
    message_encoding = "protobuf"
    schema_encoding = "protobuf"
    calibration_name = "calibration"

    def definition(self, type_name: str) -> bytes:
        """Return a FileDescriptorSet."""
        return definition(type_name)

    def raw_image(self, stamp_ns: int, frame_id: str, image: Image) -> Built:
        """Build a RawImage."""
        height, width = image.shape[:2]
        message = RawImage(timestamp=stamp(stamp_ns), frame_id=frame_id, width=width, height=height)
        message.encoding, message.step, message.data = "bgr8", 3 * width, image.tobytes()
        return built(message)

    def coded_image(self, stamp_ns: int, frame_id: str, data: bytes, form: str) -> Built:
        """Build a CompressedImage, or a CompressedVideo for h264."""
        kind = CompressedVideo if form == "h264" else CompressedImage
        return built(kind(timestamp=stamp(stamp_ns), frame_id=frame_id, data=data, format=form))

    def calibration(self, stamp_ns: int, frame_id: str, camera: Camera) -> Built:
        """Build a CameraCalibration."""
        model = "kannala_brandt" if camera.model == "equidistant" else camera.model
        message = CameraCalibration(timestamp=stamp(stamp_ns), frame_id=frame_id, distortion_model=model)
        message.width, message.height = camera.width, camera.height
        message.D.extend(camera.distortion)
        message.K.extend(_k(camera))
        message.R.extend(_R)
        message.P.extend(_p(camera))
        return built(message)

    def pose(self, stamp_ns: int, frame_id: str, pose: Pose) -> Built:
        """Build a PoseInFrame."""
        return built(PoseInFrame(timestamp=stamp(stamp_ns), frame_id=frame_id, pose=proto_pose(pose)))

    def odometry(self, stamp_ns: int, motion: Motion) -> Built:
        """Build an Odometry."""
        message = Odometry(
            timestamp=stamp(stamp_ns),
            frame_id=motion.frame_id,
            body_frame_id=motion.child_frame_id,
            pose=proto_pose(motion.pose),
            linear_velocity=vector(motion.twist[:3]),
            angular_velocity=vector(motion.twist[3:]),
            pose_covariance=motion.pose_covariance.ravel().tolist(),
            velocity_covariance=motion.twist_covariance.ravel().tolist(),
        )
        return built(message)

    def transforms(self, stamp_ns: int, transforms: Sequence[Transform]) -> Built:
        """Build a FrameTransforms."""
        message = FrameTransforms()
        for parent, child, pose in transforms:
            one = FrameTransform(timestamp=stamp(stamp_ns), parent_frame_id=parent, child_frame_id=child)
            one.translation.CopyFrom(vector(pose.translation.tolist()))
            one.rotation.CopyFrom(rotation(pose))
            message.transforms.append(one)
        return built(message)


DIALECTS: dict[McapSchema, type[Dialect]] = {"ros2": Ros2Dialect, "foxglove": FoxgloveDialect}
_R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def _k(camera: Camera) -> tuple[float, ...]:
    return (camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0)


def _p(camera: Camera) -> tuple[float, ...]:
    """Return the projection of rectified pictures (3, 4) by rows: the same intrinsics, nothing to shift."""
    return (camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0)


def _xyz_xyzw(pose: Pose) -> tuple[float, ...]:
    """Return a pose as ROS orders it: the place, then the quaternion, w last."""
    w, x, y, z = pose.quaternion_wxyz.tolist()
    return (*pose.translation.tolist(), x, y, z, w)
