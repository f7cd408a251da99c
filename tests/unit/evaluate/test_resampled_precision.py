"""Matches and average precision of whole sets: what pycocotools says, and what repeated pictures say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landtool.evaluate.average_precision import IOUS, average_precision
from landtool.evaluate.matching import NOBODY, picture_boxes
from landtool.evaluate.resampled_precision import WeightedPrecision
from landtool.evaluate.set_matching import match_set
from landtool.geometry import Array
from landtool.io.labels import LabelledImage
from landtool.types import Detection
from tests.unit.evaluate.coco_oracle import NAMES, RandomSet, coco_ap, coco_recall, pycocotools

SETS = st.builds(
    RandomSet,
    seed=st.integers(0, 2**32 - 1),
    pictures=st.integers(1, 12),
    targets=st.sampled_from((0, 1, 2, 5)),
    boxes=st.sampled_from((0, 1, 8, 130)),
    classes=st.integers(1, 3),
    crowds=st.sampled_from((0.0, 0.2, 1.0)),
    tied=st.booleans(),
    whole=st.booleans(),
)


def ap_of(truth: list[LabelledImage], found: list[tuple[Detection, ...]], classes: int) -> Array:
    pictures = picture_boxes(truth, found, NAMES[:classes])
    ranked = WeightedPrecision(match_set(pictures, IOUS), len(truth), classes)
    return ranked.average(np.ones((1, len(truth))), range(len(IOUS)))[:, :, 0]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(SETS)
def test_it_is_what_pycocotools_says(drawn: RandomSet) -> None:
    truth, found = drawn.draw()
    expected = pycocotools(truth, found, drawn.classes)
    pictures = picture_boxes(truth, found, NAMES[: drawn.classes])
    matches = match_set(pictures, IOUS)
    ap = ap_of(truth, found, drawn.classes)
    np.testing.assert_allclose(ap, coco_ap(expected), atol=1e-6)
    np.testing.assert_allclose(average_precision(pictures, drawn.classes), ap, atol=1e-9)
    for k in range(drawn.classes):
        real = (matches.truth_class == k) & ~matches.crowd
        recall = (matches.detection[:, real] != NOBODY).mean(axis=1) if real.any() else np.full(len(IOUS), np.nan)
        np.testing.assert_allclose(recall, coco_recall(expected)[:, k], atol=1e-6)


def test_the_sets_are_hard_enough() -> None:
    # values between nothing and everything, more than 100 detections of a class, and overlaps equal to a limit
    drawn = RandomSet(1, 12, 5, 130, 1, 0.2, True, True)
    truth, found = drawn.draw()
    ap = ap_of(truth, found, 1)
    assert 0.002 < ap.min() < 0.05 < ap.max() < 0.98
    assert max(map(len, found)) > 100
    matches = match_set(picture_boxes(truth, found, NAMES[:1]), IOUS)
    assert np.isin(np.round(matches.found_iou, 12), np.round(IOUS, 12)).any()
    assert matches.ignored.any()


@pytest.mark.parametrize("seed", range(3))
def test_a_weight_is_how_often_a_picture_is_there(seed: int) -> None:
    drawn = RandomSet(seed, 10, 3, 6, 2, 0.1, False, False)
    truth, found = drawn.draw()
    weights = np.random.default_rng(seed).integers(0, 4, (20, len(truth)))
    ranked = WeightedPrecision(match_set(picture_boxes(truth, found, NAMES[:2]), IOUS), len(truth), 2)
    values = ranked.average(weights.astype(np.float64), range(len(IOUS)))
    for row, counts in enumerate(weights):
        again = [i for i, count in enumerate(counts) for _ in range(count)]
        pictures = picture_boxes([truth[i] for i in again], [found[i] for i in again], NAMES[:2])
        np.testing.assert_allclose(values[:, :, row], average_precision(pictures, 2), atol=1e-9)


def test_levels_are_chosen_by_their_places() -> None:
    truth, found = RandomSet(7, 10, 3, 6, 2, 0.1, False, False).draw()
    ranked = WeightedPrecision(match_set(picture_boxes(truth, found, NAMES[:2]), IOUS), len(truth), 2)
    weights = np.ones((3, len(truth)))
    np.testing.assert_array_equal(ranked.average(weights, (5, 0)), ranked.average(weights, range(10))[[5, 0]])


def test_work_in_pieces_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    truth, found = RandomSet(7, 10, 3, 6, 2, 0.1, False, False).draw()
    ranked = WeightedPrecision(match_set(picture_boxes(truth, found, NAMES[:2]), IOUS), len(truth), 2)
    weights = np.random.default_rng(0).poisson(1.0, (50, len(truth))).astype(np.float64)
    whole = ranked.average(weights, (0,))
    monkeypatch.setattr("landtool.evaluate.resampled_precision._AT_ONCE", 1)
    np.testing.assert_allclose(ranked.average(weights, (0,)), whole, atol=1e-12)


def test_a_resample_without_targets_has_no_precision() -> None:
    truth, found = RandomSet(3, 10, 3, 6, 1, 0.0, False, False).draw()
    truth[0] = replace(truth[0], boxes=())
    ranked = WeightedPrecision(match_set(picture_boxes(truth, found, NAMES[:1]), IOUS), len(truth), 1)
    weights = np.zeros((2, len(truth)))
    weights[1, 0] = 1.0
    assert np.isnan(ranked.average(weights, range(10))).all()


@pytest.mark.parametrize("pictures", [0, 3])
def test_nothing_at_all(pictures: int) -> None:
    truth = [LabelledImage(Path(f"{i}.png"), 640, 480, ()) for i in range(pictures)]
    assert np.isnan(ap_of(truth, [()] * pictures, 2)).all()


def test_what_each_detection_and_target_has() -> None:
    truth, found = RandomSet(5, 10, 4, 10, 2, 0.1, False, False).draw()
    matches = match_set(picture_boxes(truth, found, NAMES[:2]), (0.5, 0.75))
    for level, limit in enumerate(matches.ious):
        overlap = matches.pair_iou(level)
        right = matches.target[level] != NOBODY
        assert (np.isfinite(overlap) == right).all()
        assert (overlap[right] >= limit).all()
        assert (overlap[right] <= matches.found_iou[right] + 1e-12).all()
        score = matches.truth_score(level)
        hit = matches.detection[level] != NOBODY
        assert (score[~hit] == -np.inf).all()
        assert (score[hit] == matches.score[matches.detection[level, hit]]).all()
        # both sides say the same
        own = np.flatnonzero(hit)
        assert (matches.target[level, matches.detection[level, own]] == own).all()
    assert (np.diff(matches.found_picture) >= 0).all()
