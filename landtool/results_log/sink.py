"""The sink that writes track.mcap."""

from __future__ import annotations

from contextlib import ExitStack

import cv2

from landtool.draw import main_track
from landtool.errors import OutputExistsError, UsageError
from landtool.io.atomic import atomic_path
from landtool.io.calibration import camera_yaml
from landtool.io.mcap_log import McapLog, checked_stamp_ns
from landtool.io.mcap_status import status
from landtool.results_log import topics
from landtool.results_log.marks import picture_marks
from landtool.results_log.moment import Moment
from landtool.results_log.space import odometry, scene, transforms
from landtool.sink import ManagedSink
from landtool.types import Frame, FrameResult, Image, LostFrame, Reference

RESULTS_LOG = "track.mcap"
# JPEG, not H.264, which takes a seventh of the room but ten times as long, which Rerun shows only beside a program to
# decode it, and of which a picture cannot be had without those before it
IMAGE_QUALITY, ANNOTATED_QUALITY = 95, 85
_FPS = "give the clock with --fps"


class McapSink(ManagedSink):
    """Writes track.mcap: Foxglove's protobuf messages, all of a frame with its time. Needs frames with times."""

    def _open(self, stack: ExitStack) -> None:
        if not self._setup.has_clock:
            reason = "frames without times cannot be written to an MCAP log"
            raise UsageError(reason, file=self._setup.recording, hint=_FPS)
        path = self._setup.folder / RESULTS_LOG
        if path.exists():
            raise OutputExistsError(path)
        self._log = stack.enter_context(McapLog(stack.enter_context(atomic_path(path)), schema="foxglove"))
        if self._setup.camera is not None:
            self._log.attach("camera.yaml", "application/yaml", camera_yaml(self._setup.camera))
        if self._setup.pad is not None:
            self._log.attach("pad.toml", "application/toml", self._setup.pad.to_toml())
        self._heights_m: dict[Reference, float] = {}
        self._said = ""
        stack.push(self._describe)

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:
        """Add one frame; of a lost one what the tracks say, where its time is known. A picture needs a time."""
        if isinstance(frame, LostFrame) and frame.t_ns is None:
            return
        if frame.t_ns is None:
            reason = f"frame {frame.index} has no time, an MCAP log cannot hold it"
            raise UsageError(reason, file=frame.file or None, hint=_FPS)
        moment = self._moment(checked_stamp_ns(frame.t_ns), result)
        if isinstance(frame, Frame):
            self._write_pictures(moment, frame)
        self._write_places(moment)
        self._write_status(moment)

    def _moment(self, t_ns: int, result: FrameResult) -> Moment:
        if result.body_T_pad is not None:
            self._heights_m["body"] = float(result.body_T_pad.translation[2])
        if result.world_T_pad is not None:
            self._heights_m["world"] = float(result.world_T_pad.translation[2])
        seen_from = self._setup.camera_T_reference(result)
        return Moment(t_ns, result, main_track(result.tracks), seen_from, self._heights_m)

    def _write_pictures(self, moment: Moment, frame: Frame) -> None:
        camera, dialect, t_ns = self._setup.camera, self._log.dialect, moment.t_ns
        height, width = frame.image.shape[:2]
        fitting = camera if camera is not None and (camera.width, camera.height) == (width, height) else None
        if fitting is not None:
            self._log.add(topics.CALIBRATION, t_ns, dialect.calibration(t_ns, topics.CAMERA, fitting))
        drawn = self._setup.drawn.of(frame, moment.result)
        for topic, image, quality in (
            (topics.IMAGE, frame.image, IMAGE_QUALITY),
            (topics.ANNOTATED, drawn, ANNOTATED_QUALITY),
        ):
            self._log.add(topic, t_ns, dialect.coded_image(t_ns, topics.CAMERA, _jpeg(image, quality), "jpeg"))
        self._log.add(topics.ANNOTATIONS, t_ns, picture_marks(moment, height, fitting, self._setup.pad))

    def _write_places(self, moment: Moment) -> None:
        dialect, t_ns = self._log.dialect, moment.t_ns
        if moment.result.pose is not None:
            camera_T_pad = moment.result.pose.camera_T_pad
            self._log.add(topics.POSE, t_ns, dialect.pose(t_ns, topics.CAMERA, camera_T_pad))
        if edges := transforms(moment, self._setup.body_T_camera):
            self._log.add(topics.TF, t_ns, dialect.transforms(t_ns, edges))
        motion = None if moment.track is None else odometry(moment, moment.track)
        if motion is not None:
            self._log.add(topics.TRACK, t_ns, dialect.odometry(t_ns, motion))
        if self._setup.pad is not None:
            self._log.add(topics.SCENE, t_ns, scene(moment, self._setup.pad))

    def _write_status(self, moment: Moment) -> None:
        """Say the stage and the reason where they change."""
        result = moment.result
        text = ": ".join(filter(None, [result.stage or "", result.reason]))
        if text and text != self._said:
            self._log.add(topics.STATUS, moment.t_ns, status(moment.t_ns, text, warn=result.status == "damaged"))
        self._said = text

    def _describe(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            camera = self._setup.camera
            assumed = {"camera_assumed": camera.assumed} if camera is not None and camera.assumed else {}
            self._log.describe({**self._setup.provenance(), **assumed})


def _jpeg(image: Image, quality: int) -> bytes:
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
