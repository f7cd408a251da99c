"""A clip's pictures as a video or as a log."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType

import numpy as np

from landtool.io.mcap_build import Motion, Transform
from landtool.io.mcap_out import McapImageWriter
from landtool.io.video_out import VideoWriter
from landtool.synth.clips.take import FrameTruth, Take
from landtool.synth.clips.times import time_base
from landtool.types import Frame, Image

MAP, BODY, CAMERA, PAD = "map", "base_link", "camera_optical", "pad"
"""Frame ids in a log: the world, the drone, its camera, the platform's pad."""
IMAGE_TOPIC, TF_TOPIC = "/camera/image", "/tf"
ODOMETRY_TOPIC, POSE_TOPIC = "/drone/odometry", "/drone/pose"
TRUTH_TOPICS = {"drone": "/truth/drone", "pad": "/truth/pad", "pad_in_camera": "/truth/pad_in_camera"}


class VideoRecorder(AbstractContextManager["VideoRecorder"]):
    """Writes an MP4, its times as exact as the stamps."""

    def __init__(self, path: Path, take: Take) -> None:
        width, height = take.config.size
        self._video = VideoWriter(path, width, height, time_base(take.config.fps, take.config.vfr))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._video.__exit__(kind, error, trace)

    def write(self, image: Image, truth: FrameTruth) -> None:
        """Add a picture."""
        self._video.write(image, truth.t_ns)


class LogRecorder(AbstractContextManager["LogRecorder"]):
    """Writes an MCAP log: pictures, calibration, odometry, transforms and the truth, all stamped as the pictures are.

    Pictures are JPEG in ROS 2's messages and H.264 in Foxglove's, which both Foxglove and Rerun show.
    """

    def __init__(self, path: Path, take: Take) -> None:
        self._take = take
        schema = take.config.mcap_schema
        self._log = McapImageWriter(
            path,
            schema=schema,
            topic=IMAGE_TOPIC,
            frame_id=CAMERA,
            camera=take.camera,
            encoding="jpeg" if schema == "ros2" else "h264",
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._log.__exit__(kind, error, trace)

    def write(self, image: Image, truth: FrameTruth) -> None:
        """Add a picture and all else of its time. The transforms are the true ones."""
        log, t_ns = self._log, truth.t_ns
        log.write(Frame(truth.index, t_ns, image))
        own = self._take.odometry(t_ns)
        log.write_pose(POSE_TOPIC, t_ns, own.world_T_body, frame_id=MAP)
        twist = (*own.velocity_mps.tolist(), *own.rate_radps.tolist())
        spread = np.diag(own.pose_variances), np.diag(own.twist_variances)
        log.write_odometry(ODOMETRY_TOPIC, t_ns, Motion(MAP, BODY, own.world_T_body, twist, *spread))
        mount = self._take.config.body_T_camera
        tree = ((MAP, BODY, truth.world_T_body), (BODY, CAMERA, mount), (MAP, PAD, truth.world_T_pad))
        log.write_transforms(TF_TOPIC, t_ns, [Transform(*edge) for edge in tree])
        log.write_pose(TRUTH_TOPICS["drone"], t_ns, truth.world_T_body, frame_id=MAP)
        log.write_pose(TRUTH_TOPICS["pad"], t_ns, truth.world_T_pad, frame_id=MAP)
        log.write_pose(TRUTH_TOPICS["pad_in_camera"], t_ns, truth.camera_T_pad, frame_id=CAMERA)


RECORDERS: dict[str, type[VideoRecorder] | type[LogRecorder]] = {".mp4": VideoRecorder, ".mcap": LogRecorder}
"""By the ending of the file."""
