"""MCAP logs of pictures and motions, written as a ROS 2 recorder or Foxglove's SDK would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Literal

import av
import cv2
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType, VideoFrame
from av.video.reformatter import Interpolation, VideoReformatter

from landtool.camera import Camera
from landtool.errors import OutputError, UsageError
from landtool.geometry import Pose
from landtool.io.mcap_build import McapSchema, Motion, Transform
from landtool.io.mcap_log import McapLog, checked_stamp_ns
from landtool.io.mcap_proto import Built
from landtool.types import Frame, Image

McapEncoding = Literal["raw", "jpeg", "png", "h264"]
JPEG_QUALITY = 95
H264_CRF = 18  # hardly visible loss
KEY_FRAME_NS = 1_000_000_000  # a player that seeks waits for the next key frame
_BT709, _LIMITED = 1, 1


class McapImageWriter:
    """Writes one image topic and, when the camera is known, its calibration with the same stamp for every picture.

    schema: `ros2` (Image, CompressedImage, CameraInfo as CDR) or `foxglove` (protobuf). encoding: `raw` (bgr8), `jpeg`,
    `png`, or `h264` (Annex B, one picture a message, no B-frames, parameter sets with every key frame).
    The calibration goes to `camera_info` (ros2) or `calibration` (foxglove) beside the image topic. frame_id: the
    camera's frame. metadata: written to the record `landtool`, beside the version. The time of logging is the
    capture's; nothing of the moment of writing enters the file, so the same input gives the same bytes.

    Writes to `path` as it goes; use it inside `atomic_path` for a file that appears whole. Raises UsageError for a
    frame without a time or a size h264 cannot hold, OutputError when encoding fails, OSError when writing does.
    """

    def __init__(
        self,
        path: Path,
        *,
        schema: McapSchema,
        topic: str,
        frame_id: str,
        camera: Camera | None,
        encoding: McapEncoding,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self.path, self.topic, self.frame_id = Path(path), topic, frame_id
        self.camera, self.encoding = camera, encoding
        self.written = 0
        self._video: H264Encoder | None = None
        self._log = McapLog(self.path, schema=schema)
        self._log.describe(metadata or {})

    @property
    def calibration_topic(self) -> str:
        """The calibration's topic: beside the image; beside `image_raw` for `image_raw/compressed`."""
        names = self.topic.split("/")
        keep = -2 if names[-1] == "compressed" and len(names) > 2 else -1
        return "/".join([*names[:keep], self._log.dialect.calibration_name])

    def write(self, frame: Frame) -> None:
        """Add one picture and its calibration, at the frame's own time."""
        t_ns = checked_stamp_ns(frame.t_ns)
        if self.camera is not None:
            calibration = self._log.dialect.calibration(t_ns, self.frame_id, self.camera)
            self._log.add(self.calibration_topic, t_ns, calibration)
        self._log.add(self.topic, t_ns, self._image(t_ns, frame.image))
        self.written += 1

    def write_pose(self, topic: str, t_ns: int, world_T_body: Pose, *, frame_id: str) -> None:
        """Add a pose (PoseStamped or PoseInFrame) in the frame `frame_id`. Give poses and pictures by time."""
        stamp_ns = checked_stamp_ns(t_ns)
        self._log.add(topic, stamp_ns, self._log.dialect.pose(stamp_ns, frame_id, world_T_body))

    def write_odometry(self, topic: str, t_ns: int, motion: Motion) -> None:
        """Add an odometry (nav_msgs/Odometry or foxglove.Odometry)."""
        stamp_ns = checked_stamp_ns(t_ns)
        self._log.add(topic, stamp_ns, self._log.dialect.odometry(stamp_ns, motion))

    def write_transforms(self, topic: str, t_ns: int, transforms: Sequence[Transform]) -> None:
        """Add transforms between frames at one time (TFMessage or FrameTransforms)."""
        stamp_ns = checked_stamp_ns(t_ns)
        self._log.add(topic, stamp_ns, self._log.dialect.transforms(stamp_ns, transforms))

    def close(self) -> None:
        """Write the index and close the file; may be called again."""
        self._log.close()

    def __enter__(self) -> McapImageWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._log.__exit__(kind, error, trace)

    def _image(self, t_ns: int, image: Image) -> Built:
        if self.encoding == "raw":
            return self._log.dialect.raw_image(t_ns, self.frame_id, image)
        if self.encoding == "h264":
            height, width = image.shape[:2]
            self._video = self._video or H264Encoder(width, height)
            data = self._video.encode(image, t_ns)
        else:
            options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if self.encoding == "jpeg" else []
            data = cv2.imencode(f".{self.encoding}", image, options)[1].tobytes()
        return self._log.dialect.coded_image(t_ns, self.frame_id, data, self.encoding)


class H264Encoder:
    """One packet out for every picture in. width, height: even, as 4:2:0 needs."""

    def __init__(self, width: int, height: int) -> None:
        if width % 2 or height % 2:
            raise UsageError(f"h264 cannot hold pictures of {width}x{height}", hint="write them as jpeg")
        context = av.CodecContext.create("libx264", "w")
        assert isinstance(context, VideoCodecContext)
        context.width, context.height, context.pix_fmt = width, height, "yuv420p"
        context.colorspace, context.color_range = _BT709, _LIMITED
        context.time_base = Fraction(1, 1_000_000)
        context.thread_count = 1  # slices, and so the bytes, would depend on the machine's cores
        context.options = {
            "preset": "veryfast",
            "tune": "zerolatency",
            "crf": str(H264_CRF),
            "forced-idr": "1",
            "x264-params": "keyint=infinite:scenecut=0:bframes=0:repeat-headers=1:annexb=1",
        }
        self._context = context
        self._size = (width, height)
        self._reformatter = VideoReformatter()
        self._pts = -1
        self._key_ns: int | None = None

    def encode(self, image: Image, t_ns: int) -> bytes:
        """Return the picture's access unit in Annex B form."""
        if image.shape[1::-1] != self._size:
            raise UsageError("h264 cannot change the picture size on the way", hint="write the pictures as jpeg")
        picture = VideoFrame.from_ndarray(np.ascontiguousarray(image), format="bgr24")
        # Without accurate rounding every conversion darkens by up to two levels.
        frame = self._reformatter.reformat(
            picture,
            format="yuv420p",
            dst_colorspace=_BT709,
            dst_color_range=_LIMITED,
            interpolation=Interpolation.BILINEAR | Interpolation.ACCURATE_RND,
            threads=1,
        )
        self._pts = max(self._pts + 1, t_ns // 1000)
        frame.pts, frame.time_base = self._pts, self._context.time_base
        frame.pict_type = PictureType.NONE
        if self._key_ns is None or not 0 <= t_ns - self._key_ns < KEY_FRAME_NS:
            frame.pict_type, self._key_ns = PictureType.I, t_ns
        try:
            packets = self._context.encode(frame)
        except av.FFmpegError as error:
            raise OutputError(f"h264 encoding failed ({error.strerror})") from error
        if len(packets) != 1:
            raise OutputError(f"the h264 encoder gave {len(packets)} packets for a picture")
        return bytes(packets[0])
