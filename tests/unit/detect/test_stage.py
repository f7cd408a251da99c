from __future__ import annotations

from dataclasses import replace

import numpy as np

from landtool.detect.search import Region
from landtool.detect.stage import DetectStage
from landtool.pad import PadSpec
from landtool.types import Detection, Frame, Image
from tests.scenes import CAMERA, photograph, view

PAD = PadSpec()
BOX = Detection("pad", 0.8, 300.0, 200.0, 340.0, 240.0)


class Seen:
    """A detector that gives what it is told, and remembers where it looked."""

    def __init__(self, *boxes: Detection, in_region: tuple[Detection, ...] | None = None) -> None:
        self.boxes, self.in_region = boxes, boxes if in_region is None else in_region
        self.looked: list[Region | None] = []

    def detect(self, image: Image) -> tuple[Detection, ...]:  # noqa: ARG002
        self.looked.append(None)
        return self.boxes

    def detect_region(self, image: Image, region: Region) -> tuple[Detection, ...]:  # noqa: ARG002
        self.looked.append(region)
        return self.in_region


def frame(index: int = 0, image: Image | None = None) -> Frame:
    return Frame(index, index, np.zeros((480, 640, 3), np.uint8) if image is None else image)


def rendered() -> tuple[Image, np.ndarray]:
    """A photograph of the pad, and the tight box of its ring."""
    pose = view(3.0, 12.0, 0.5, 0.4)
    ring = CAMERA.project(pose.apply(PAD.outline_m))
    return photograph(pose, np.random.default_rng(1)), np.concatenate([ring.min(axis=0), ring.max(axis=0)])


def detection(box: np.ndarray, score: float = 0.8, label: str = "pad") -> Detection:
    return Detection(label, score, *map(float, box))


def edges(box: Detection) -> np.ndarray:
    return np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px])


def test_whole_frames_are_searched() -> None:
    seen = Seen(BOX)
    stage = DetectStage(seen)
    assert [stage.find(frame(i)).search for i in range(3)] == ["frame"] * 3
    assert seen.looked == [None] * 3


def test_regions_follow_a_detection_and_the_whole_frame_comes_every_so_often() -> None:
    seen = Seen(BOX)
    stage = DetectStage(seen, regions=True)
    searches = [stage.find(frame(i)).search for i in range(32)]
    assert [i for i, search in enumerate(searches) if search == "frame"] == [0, 15, 30]
    assert len(seen.looked) == 32


def test_a_box_that_is_lost_is_looked_for_in_the_same_whole_frame() -> None:
    elsewhere = replace(BOX, x_min_px=10.0, x_max_px=50.0)
    seen = Seen(BOX)
    stage = DetectStage(seen, regions=True)
    stage.find(frame(0))
    seen.boxes, seen.in_region = (elsewhere,), ()
    found = stage.find(frame(1))
    assert (found.search, found.detections) == ("frame", (elsewhere,))
    assert stage.find(frame(2)).search == "frame", "nothing is there again"
    assert len(seen.looked) == 5


def test_a_box_cut_by_the_regions_rim_is_looked_for_in_the_whole_frame() -> None:
    seen = Seen(BOX)
    stage = DetectStage(seen, regions=True)
    stage.find(frame(0))
    stage.find(frame(1))
    region = seen.looked[-1]
    assert region is not None
    seen.in_region = (replace(BOX, x_min_px=region.x0 - 0.5),)
    found = stage.find(frame(2))
    assert (found.search, found.detections) == ("frame", (BOX,))


def test_the_pads_box_moves_onto_its_ring() -> None:
    image, truth = rendered()
    rough = detection(truth + [-3.0, 2.0, 2.0, -3.0])
    (found,) = DetectStage(Seen(rough), ring_of=PAD).find(frame(0, image)).detections
    assert np.abs(edges(found) - truth).max() < 0.3
    assert (found.label, found.score) == (rough.label, rough.score)
    (kept,) = DetectStage(Seen(rough)).find(frame(0, image)).detections
    assert kept == rough


def test_boxes_of_other_classes_and_boxes_without_a_ring_stay() -> None:
    image, truth = rendered()
    car = detection(truth + 2.0, label="car")
    nowhere = detection(np.array([5.0, 5.0, 60.0, 60.0]), 0.3)
    assert DetectStage(Seen(car, nowhere), ring_of=PAD).find(frame(0, image)).detections == (car, nowhere)


def test_two_boxes_on_one_ring_become_the_better_one() -> None:
    image, truth = rendered()
    width = truth[2] - truth[0]
    left, right = detection(truth - 0.04 * width, 0.9), detection(truth + 0.04 * width, 0.5)
    sign = detection(truth, 0.7, label="sign")
    found = DetectStage(Seen(left, sign, right), ring_of=PAD).find(frame(0, image)).detections
    assert [(box.label, box.score) for box in found] == [("pad", 0.9), ("sign", 0.7)]


def test_a_box_at_the_border_stays_in_the_picture() -> None:
    image, truth = rendered()
    cut = image[:, : int(truth[2]) - 20]
    visible = np.minimum(truth, cut.shape[1] - 0.5)
    (found,) = DetectStage(Seen(detection(visible + [2.0, 1.0, 0.0, 1.0])), ring_of=PAD).find(frame(0, cut)).detections
    assert found.x_max_px <= cut.shape[1] - 0.5
    assert np.abs(edges(found) - visible).max() < 1.0
