"""The whole method set up as `landtool track` does it, for tests and benchmarks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from landtool.camera import Camera
from landtool.detect.search import Region
from landtool.detect.stage import DetectStage
from landtool.geometry import Pose
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.finder import PadFinder
from landtool.landing.measure import PadMeasurer
from landtool.landing.stages import StageSwitch, readable_altitude_m
from landtool.landing.tags import TagLook
from landtool.pad import PadSpec
from landtool.pipeline import process
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.tracking.config import TrackerConfig
from landtool.tracking.ego import EgoTrajectory
from landtool.tracking.platform import PlatformTracker
from landtool.types import Detection, Frame, FrameResult, Image, LostFrame
from tests.scenes import CAMERA, PAD


def pad_finder(
    pad: PadSpec = PAD, camera: Camera = CAMERA, detector: DetectStage | None = None, *, everywhere: bool = False
) -> PadFinder:
    """A finder of the pad under a camera that looks straight down."""
    look = TagLook(TagReader(ReaderConfig.of_pad(pad)), camera, pad)
    return PadFinder(PadMeasurer(camera, pad, "srgb"), look, detector, STRAIGHT_DOWN, everywhere=everywhere)


def followed(
    frames: Iterable[Frame | LostFrame],
    finder: PadFinder | None = None,
    *,
    ego: EgoTrajectory | None = None,
    config: TrackerConfig | None = None,
) -> Iterator[FrameResult]:
    """What the method says of each frame."""
    finder = finder or pad_finder()
    switch = StageSwitch(readable_altitude_m(finder.measurer.camera, finder.measurer.pad))
    tracker = PlatformTracker(config or TrackerConfig(), STRAIGHT_DOWN, ego)
    for _, result in process(frames, finder=finder, switch=switch, tracker=tracker, body_T_camera=STRAIGHT_DOWN):
        yield result


def ring_box(camera_T_pad: Pose, pad: PadSpec = PAD, camera: Camera = CAMERA) -> Detection:
    """The box of a sure network around the ring's outer circle."""
    seen = camera.project(camera_T_pad.apply(pad.outline_m))
    return Detection("pad", 0.9, *map(float, (*seen.min(axis=0), *seen.max(axis=0))))


def edges_of(box: Detection) -> np.ndarray:
    return np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px])


class Told:
    """A network that sees what it is told to see, and remembers how often it was asked."""

    def __init__(self, *boxes: Detection) -> None:
        self.boxes, self.asked = boxes, 0

    def detect(self, image: Image) -> tuple[Detection, ...]:  # noqa: ARG002
        self.asked += 1
        return self.boxes

    def detect_region(self, image: Image, region: Region) -> tuple[Detection, ...]:  # noqa: ARG002
        return self.detect(image)
