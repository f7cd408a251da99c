"""The ROS 2 message definitions landtool writes, in the text form MCAP calls `ros2msg`."""

from __future__ import annotations

_SEPARATOR = "=" * 80

_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_POINT = "float64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_POSE = "Point position\nQuaternion orientation\n"
_ROI = "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
_IMAGE = """std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
"""
_COMPRESSED_IMAGE = "std_msgs/Header header\nstring format\nuint8[] data\n"
_CAMERA_INFO = """std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
RegionOfInterest roi
"""
_POSE_STAMPED = "std_msgs/Header header\nPose pose\n"

_ODOMETRY = """std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
"""
_TF_MESSAGE = "geometry_msgs/TransformStamped[] transforms\n"
_TRANSFORM_STAMPED = "std_msgs/Header header\nstring child_frame_id\nTransform transform\n"
_TRANSFORM = "Vector3 translation\nQuaternion rotation\n"
_VECTOR3 = _POINT
_TWIST = "Vector3 linear\nVector3 angular\n"

_STAMPED = {"std_msgs/Header": _HEADER, "builtin_interfaces/Time": _TIME}
_POSES = {"geometry_msgs/Pose": _POSE, "geometry_msgs/Point": _POINT, "geometry_msgs/Quaternion": _QUATERNION}
_MOTIONS = {
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Twist": _TWIST,
    "geometry_msgs/Vector3": _VECTOR3,
}
_TRANSFORMS = {
    "geometry_msgs/TransformStamped": _TRANSFORM_STAMPED,
    "geometry_msgs/Transform": _TRANSFORM,
    "geometry_msgs/Vector3": _VECTOR3,
    "geometry_msgs/Quaternion": _QUATERNION,
}


def _joined(text: str, parts: dict[str, str]) -> str:
    """Append the definitions a message is made of, as ROS's own tools do."""
    return text + "".join(f"{_SEPARATOR}\nMSG: {name}\n{part}" for name, part in parts.items())


ROS2_DEFINITIONS: dict[str, str] = {
    "sensor_msgs/msg/Image": _joined(_IMAGE, _STAMPED),
    "sensor_msgs/msg/CompressedImage": _joined(_COMPRESSED_IMAGE, _STAMPED),
    "sensor_msgs/msg/CameraInfo": _joined(_CAMERA_INFO, {**_STAMPED, "sensor_msgs/RegionOfInterest": _ROI}),
    "geometry_msgs/msg/PoseStamped": _joined(_POSE_STAMPED, {**_STAMPED, **_POSES}),
    "nav_msgs/msg/Odometry": _joined(_ODOMETRY, {**_STAMPED, **_MOTIONS, **_POSES}),
    "tf2_msgs/msg/TFMessage": _joined(_TF_MESSAGE, {**_STAMPED, **_TRANSFORMS}),
}
