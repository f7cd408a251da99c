"""Small MCAP logs for the tests, written by the mcap libraries and not by landtool."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from mcap_protobuf.schema import register_schema
from mcap_ros2._dynamic import serialize_dynamic
from numpy.typing import NDArray

from landtool.io.mcap_schemas import ROS2_DEFINITIONS

START_NS = 1_700_000_000_123_456_789
STEP_NS = 33_333_333
_ODOMETRY = (
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n"
)
_EXTRA = {
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation\n",
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
}
_POSE_PARTS = ROS2_DEFINITIONS["geometry_msgs/msg/PoseStamped"].split("=" * 80, 1)[1]
_PARTS = "=" * 80 + _POSE_PARTS + "".join(f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in _EXTRA.items())
DEFINITIONS = {
    **ROS2_DEFINITIONS,
    "nav_msgs/msg/Odometry": _ODOMETRY + _PARTS,
    "geometry_msgs/msg/TransformStamped": _EXTRA["geometry_msgs/TransformStamped"] + _PARTS,
    "geometry_msgs/msg/PoseWithCovarianceStamped": "std_msgs/Header header\nPoseWithCovariance pose\n" + _PARTS,
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n" + _PARTS,
    "std_msgs/msg/String": "string data\n",
}


def namespace(**fields: Any) -> SimpleNamespace:
    return SimpleNamespace(**fields)


def header(stamp_ns: int, frame_id: str = "camera") -> SimpleNamespace:
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return namespace(stamp=namespace(sec=sec, nanosec=nanosec), frame_id=frame_id)


def ros_image(stamp_ns: int, pixels: NDArray[Any], encoding: str, *, padding: int = 0, **changes: Any) -> Any:
    """pixels: (H, W) or (H, W, C), of the encoding's own type."""
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=0xAA)
    fields: dict[str, Any] = {
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": padded.shape[1],
    }
    return namespace(header=header(stamp_ns), **{**fields, "data": padded.tobytes(), **changes})


def ros_camera_info(stamp_ns: int, width: int, height: int, **changes: Any) -> Any:
    k = [500.0, 0.0, 31.5, 0.0, 510.0, 23.5, 0.0, 0.0, 1.0]
    p = [400.0, 0.0, 30.0, 0.0, 0.0, 410.0, 20.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    roi = namespace(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    fields: dict[str, Any] = {
        "distortion_model": "plumb_bob",
        "d": [0.1, -0.2, 0.001, 0.002, 0.05],
        "k": k,
        "p": p,
        "roi": roi,
    }
    fields |= {"r": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], "binning_x": 0, "binning_y": 0}
    return namespace(header=header(stamp_ns), height=height, width=width, **{**fields, **changes})


class Log:
    """Collects messages and writes them in the given order; `options` go to mcap's Writer."""

    def __init__(self, path: Path, **options: Any) -> None:
        self._file = path.open("wb")
        self._writer = Writer(self._file, **options)
        self._writer.start(profile="ros2", library="test")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._encoders: dict[str, Any] = {}

    def ros(self, topic: str, type_name: str, message: Any, log_time_ns: int) -> None:
        if type_name not in self._encoders:
            self._encoders[type_name] = serialize_dynamic(type_name, DEFINITIONS[type_name])[type_name]
        self.raw(topic, type_name, "cdr", bytes(self._encoders[type_name](message)), log_time_ns)

    def proto(self, topic: str, message: Any, log_time_ns: int) -> None:
        name = message.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = register_schema(self._writer, type(message))
        self.raw(topic, name, "protobuf", message.SerializeToString(), log_time_ns)

    def raw(self, topic: str, type_name: str, encoding: str, data: bytes, log_time_ns: int) -> None:
        if type_name not in self._schemas:
            text = DEFINITIONS.get(type_name, "").encode()
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", text)
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, encoding, self._schemas[type_name])
        self._writer.add_message(self._channels[topic], log_time_ns, data, log_time_ns)

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()


NO_INDEX: dict[str, Any] = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}
PLAIN: dict[str, Any] = {"compression": CompressionType.NONE}


def grey(number: int, width: int = 64, height: int = 48) -> NDArray[np.uint8]:
    """A picture that tells its number: every pixel is 10 times it."""
    return np.full((height, width), 10 * number, dtype=np.uint8)


def write_images(path: Path, stamps_ns: Iterable[int], topic: str = "/camera/image_raw", **options: Any) -> Path:
    """A log of mono8 pictures, number n of grey level 10 n, logged 33.3 ms apart whatever their stamps are."""
    with Log(path, **options) as log:
        for number, stamp_ns in enumerate(stamps_ns):
            image = ros_image(stamp_ns, grey(number), "mono8")
            log.ros(topic, "sensor_msgs/msg/Image", image, START_NS + number * STEP_NS)
    return path


def even_stamps(count: int) -> list[int]:
    """Stamps 5 ms before the times of logging of `write_images`."""
    return [START_NS + number * STEP_NS - 5_000_000 for number in range(count)]
