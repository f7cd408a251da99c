"""Scores of boxes: against COCO's rules written down a second time, and where the answer is known."""

from __future__ import annotations

import logging
import math
import time
import warnings
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.evaluate.detection import IOUS, SIZES_PX, score_detections
from landtool.geometry import Array
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.types import Detection

Edges = tuple[float, float, float, float]
SQUARE: Edges = (100.0, 100.0, 150.0, 150.0)
NAMES = ("pad", "sign")
# of random_pictures(0, 60, 6), by pycocotools 2.0.11
PYCOCOTOOLS_AP50 = (0.10419428813432055, 0.11542113767059259)
PYCOCOTOOLS_AP = 0.05967700923346786


def image(*boxes: Edges, name: str = "a.png", class_id: int = 0, crowd: bool = False) -> LabelledImage:
    return LabelledImage(Path(name), 640, 480, tuple(LabelledBox(class_id, *box, crowd=crowd) for box in boxes))


def found(box: Edges, score: float = 0.9, label: str = "pad") -> Detection:
    return Detection(label, score, *box)


def moved(box: Edges, pixels: float) -> Edges:
    return box[0] + pixels, box[1], box[2] + pixels, box[3]


# --- known answers


def test_a_perfect_detector_scores_one() -> None:
    truth = [image(SQUARE, (0.0, 0.0, 10.0, 10.0)), image()]
    score = score_detections(truth, [[found(SQUARE), found((0.0, 0.0, 10.0, 10.0), 0.3)], []])
    assert (score.map50, score.map50_95, score.precision, score.recall, score.mean_iou) == (1.0, 1.0, 1.0, 1.0, 1.0)
    assert score.ap_by_iou == (1.0,) * 10
    assert (score.pictures, score.targets, score.false_alarms) == (2, 2, ())


def test_a_box_a_little_off_counts_up_to_its_own_iou() -> None:
    # 50 x 50 moved by 10: 40 / 60 = 0.667
    score = score_detections([image(SQUARE)], [[found(moved(SQUARE, 10.0))]])
    assert score.ap_by_iou == tuple(1.0 if limit < 2 / 3 else 0.0 for limit in IOUS)
    assert score.map50_95 == pytest.approx(0.4)
    assert score.mean_iou == pytest.approx(2 / 3)


def test_edges_are_continuous() -> None:
    # a box of half a pixel exists, and one of exactly half the width has an IoU of 0.5, which is enough
    score = score_detections([image((10.0, 10.0, 10.5, 10.5))], [[found((10.0, 10.0, 10.25, 10.5))]])
    assert score.map50 == 1.0
    assert score.mean_iou == 0.5


def test_average_precision_where_a_false_alarm_ranks_first() -> None:
    # precision is 1/2 at any recall
    truth = [image(SQUARE), image(name="b.png")]
    score = score_detections(truth, [[found(SQUARE, 0.6)], [found(SQUARE, 0.8)]])
    assert score.map50 == pytest.approx(0.5)
    assert (score.precision, score.recall) == (0.5, 1.0)
    np.testing.assert_allclose(score.curve.score, [0.8, 0.6])
    np.testing.assert_allclose(score.curve.precision, [0.0, 0.5])
    np.testing.assert_allclose(score.curve.recall, [0.0, 1.0])


def test_a_second_box_on_a_found_target_is_a_false_alarm() -> None:
    score = score_detections([image(SQUARE)], [[found(SQUARE, 0.7), found(moved(SQUARE, 1.0), 0.9)]])
    assert score.precision == 0.5
    (alarm,) = score.false_alarms
    assert (alarm.detection.score, alarm.iou, alarm.background) == (0.7, 1.0, False)


def test_precision_and_recall_are_those_at_the_confidence() -> None:
    boxes = [found(SQUARE, 0.25), found(moved(SQUARE, 300.0), 0.2499)]
    score = score_detections([image(SQUARE)], [boxes])
    assert (score.precision, score.recall) == (1.0, 1.0)
    score = score_detections([image(SQUARE)], [boxes], conf=0.1)
    assert (score.precision, score.recall) == (0.5, 1.0)
    score = score_detections([image(SQUARE)], [boxes], conf=0.3)
    assert (score.precision, score.recall, score.mean_iou) == (None, 0.0, None)
    assert score.map50 == 1.0


def test_false_alarms_name_their_picture_and_come_by_score() -> None:
    truth = [image(name="a.png"), image(SQUARE, name="b.png")]
    low, sign, near = found(SQUARE, 0.49), found(SQUARE, 0.5), found(moved(SQUARE, 25.0), 0.8)
    score = score_detections(truth, [[low, sign], [near]])
    assert [(a.path.name, a.detection, a.background) for a in score.false_alarms] == [
        ("b.png", near, False),
        ("a.png", sign, True),
    ]
    assert score.false_alarms[0].iou == pytest.approx(1 / 3)
    assert len(score_detections(truth, [[low, sign], [near]], alarm_conf=0.4).false_alarms) == 3


def test_recall_by_the_longer_side_of_the_target() -> None:
    sides = (13.99, 14.0, 19.0, 39.0, 99.0, 299.0, 300.0)
    truth = [image((10.0, 10.0, 10.0 + side, 15.0), name=f"{side}.png") for side in sides]
    boxes = [[found((10.0, 10.0, 10.0 + side, 15.0), 0.2 if side == 19.0 else 0.9)] for side in sides]
    score = score_detections(truth, boxes)
    assert [(size.low_px, size.high_px) for size in score.sizes] == list(pairwise(SIZES_PX))
    assert [(size.found, size.targets) for size in score.sizes] == [(1, 1), (1, 2), (1, 1), (1, 1), (1, 1), (1, 1)]
    assert score.sizes[1].recall == 0.5
    assert score.recall_from(14.0) == pytest.approx(5 / 6)
    assert score.recall_from(20.0) == 1.0
    assert score.recall_from(0.0) == score.recall
    assert math.isinf(score.sizes[-1].high_px)


def test_recall_from_another_size_is_refused() -> None:
    with pytest.raises(UsageError, match="15 px is no bound"):
        score_detections([image(SQUARE)], [[]]).recall_from(15.0)


def test_a_crowd_is_no_target_and_its_detections_count_neither_way() -> None:
    crowd = LabelledBox(0, 200.0, 200.0, 400.0, 400.0, crowd=True)
    truth = [replace(image(SQUARE), boxes=(*image(SQUARE).boxes, crowd))]
    # in the crowd, over its border by less than half, and beside it
    inside, across, beside = (250.0, 250.0, 270.0, 270.0), (190.0, 300.0, 230.0, 310.0), (500.0, 10.0, 520.0, 30.0)
    score = score_detections(truth, [[found(inside, 0.99), found(across, 0.98), found(inside, 0.97), found(SQUARE)]])
    assert (score.targets, score.map50, score.precision, score.recall) == (1, 1.0, 1.0, 1.0)
    assert score.false_alarms == ()
    score = score_detections(truth, [[found(beside, 0.99), found(SQUARE)]])
    assert (score.map50, score.precision) == (0.5, 0.5)


def test_a_target_is_preferred_to_the_crowd_around_it() -> None:
    crowd = LabelledBox(0, 0.0, 0.0, 400.0, 400.0, crowd=True)
    truth = [replace(image(SQUARE), boxes=(crowd, *image(SQUARE).boxes))]
    # IoU 0.667 with the target, 1 with the crowd
    assert score_detections(truth, [[found(moved(SQUARE, 10.0))]]).recall == 1.0


def test_classes_are_scored_apart() -> None:
    truth = [image(SQUARE), image(SQUARE, class_id=1)]
    score = score_detections(truth, [[found(SQUARE)], [found(SQUARE, label="pad")]], NAMES)
    assert score.ap50_by_class == (1.0, 0.0)
    assert score.map50 == 0.5
    assert score.false_alarms[0].iou == 0.0
    assert not score.false_alarms[0].background


def test_a_class_without_targets_is_not_in_the_mean() -> None:
    score = score_detections([image(SQUARE)], [[found(SQUARE), found(SQUARE, label="sign")]], NAMES)
    assert score.ap50_by_class == (1.0, None)
    assert score.map50 == 1.0
    assert score.precision == 0.5


# --- nothing there


@pytest.mark.parametrize("boxes", [[], [found(SQUARE)]])
def test_without_targets_the_averages_are_undefined(boxes: list[Detection]) -> None:
    score = score_detections([image()], [boxes])
    assert (score.map50, score.map50_95, score.recall, score.mean_iou) == (None, None, None, None)
    assert score.ap_by_iou == (None,) * 10
    assert score.precision == (0.0 if boxes else None)
    assert len(score.false_alarms) == len(boxes)
    assert len(score.curve.score) == 0
    assert all(size.recall is None for size in score.sizes)


def test_without_detections_nothing_is_found() -> None:
    score = score_detections([image(SQUARE)], [[]])
    assert (score.map50, score.map50_95, score.recall, score.precision) == (0.0, 0.0, 0.0, None)
    assert score.recall_from(300.0) is None
    assert len(score.curve.score) == 0


def test_without_pictures_nothing_is_known() -> None:
    score = score_detections([], [])
    assert (score.pictures, score.targets, score.map50, score.precision, score.recall) == (0, 0, None, None, None)


def test_empty_boxes_overlap_nothing() -> None:
    point = (100.0, 100.0, 100.0, 100.0)
    score = score_detections([image(point)], [[found(point), found((50.0, 50.0, 40.0, 40.0))]])
    assert (score.map50, score.recall, score.precision) == (0.0, 0.0, 0.0)


# --- bad input


def test_another_class_is_refused() -> None:
    with pytest.raises(UsageError, match="class 'person' is none of the dataset's; known: pad, sign"):
        score_detections([image(SQUARE)], [[found(SQUARE, label="person")]], NAMES)


@pytest.mark.parametrize("bad", [found(SQUARE, math.nan), found((0.0, 0.0, math.inf, 1.0))])
def test_a_detection_that_is_not_finite_is_refused(bad: Detection) -> None:
    with pytest.raises(InputError, match=r"a\.png: has a detection that is not finite"):
        score_detections([image(SQUARE)], [[bad]])


def test_pictures_and_detections_must_pair() -> None:
    with pytest.raises(ValueError, match="1 pictures, but detections of 2"):
        score_detections([image()], [[], []])


# --- against COCO's rules, written a second time


def random_pictures(seed: int, pictures: int, boxes: int) -> tuple[list[LabelledImage], list[list[Detection]]]:
    """Targets and crowds of two classes, detections near them and anywhere, many of equal score."""
    rng = np.random.RandomState(seed)  # its numbers are frozen for good, so those of pycocotools below hold
    truth, given = [], []
    for i in range(pictures):
        labels = tuple(_random_label(rng) for _ in range(rng.randint(0, 4)))
        near = [label for label in labels for _ in range(rng.randint(0, 4))]
        found_here = [_near(rng, label) for label in near]
        found_here += [_near(rng, _random_label(rng)) for _ in range(boxes)]
        truth.append(LabelledImage(Path(f"{i}.png"), 640, 480, labels))
        given.append(found_here)
    return truth, given


def _random_label(rng: np.random.RandomState) -> LabelledBox:
    low, size = rng.uniform(0.0, 400.0, 2), rng.uniform(4.0, 200.0, 2)
    crowd = bool(rng.random_sample() < 0.1)
    (x0, y0), (x1, y1) = low.tolist(), (low + size).tolist()
    return LabelledBox(int(rng.random_sample() < 0.2), x0, y0, x1, y1, crowd)


def _near(rng: np.random.RandomState, label: LabelledBox) -> Detection:
    edges = np.array([label.x_min_px, label.y_min_px, label.x_max_px, label.y_max_px])
    wide = (edges[2:] - edges[:2]).mean()
    edges = edges + rng.normal(0.0, 0.08 * wide, 4)
    name = NAMES[label.class_id if rng.random_sample() < 0.95 else 1 - label.class_id]
    return Detection(name, round(float(rng.random_sample()) ** 2, 2), *map(float, edges))


def coco_ap(truth: list[LabelledImage], given: list[list[Detection]], class_id: int, limit: float) -> float | None:
    """Average precision of a class at one IoU, box by box, after Lin et al., "Microsoft COCO", 2014."""
    ranked: list[tuple[float, int]] = []  # minus the score, right or wrong
    targets = 0
    for picture, boxes in zip(truth, given, strict=True):
        labels = sorted((b for b in picture.boxes if b.class_id == class_id), key=lambda b: b.crowd)
        targets += sum(not label.crowd for label in labels)
        taken: set[int] = set()
        mine = sorted((d for d in boxes if d.label == NAMES[class_id]), key=lambda d: -d.score)[:100]
        for box in mine:
            best, at = min(limit, 1.0 - 1e-10), None
            for k, label in enumerate(labels):
                if k in taken and not label.crowd:
                    continue
                if at is not None and label.crowd and not labels[at].crowd:
                    break
                if (overlap := plain_iou(box, label)) >= best:
                    best, at = overlap, k
            if at is not None:
                taken.add(at)
            if at is None or not labels[at].crowd:
                ranked.append((-box.score, int(at is not None)))
    if not targets:
        return None
    hits = np.cumsum([hit for _, hit in sorted(ranked, key=lambda item: item[0])])
    recall, precision = hits / targets, hits / np.arange(1, len(hits) + 1)
    points = np.linspace(0.0, 1.0, 101)
    return float(np.mean([precision[recall >= r].max(initial=0.0) for r in points]))


def numbers(values: tuple[float | None, ...]) -> Array:
    """None becomes NaN."""
    return np.array(values, np.float64)


def plain_iou(box: Detection, label: LabelledBox) -> float:
    across = min(box.x_max_px, label.x_max_px) - max(box.x_min_px, label.x_min_px)
    down = min(box.y_max_px, label.y_max_px) - max(box.y_min_px, label.y_min_px)
    shared = max(across, 0.0) * max(down, 0.0)
    area = max(box.x_max_px - box.x_min_px, 0.0) * max(box.y_max_px - box.y_min_px, 0.0)
    other = (label.x_max_px - label.x_min_px) * (label.y_max_px - label.y_min_px)
    union = area if label.crowd else area + other - shared
    return shared / union if union else 0.0


@pytest.mark.parametrize(("seed", "pictures", "boxes"), [(0, 60, 6), (1, 200, 1), (2, 12, 230)])
def test_average_precision_is_cocos(seed: int, pictures: int, boxes: int) -> None:
    truth, given = random_pictures(seed, pictures, boxes)
    score = score_detections(truth, given, NAMES)
    expected = np.array([[coco_ap(truth, given, class_id, limit) for class_id in (0, 1)] for limit in IOUS])
    np.testing.assert_allclose(numbers(score.ap50_by_class), expected[0], atol=1e-6)
    np.testing.assert_allclose(numbers(score.ap_by_iou), expected.mean(axis=1), atol=1e-6)
    assert score.map50_95 == pytest.approx(expected.mean(), abs=1e-6)
    assert 0.001 < expected.mean() < 0.95


@pytest.mark.parametrize("seed", range(3))
def test_the_curve_holds_the_same_average_precision(seed: int) -> None:
    # another way to it: the library matches for the average, this package for the curve
    truth, given = random_pictures(seed, 40, 3)
    given = [[replace(box, label="pad") for box in boxes] for boxes in given]
    truth = [replace(img, boxes=tuple(replace(box, class_id=0) for box in img.boxes)) for img in truth]
    score = score_detections(truth, given)
    points = np.linspace(0.0, 1.0, 101)
    precision = [score.curve.precision[score.curve.recall >= r].max(initial=0.0) for r in points]
    assert score.map50 == pytest.approx(np.mean(precision), abs=1e-6)


def test_values_of_pycocotools() -> None:
    score = score_detections(*random_pictures(0, 60, 6), NAMES)
    np.testing.assert_allclose(numbers(score.ap50_by_class), np.array(PYCOCOTOOLS_AP50), atol=1e-6)
    assert score.map50_95 == pytest.approx(PYCOCOTOOLS_AP, abs=1e-6)


# --- quiet and quick


def test_it_is_quiet(capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> None:
    truth, given = random_pictures(0, 10, 3)
    with warnings.catch_warnings(), caplog.at_level(logging.INFO):
        warnings.simplefilter("error")
        score_detections(truth, given, NAMES)
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []


def test_the_order_of_detections_and_the_inputs_stay() -> None:
    truth, given = random_pictures(3, 30, 3)
    before = [list(boxes) for boxes in given]
    score = score_detections(truth, given, NAMES)
    assert given == before
    # scores of each picture apart from all others, so that no tie depends on the order
    apart = [[replace(b, score=(k + 1 + 100 * i) / 9000) for k, b in enumerate(bs)] for i, bs in enumerate(given)]
    turned = [boxes[::-1] for boxes in apart]
    assert score_detections(truth, apart, NAMES).map50_95 == score_detections(truth, turned, NAMES).map50_95
    assert score.map50 is not None


def test_training_can_call_it_every_few_minutes() -> None:
    truth, given = random_pictures(4, 20, 297)
    # as a network has it: most of what it says at all it says softly
    given = [[replace(box, label="pad", score=box.score**4) for box in boxes] for boxes in given]
    start = time.process_time()
    score_detections(truth * 25, given * 25, NAMES)
    assert time.process_time() - start < 4.0  # 0.7 s alone on one core
