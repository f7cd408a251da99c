"""Labelled pictures as an evaluation sees them: the network's boxes, and the pose each picture gives by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from landtool.camera import Camera
from landtool.config import TrackConfig
from landtool.detect.detector import Detector
from landtool.evaluate.dataset import Stills
from landtool.evaluate.dehazing import ClearChange
from landtool.evaluate.detection_metrics import ScoredPicture
from landtool.evaluate.facts import Facts
from landtool.evaluate.stills_truth import StillTruth, read_stills_truth
from landtool.evaluate.true_pad import TruePad
from landtool.io.labels import LabelledImage
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.stages import StageSwitch, readable_altitude_m
from landtool.pad import PadSpec
from landtool.pipeline import process
from landtool.run.looking import Remembered, boxes
from landtool.run.scoring_haze import change_of_clear, image_of
from landtool.run.tracking import make_finder
from landtool.tracking.platform import PlatformTracker
from landtool.types import Detection, Frame, FrameResult

OnPicture = Callable[[], None]


@dataclass(frozen=True, eq=False)
class SeenStills:
    """What was seen in a set of pictures.

    pictures: all of them with their boxes. hazy: those in fog, once more without a look through it. clear: of those
    known to be clear, what dehazing changes. poses: of those whose truth is known, their names, what was measured in
    them and what is true. looked: the network's own results. notes: what is missing.
    """

    pictures: tuple[ScoredPicture, ...]
    hazy: tuple[ScoredPicture, ...]
    clear: tuple[ClearChange, ...]
    poses: tuple[tuple[str, FrameResult, TruePad], ...]
    looked: tuple[FrameResult, ...]
    notes: tuple[str, ...] = ()


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
    pictures, hazy, clear, poses, looked = [], [], [], [], []
    for image, frame in _frames(part):
        truth = truths.get(_name(image, part.folder))
        _, result = next(boxes([frame], detector, pad, config))
        looked.append(result)
        pictures.append(_scored(part, image, truth, result.detections))
        if "dehaze" in stages and truth is not None and truth.facts.fog_per_m:
            _, plain = next(boxes([frame], detector, pad, config, dehaze="off"))
            hazy.append(_scored(part, image, truth, plain.detections))
        elif "dehaze" in stages and truth is not None:
            clear.append(change_of_clear(part.name, _name(image, part.folder), frame.image, config.dehazer))
        true = None if truth is None else _true_pad(truth)
        if "pose" in stages and true is not None:
            remembered = Remembered(result.detections, config.detector.conf)
            name = f"{part.name}/{_name(image, part.folder)}"
            poses.append((name, _measured(frame, true.camera, remembered, config, pad), true))
        on_picture()
    notes = _untold(part, truths)
    return SeenStills(tuple(pictures), tuple(hazy), tuple(clear), tuple(poses), tuple(looked), notes)


def _untold(part: Stills, truths: Mapping[str, StillTruth]) -> tuple[str, ...]:
    count = sum(_name(image, part.folder) not in truths for image in part.images)
    return (f"{part.name}: pictures that truth.csv does not tell of: {count}",) if part.truth and count else ()


def _frames(part: Stills) -> Iterator[tuple[LabelledImage, Frame]]:
    for index, image in enumerate(part.images):
        yield image, Frame(index, None, image_of(image.path), image.path.name)


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


def _true_pad(truth: StillTruth) -> TruePad | None:
    """Return the true pad of a picture, None where there is none in it."""
    if truth.camera_T_pad is None:
        return None
    return TruePad(
        truth.camera,
        truth.camera_T_pad,
        truth.facts,
        truth.visible_fraction,
        truth.hidden,
        tag_corners_px=truth.tag_corners_px,
    )


def _measured(frame: Frame, camera: Camera, detector: Remembered, config: TrackConfig, pad: PadSpec) -> FrameResult:
    """Measure the pad in one picture as if it were a recording of one frame."""
    finder = make_finder(config, camera, pad, STRAIGHT_DOWN, detector, None)
    tracker = PlatformTracker(config.tracker, STRAIGHT_DOWN)
    switch = StageSwitch(config.switch_altitude_m or readable_altitude_m(camera, pad))
    _, result = next(process([frame], finder=finder, switch=switch, tracker=tracker, body_T_camera=STRAIGHT_DOWN))
    return result


def _name(image: LabelledImage, folder: Path) -> str:
    return image.path.relative_to(folder).as_posix() if image.path.is_relative_to(folder) else str(image.path)
