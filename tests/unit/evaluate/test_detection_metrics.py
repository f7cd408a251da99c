"""Metrics of boxes over a data set and its parts: known answers, nothing there, and classes that do not fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from landtool.errors import InputError
from landtool.evaluate.boxes import BOX_COLUMNS, box_rows
from landtool.evaluate.detection import PrecisionRecall, score_detections
from landtool.evaluate.detection_metrics import (
    CURVE_POINTS,
    ScoredPicture,
    class_notes,
    detection_curve,
    detection_metrics,
    thinned,
    unheard_classes,
    unknown_classes,
)
from landtool.evaluate.facts import Facts
from landtool.evaluate.metric import Metric
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.io.tables import Cell
from landtool.types import Detection
from tests.unit.evaluate.coco_oracle import NAMES, RandomSet

Edges = tuple[float, float, float, float]
SQUARE: Edges = (100.0, 100.0, 150.0, 150.0)
AWAY: Edges = (400.0, 100.0, 450.0, 150.0)
CLEAR, FOG = Facts(fog_per_m=0.0), Facts(fog_per_m=0.15, blur_px=3.0, distance_m=7.0, shadow=0.2)
WHOLE = (
    "map50",
    "map50_95",
    "ap75",
    "precision",
    "recall",
    "mean_iou",
    "false_alarms_per_frame",
    "background_false_alarm_share",
)


def picture(
    name: str, boxes: Sequence[Edges], found: Sequence[Detection], facts: Facts = CLEAR, class_id: int = 0
) -> ScoredPicture:
    labels = tuple(LabelledBox(class_id, *box) for box in boxes)
    return ScoredPicture("test", name, None, name, LabelledImage(Path(name), 640, 480, labels), tuple(found), facts)


def found(box: Edges, score: float = 0.9, label: str = "pad") -> Detection:
    return Detection(label, score, *box)


def metrics(pictures: Sequence[ScoredPicture], names: Sequence[str] = ("pad",)) -> dict[str, Metric]:
    told = detection_metrics(pictures, names, conf=0.25, alarm_conf=0.5)
    by_key = {metric.key.removeprefix("detection."): metric for metric in told}
    assert len(by_key) == len(told)
    return by_key


def random_pictures(drawn: RandomSet) -> list[ScoredPicture]:
    rng = np.random.default_rng(drawn.seed)
    return [
        ScoredPicture("test", image.path.name, None, image.path, image, boxes, Facts(fog_per_m=float(fog)))
        for image, boxes, fog in zip(*drawn.draw(), rng.choice([0.0, 0.07, 0.15], drawn.pictures), strict=True)
    ]


# --- known answers


def test_it_agrees_with_the_scores_of_training() -> None:
    pictures = random_pictures(RandomSet(3, 40, 3, 6, 2, 0.1, False, False))
    told = metrics(pictures, NAMES[:2])
    score = score_detections([p.image for p in pictures], [p.found for p in pictures], NAMES[:2])
    assert told["map50"].value == pytest.approx(score.map50, abs=1e-9)
    assert told["map50_95"].value == pytest.approx(score.map50_95, abs=1e-9)
    assert told["ap75"].value == pytest.approx(score.ap_by_iou[5], abs=1e-9)
    assert told["precision"].value == pytest.approx(score.precision)
    assert told["recall"].value == pytest.approx(score.recall)
    assert told["mean_iou"].value == pytest.approx(score.mean_iou)
    assert told["false_alarms_per_frame"].value == pytest.approx(len(score.false_alarms) / 40)
    assert told["recall"].count == score.targets
    for size in score.sizes:
        if size.targets:
            high = "more" if math.isinf(size.high_px) else f"{size.high_px:g}"
            part = told[f"recall:size_px={size.low_px:g}-{high}"]
            assert (part.value, part.count) == (pytest.approx(size.recall), size.targets)


def test_parts_are_those_pictures_alone() -> None:
    pictures = random_pictures(RandomSet(5, 60, 3, 6, 2, 0.1, False, False))
    told = metrics(pictures, NAMES[:2])
    for name, fog in (("clear", 0.0), ("0.05-0.1", 0.07), ("0.1-0.2", 0.15)):
        alone = metrics([p for p in pictures if p.facts.fog_per_m == fog], NAMES[:2])
        for metric in ("map50", "recall", "false_alarms_per_frame"):
            part, whole = told[f"{metric}:fog_per_m={name}"], alone[metric]
            assert part.value == pytest.approx(whole.value, abs=1e-12)
            assert (part.count, part.of) == (whole.count, whole.of)


def test_recall_by_every_fact_that_is_known() -> None:
    pictures = [picture("a", [SQUARE], [found(SQUARE)], FOG), picture("b", [SQUARE], [], Facts(blur_px=3.5))]
    told = metrics(pictures)
    recalls = {key: (metric.value, metric.count) for key, metric in told.items() if key.startswith("recall:")}
    assert recalls == {
        "recall:size_px=40-100": (0.5, 2),
        "recall:distance_m=6-8": (1.0, 1),
        "recall:fog_per_m=0.1-0.2": (1.0, 1),
        "recall:shadow=0.01-0.5": (1.0, 1),
        "recall:blur_px=2-4": (0.5, 2),
    }


def test_alarms_where_something_is_and_where_nothing_is() -> None:
    pictures = [
        picture("a", [SQUARE], [found(SQUARE), found(AWAY, 0.6), found(AWAY, 0.4)]),
        picture("b", [], [found(AWAY), found(SQUARE)]),
        picture("c", [], [found(AWAY, 0.4)]),
        picture("d", [], []),
    ]
    told = metrics(pictures)
    assert (told["false_alarms_per_frame"].value, told["false_alarms_per_frame"].count) == (0.75, 4)
    share = told["background_false_alarm_share"]
    assert (share.value, share.count, share.of) == (pytest.approx(1 / 3), 3, 3)
    assert (told["precision"].value, told["precision"].count) == (pytest.approx(1 / 6), 6)
    assert {told[name].better for name in WHOLE} == {"higher", "lower"}
    assert told["false_alarms_per_frame"].better == share.better == "lower"


def test_a_low_score_finds_nothing_but_counts_in_the_average() -> None:
    told = metrics([picture("a", [SQUARE], [found(SQUARE, 0.2)])])
    assert told["map50"].value == 1.0
    assert (told["recall"].value, told["recall"].count) == (0.0, 1)
    assert (told["mean_iou"].value, told["mean_iou"].count, told["mean_iou"].of) == (None, 0, 1)


def test_a_crowd_is_no_target() -> None:
    crowded = picture("a", [SQUARE], [found(SQUARE)])
    box = replace(crowded.image.boxes[0], crowd=True)
    told = metrics([replace(crowded, image=replace(crowded.image, boxes=(box,)))])
    assert (told["map50"].value, told["recall"].value, told["precision"].value) == (None, None, None)
    assert told["false_alarms_per_frame"].value == 0.0
    # and a picture with a crowd is no background
    assert told["background_false_alarm_share"].of == 0


# --- intervals


def test_intervals_hold_the_value_and_shrink_with_more_pictures() -> None:
    few, many = (random_pictures(RandomSet(2, n, 3, 4, 1, 0.0, False, False)) for n in (60, 540))
    widths = []
    for pictures in (few, many):
        told = metrics(pictures)
        for name in WHOLE:
            metric = told[name]
            assert metric.value is not None
            assert metric.low is not None
            assert metric.high is not None
            assert metric.low <= metric.value <= metric.high
        widths.append([told[name].high - told[name].low for name in ("map50", "recall", "precision")])  # type: ignore[operator]
    # 9 times the pictures: a third of the width
    np.testing.assert_allclose(np.array(widths[0]) / widths[1], 3.0, rtol=0.4)


def test_pictures_of_one_unit_are_drawn_together() -> None:
    pictures = random_pictures(RandomSet(2, 60, 3, 4, 1, 0.0, False, False))
    copies = [replace(p, file=f"{p.file} {k}") for p in pictures for k in range(4)]
    once, four = metrics(pictures), metrics(copies)
    apart = metrics([replace(p, unit=p.file) for p in copies])
    for name in ("map50", "recall"):
        # four frames of one second know no more than one
        assert four[name].value == pytest.approx(once[name].value, abs=0.01)
        wide, same, narrow = (m[name].high - m[name].low for m in (once, four, apart))  # type: ignore[operator]
        assert same == pytest.approx(wide, rel=0.1)
        assert narrow < 0.7 * wide


def test_of_few_pictures_there_is_no_interval() -> None:
    told = metrics([picture(f"{i}", [SQUARE], [found(SQUARE)]) for i in range(4)])
    assert all((told[name].low, told[name].high) == (None, None) for name in WHOLE)


def test_the_same_pictures_give_the_same_numbers() -> None:
    pictures = random_pictures(RandomSet(2, 30, 3, 4, 1, 0.0, False, False))
    assert metrics(pictures) == metrics(pictures)


# --- nothing there


@pytest.mark.parametrize("pictures", [[], [picture("a", [], [])] * 6, [picture("a", [], [found(SQUARE, 0.01)])]])
def test_without_targets_the_averages_are_undefined(pictures: list[ScoredPicture]) -> None:
    told = metrics(pictures)
    for name in ("map50", "map50_95", "ap75", "precision", "recall", "mean_iou"):
        assert told[name].said == "undefined, 0 of 0"
    assert told["false_alarms_per_frame"].value == (0.0 if pictures else None)
    assert set(WHOLE) <= set(told)
    assert not any(key.startswith(("recall:", "map50:")) for key in told)


def test_without_detections_nothing_is_found() -> None:
    told = metrics([picture(f"{i}", [SQUARE], []) for i in range(6)])
    assert [told[name].value for name in WHOLE] == [0.0, 0.0, 0.0, None, 0.0, None, 0.0, None]
    assert (told["map50"].low, told["map50"].high) == (0.0, pytest.approx(1.0 - 0.025 ** (1 / 6)))
    assert told["mean_iou"].said == "undefined, 0 of 6"


def test_no_value_is_anything_but_a_number() -> None:
    for drawn in (RandomSet(k, 8, 2, 2, 3, 0.5, True, True) for k in range(6)):
        for metric in metrics(random_pictures(drawn), NAMES).values():
            for value in (metric.value, metric.low, metric.high):
                assert value is None or math.isfinite(value)


# --- classes that do not fit


def test_classes_the_dataset_does_not_name_are_left_out_and_said() -> None:
    boxes = [found(SQUARE), found(AWAY, 0.99, "car"), found(AWAY, 0.98, "car"), found(AWAY, 0.97, "dog")]
    pictures = [picture("a", [SQUARE], boxes)]
    told = metrics(pictures)
    assert (told["map50"].value, told["precision"].value, told["false_alarms_per_frame"].value) == (1.0, 1.0, 0.0)
    assert unknown_classes(pictures, ("pad",)) == {"car": 2, "dog": 1}
    assert class_notes(pictures, ("pad",), ("pad", "car", "dog")) == [
        "detections of 'car' are left out, as the dataset has no such class: 2",
        "detections of 'dog' are left out, as the dataset has no such class: 1",
    ]


def test_classes_the_model_does_not_have_are_missed_and_said() -> None:
    pictures = [picture("a", [SQUARE], [found(SQUARE)]), picture("b", [SQUARE, AWAY], [], class_id=1)]
    told = metrics(pictures, ("pad", "sign"))
    assert (told["map50"].value, told["recall"].value) == (0.5, pytest.approx(1 / 3))
    assert unheard_classes(pictures, ("pad", "sign"), ("pad",)) == {"sign": 2}
    assert class_notes(pictures, ("pad", "sign"), ("pad",)) == [
        "targets of 'sign' count as missed, as the model has no such class: 2"
    ]


def test_only_foreign_classes() -> None:
    pictures = [picture(f"{i}", [SQUARE], [found(SQUARE, label="car")]) for i in range(6)]
    told = metrics(pictures)
    assert (told["map50"].value, told["recall"].value, told["precision"].value) == (0.0, 0.0, None)
    assert len(detection_curve(pictures, ("pad",)).score) == 0


def test_a_detection_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InputError, match="a: has a detection that is not finite; the network is broken"):
        metrics([picture("a", [], [found((0.0, 0.0, math.nan, 1.0))])])


# --- the curve


def test_the_curve_is_that_of_all_detections() -> None:
    pictures = random_pictures(RandomSet(3, 40, 3, 6, 1, 0.1, False, False))
    score = score_detections([p.image for p in pictures], [p.found for p in pictures], NAMES[:1])
    curve = detection_curve(pictures, NAMES[:1])
    np.testing.assert_array_equal(curve.score, score.curve.score)
    np.testing.assert_array_equal(curve.recall, score.curve.recall)


def test_a_long_curve_is_thinned_and_keeps_its_shape() -> None:
    rng = np.random.default_rng(0)
    hits = np.cumsum(rng.random(20_000) < np.linspace(1.0, 0.0, 20_000))
    curve = PrecisionRecall(np.linspace(1.0, 0.0, 20_000), hits / np.arange(1, 20_001), hits / 10_000)
    thin = thinned(curve, CURVE_POINTS)
    assert 400 <= len(thin.score) <= CURVE_POINTS
    assert (thin.score[0], thin.score[-1]) == (1.0, 0.0)
    assert (np.diff(thin.score) < 0.0).all()
    again = np.interp(curve.recall, thin.recall, thin.precision)
    assert np.abs(again - curve.precision)[100:].max() < 0.01


# --- rows


def cells(pictures: Sequence[ScoredPicture], names: Sequence[str] = ("pad",)) -> list[dict[str, Cell]]:
    return [dict(zip(BOX_COLUMNS, row, strict=True)) for row in box_rows(pictures, names, 0.25, 0.5)]


def test_rows_of_targets_and_alarms() -> None:
    near = (110.0, 100.0, 160.0, 150.0)  # IoU 2/3 with the square
    pictures = [
        picture("a", [SQUARE], [found(near, 0.8), found((120.0, 100.0, 200.0, 150.0), 0.7), found(AWAY, 0.4)], FOG),
        picture("b", [], []),
        replace(picture("c", [SQUARE, AWAY], [found(SQUARE, 0.1), found(AWAY, 0.9, "car")]), frame=7),
    ]
    hit, alarm, low, missed = cells(pictures)
    assert hit == {
        "part": "test", "file": "a", "frame": None, "kind": "target", "label": "pad", "found": 1, "score": 0.8,
        "iou": pytest.approx(2 / 3), "size_px": 50.0, "distance_m": 7.0, "fog_per_m": 0.15, "shadow": 0.2,
        "blur_px": 3.0,
    }  # fmt: skip
    assert (alarm["kind"], alarm["found"], alarm["score"], alarm["size_px"]) == ("false_alarm", None, 0.7, 80.0)
    assert alarm["iou"] == pytest.approx(30 / 100)
    assert (alarm["distance_m"], alarm["shadow"], alarm["fog_per_m"], alarm["blur_px"]) == (None, None, 0.15, 3.0)
    assert (low["frame"], low["found"], low["score"], low["iou"]) == (7, 0, 0.1, 1.0)
    assert (missed["found"], missed["score"], missed["iou"], missed["size_px"]) == (0, None, None, 50.0)


def test_rows_and_metrics_say_the_same() -> None:
    pictures = random_pictures(RandomSet(3, 40, 3, 6, 2, 0.1, False, False))
    told, rows = metrics(pictures, NAMES[:2]), cells(pictures, NAMES[:2])
    targets = [row for row in rows if row["kind"] == "target"]
    assert told["recall"].value == pytest.approx(np.mean([row["found"] for row in targets]))
    assert told["recall"].count == len(targets)
    assert told["false_alarms_per_frame"].value == pytest.approx((len(rows) - len(targets)) / len(pictures))
    assert told["mean_iou"].value == pytest.approx(np.mean([float(r["iou"] or 0.0) for r in targets if r["found"]]))
    order = [int(str(row["file"]).removesuffix(".png")) for row in rows]
    assert order == sorted(order)


def test_no_pictures_have_no_rows() -> None:
    assert cells([]) == []
