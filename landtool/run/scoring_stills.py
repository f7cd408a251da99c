"""Labelled pictures as an evaluation sees them: the network's boxes, and the pose each picture gives by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from landtool.config import TrackConfig
from landtool.detect.detector import Detector
from landtool.errors import InputError
from landtool.evaluate.dataset import Stills
from landtool.evaluate.detection_metrics import ScoredPicture
from landtool.evaluate.facts import Facts
from landtool.evaluate.pose_errors import PosePair
from landtool.evaluate.stills_truth import StillTruth, read_stills_truth
from landtool.io.images import PictureError, read_picture
from landtool.io.labels import LabelledImage
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.stages import StageSwitch, readable_altitude_m
from landtool.pad import PadSpec
from landtool.pipeline import process
from landtool.run.looking import Remembered, boxes
from landtool.run.tracking import make_finder
from landtool.tracking.platform import PlatformTracker
from landtool.types import Detection, Frame, FrameResult

OnPicture = Callable[[], None]


@dataclass(frozen=True, eq=False)
class SeenStills:
    """What was seen in a set of pictures.

    pictures: all of them with their boxes. hazy: those in fog, once more without a look through it. poses: of those
    whose truth is known, with the pose that was measured. looked: results of the network, for their times.
    """

    pictures: tuple[ScoredPicture, ...]
    hazy: tuple[ScoredPicture, ...]
    poses: tuple[PosePair, ...]
    looked: tuple[FrameResult, ...]


def see_stills(
    part: Stills,
    detector: Detector,
    config: TrackConfig,
    pad: PadSpec,
    *,
    stages: tuple[str, ...],
    on_picture: OnPicture,
) -> SeenStills:
    """Look at every picture. Raises InputError for one that cannot be read and a truth.csv that is broken."""
    truths = {} if part.truth is None else read_stills_truth(part.truth)
    pictures, hazy, poses, looked = [], [], [], []
    for image, frame in _frames(part):
        truth = truths.get(_name(image, part.folder))
        _, result = next(boxes([frame], detector, pad, config))
        looked.append(result)
        pictures.append(_scored(part, image, truth, result.detections))
        if "dehaze" in stages and truth is not None and (truth.facts.fog_per_m or 0.0) > 0.0:
            _, plain = next(boxes([frame], detector, pad, config, dehaze="off"))
            hazy.append(_scored(part, image, truth, plain.detections))
        if "pose" in stages and truth is not None and truth.camera_T_pad is not None:
            remembered = Remembered(result.detections, config.detector.conf)
            poses.append(_pose(part, frame, truth, remembered, config, pad))
        on_picture()
    return SeenStills(tuple(pictures), tuple(hazy), tuple(poses), tuple(looked))


def _frames(part: Stills) -> Iterator[tuple[LabelledImage, Frame]]:
    for index, image in enumerate(part.images):
        try:
            picture = read_picture(image.path)
        except PictureError as error:
            raise InputError(str(error), file=image.path, hint="replace or remove it") from error
        yield image, Frame(index, None, picture.image, image.path.name, picture.damage)


def _scored(
    part: Stills, image: LabelledImage, truth: StillTruth | None, found: tuple[Detection, ...]
) -> ScoredPicture:
    file = _name(image, part.folder)
    facts = _facts(image) if truth is None else truth.facts
    return ScoredPicture(part.name, file, None, (part.name, file), image, found, facts)


def _facts(image: LabelledImage) -> Facts:
    """Return what the labels alone tell: how large the largest target is."""
    sides = [max(box.x_max_px - box.x_min_px, box.y_max_px - box.y_min_px) for box in image.boxes]
    return Facts(size_px=max(sides, default=None))


def _pose(
    part: Stills, frame: Frame, truth: StillTruth, detector: Remembered, config: TrackConfig, pad: PadSpec
) -> PosePair:
    """Measure the pad in one picture as if it were a recording of one frame."""
    camera = truth.camera
    finder = make_finder(config, camera, pad, STRAIGHT_DOWN, detector, None)
    tracker = PlatformTracker(config.tracker, STRAIGHT_DOWN, None)
    switch = StageSwitch(config.switch_altitude_m or readable_altitude_m(camera, pad))
    _, result = next(
        process([frame], finder=finder, switch=switch, tracker=tracker, body_T_camera=STRAIGHT_DOWN, dehazer=None)
    )
    return PosePair(part.name, frame.file, result, truth.camera_T_pad, camera, pad, truth.facts, truth.visible_fraction)


def _name(image: LabelledImage, folder: Path) -> str:
    return image.path.relative_to(folder).as_posix() if image.path.is_relative_to(folder) else str(image.path)
