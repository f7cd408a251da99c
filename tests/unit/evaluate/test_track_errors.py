"""Errors of tracks and predictions: RMSE, honesty, lag, gaps, identity, false tracks, and what holding would do."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from landtool.evaluate.clip_truth import ClipTruth
from landtool.evaluate.metric import Metric
from landtool.evaluate.prediction_errors import (
    PREDICTION_ERROR_COLUMNS,
    prediction_error_row,
    prediction_errors,
    prediction_metrics,
)
from landtool.evaluate.track_errors import FIRST_S, TRACK_ERROR_COLUMNS, track_error_row, track_errors
from landtool.evaluate.track_gaps import clip_tracks
from landtool.evaluate.track_metrics import track_metrics
from landtool.geometry import Array
from landtool.types import FrameResult, Track
from tests.unit.evaluate.clips import FPS, SPEED_MPS, result, tracked, truth_of

FRAMES = 200


def results(truth: ClipTruth, of: Callable[[Array], tuple[Track, ...]]) -> list[FrameResult]:
    """Results whose tracks are made of the true place (2,) of their frame."""
    places = [frame.world_T_pad.translation[:2] for frame in truth.frames if frame.world_T_pad is not None]
    return [result(k, tracks=of(place)) for k, place in enumerate(places)]


def judged(of: Callable[[Array], tuple[Track, ...]], speed_mps: float = SPEED_MPS) -> dict[str, Metric]:
    truth = truth_of(FRAMES, speed_mps=speed_mps)
    metrics = track_metrics(track_errors("clip", results(truth, of), truth))
    found = {metric.key: metric for metric in metrics}
    assert len(found) == len(metrics)
    return found


def test_a_track_that_is_off_by_so_much_in_place_and_velocity() -> None:
    off = np.array([0.3, -0.4])
    metrics = judged(lambda place: (tracked(place + off, (SPEED_MPS, 0.1), nis=3.0),))
    assert metrics["track.place_rmse_m"].value == pytest.approx(0.5)
    assert metrics["track.velocity_rmse_mps"].value == pytest.approx(0.1)
    assert metrics["track.nees"].value == pytest.approx((0.25 + 0.01) / 0.01 / 4)
    assert metrics["track.nis"].value == pytest.approx(1.5)
    assert metrics["track.place_rmse_m"].count == FRAMES - FIRST_S * FPS
    assert metrics["track.place_rmse_m:stage=near"].value == pytest.approx(0.5)
    assert metrics["track.false_track_share"].value == 0.0


def test_errors_drawn_from_their_covariance_are_honest() -> None:
    rng = np.random.default_rng(3)
    root = np.linalg.cholesky(np.diag([0.04, 0.01, 0.02, 0.03]) + 0.005)

    def drawn(place: Array) -> tuple[Track, ...]:
        off = root @ rng.normal(size=4)
        state = np.array([*place, SPEED_MPS, 0.0]) + off
        return (tracked(state[:2], state[2:], covariance=root @ root.T),)

    truth = truth_of(800)
    metrics = {m.key: m for m in track_metrics(track_errors("clip", results(truth, drawn), truth))}
    assert metrics["track.nees"].value == pytest.approx(1.0, abs=0.08)
    assert metrics["track.nis"].said == "undefined, 0 of 780"


@pytest.mark.parametrize("late_s", [0.08, -0.03])
def test_the_lag_is_the_shift_in_time(late_s: float) -> None:
    metrics = judged(lambda place: (tracked(place - (late_s * SPEED_MPS, 0.0), (SPEED_MPS, 0.0)),))
    assert metrics["track.lag_s"].value == pytest.approx(abs(late_s))


def test_a_platform_that_stands_has_no_lag() -> None:
    metrics = judged(lambda place: (tracked(place + 0.1),), speed_mps=0.05)
    assert metrics["track.lag_s"].value is None
    assert metrics["track.lag_s"].of == FRAMES - FPS


def test_gaps_confirmation_and_identity_of_each_clip() -> None:
    truth = truth_of(100)

    def state(k: int) -> tuple[Track, ...]:
        place = (SPEED_MPS * k / FPS, 0.0)
        if k < 10:
            return (tracked(place, status="tentative"),)
        if 40 <= k < 47:  # frames 40 to 46 without: from 39 to 47, 0.4 s
            return (tracked(place, status="coasting"),)
        return (tracked(place, track_id=1 if k < 60 else 2),)

    seen = [result(k, tracks=state(k)) for k in range(96)] + [result(k) for k in range(96, 100)]
    (clip,) = clip_tracks(track_errors("clip", seen, truth))
    assert clip.confirm_s == pytest.approx(0.5)
    assert clip.gaps_s == pytest.approx((0.4, 0.2))
    assert (clip.notable_gaps, clip.switches) == (1, 1)
    metrics = {m.key: m.value for m in track_metrics(track_errors("my clip", seen, truth))}
    assert metrics["track.longest_gap_s"] == metrics["track.longest_gap_s:clip=my_clip"] == pytest.approx(0.4)
    assert (metrics["track.gaps_over_0_2_s"], metrics["track.identity_switches"]) == (1.0, 1.0)


def test_a_clip_without_any_track_is_one_long_gap() -> None:
    truth = truth_of(41)
    (clip,) = clip_tracks(track_errors("clip", [result(k) for k in range(41)], truth))
    assert (clip.confirm_s, clip.longest_gap_s, clip.notable_gaps) == (None, pytest.approx(2.0), 1)


def test_the_pads_track_is_the_oldest_near_the_truth_and_the_others_are_false() -> None:
    metrics = judged(lambda place: (tracked(place + 5.0), tracked(place, (SPEED_MPS, 0.0), track_id=2)))
    assert metrics["track.place_rmse_m"].value == 0.0
    assert metrics["track.false_track_share"].value == 0.5
    assert metrics["track.false_track_share"].count == 2 * FRAMES
    unsure = np.eye(4) * 9.0
    metrics = judged(lambda place: (tracked(place + 5.0, covariance=unsure),))
    assert metrics["track.false_track_share"].value == 0.0
    strayed = judged(lambda place: (tracked(place + 5.0),))
    assert strayed["track.place_rmse_m"].value == pytest.approx(5.0 * math.sqrt(2.0))
    assert strayed["track.false_track_share"].value == 1.0


def test_a_run_of_another_length_than_the_truth() -> None:
    truth = truth_of(60)
    longer = [result(k, tracks=(tracked((SPEED_MPS * k / FPS, 0.0), (SPEED_MPS, 0.0)),)) for k in range(90)]
    errors = track_errors("clip", longer, truth)
    assert len(errors) == 60
    assert len(track_errors("clip", longer[:30], truth)) == 30
    assert track_metrics(track_errors("clip", [], truth))[0].said == "undefined, 0 of 0"
    rows = [track_error_row("m", error) for error in errors]
    assert all(row is not None and len(row) == len(TRACK_ERROR_COLUMNS) for row in rows)
    assert track_error_row("m", track_errors("clip", [result(0)], truth)[0]) is None


def predicted(of: Callable[[Array], tuple[Track, ...]]) -> dict[str, Metric]:
    truth = truth_of(FRAMES)
    errors = prediction_errors("clip", results(truth, of), truth)
    assert all(len(prediction_error_row("m", error)) == len(PREDICTION_ERROR_COLUMNS) for error in errors)
    return {metric.key: metric for metric in prediction_metrics(errors, (0.5, 1.0))}


def test_predictions_are_compared_with_holding_the_last_place() -> None:
    late = 0.2 * SPEED_MPS
    metrics = predicted(lambda place: (tracked(place, (SPEED_MPS - 0.4, 0.0), horizons_s=(0.5,)),))
    assert metrics["track.prediction_0.5_s_rmse_m"].value == pytest.approx(0.5 * late)
    assert metrics["track.held_0.5_s_rmse_m"].value == pytest.approx(0.5 * SPEED_MPS)
    assert metrics["track.gain_0.5_s_percent"].value == pytest.approx(80.0)
    assert metrics["track.prediction_0.5_s_nees"].value == pytest.approx((0.5 * late) ** 2 / 0.01 / 2)
    # judged from 1 s on, and only as far as the truth goes
    assert metrics["track.prediction_0.5_s_rmse_m"].count == FRAMES - FPS - FPS // 2
    assert metrics["track.prediction_1_s_rmse_m"].said == "undefined, 0 of 0"
    assert "track.gain_0.5_s_percent:stage=near" in metrics


def test_a_prediction_of_a_standing_platform_gains_nothing() -> None:
    truth = truth_of(60, speed_mps=0.0)
    still = results(truth, lambda place: (tracked(place),))
    metrics = {m.key: m for m in prediction_metrics(prediction_errors("clip", still, truth), (0.5,))}
    assert metrics["track.prediction_0.5_s_rmse_m"].value == 0.0
    assert metrics["track.gain_0.5_s_percent"].value is None
