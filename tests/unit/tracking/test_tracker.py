"""The life of tracks: begun, confirmed, gated, coasting, ended, replaced."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.geometry import Array
from landtool.tracking.config import BOUNDS, MeasurementModel, MotionName, TrackerConfig
from landtool.tracking.kalman import chi2_quantile
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.tracker import Tracker
from landtool.types import Track

SIGMA_M = 0.02
FRAME_NS = 33_333_333
T0 = 1_700_000_000_123_456_789


def at(x: float, y: float = 0.0, sigma_m: float = SIGMA_M) -> PlanarMeasurement:
    return PlanarMeasurement(np.array([x, y]), sigma_m**2 * np.eye(2))


def tracker(**changes: Any) -> Tracker:
    return Tracker(TrackerConfig(**changes), "world")


def follow(
    followed: Tracker, seen: Iterable[Sequence[PlanarMeasurement]], start_ns: int = T0
) -> list[tuple[Track, ...]]:
    return [followed.step(start_ns + k * FRAME_NS, frame) for k, frame in enumerate(seen)]


def straight(n: int, seed: int = 0, v_mps: float = 1.0) -> list[list[PlanarMeasurement]]:
    noise = np.random.default_rng(seed).normal(size=(n, 2)) * SIGMA_M
    return [[at(v_mps * k * FRAME_NS * 1e-9 + noise[k, 0], noise[k, 1])] for k in range(n)]


def states(rows: list[tuple[Track, ...]]) -> list[list[tuple[int, str]]]:
    return [[(track.track_id, track.status) for track in row] for row in rows]


def test_a_track_is_tentative_then_confirmed() -> None:
    rows = follow(tracker(confirm_hits=3, confirm_window=5), straight(5))
    assert [row[0].status for row in rows] == ["tentative", "tentative", "confirmed", "confirmed", "confirmed"]
    assert all(len(row) == 1 and row[0].track_id == 1 for row in rows)
    assert rows[0][0].nis is None
    assert all(row[0].nis is not None for row in rows[1:])
    assert rows[0][0].reference == "world"


def test_three_of_five_confirm_and_two_of_five_do_not() -> None:
    seen = straight(5)
    rows = follow(tracker(), [seen[0], [], seen[2], [], seen[4]])
    assert states(rows)[-1] == [(1, "confirmed")]
    rows = follow(tracker(), [seen[0], [], [], [], seen[4]])
    assert states(rows) == [[(1, "tentative")]] * 3 + [[], [(2, "tentative")]]


def test_one_measurement_confirms_when_one_is_asked_for() -> None:
    assert states(follow(tracker(confirm_hits=1, confirm_window=1), straight(1))) == [[(1, "confirmed")]]


def test_coasting_then_the_end_then_a_new_number() -> None:
    seen = straight(120)
    seen[30:60] = [[]] * 30  # one second, less than coast_s
    rows = follow(tracker(coast_s=1.5), seen)
    assert {row[0].status for row in rows[30:60]} == {"coasting"}
    assert all(row[0].nis is None for row in rows[30:60])
    assert states(rows)[60] == [(1, "confirmed")]

    seen[30:90] = [[]] * 60  # two seconds
    rows = follow(tracker(coast_s=1.5), seen)
    # the last measurement was in frame 29, so frame 74 is the last within 1.5 s of it
    assert states(rows)[74] == [(1, "coasting")]
    assert states(rows)[75:90] == [[]] * 15
    assert states(rows)[90] == [(2, "tentative")]
    assert states(rows)[-1] == [(2, "confirmed")]


def test_a_coasting_track_goes_on_where_it_was_going_and_knows_less() -> None:
    seen = straight(90)
    seen[60:] = [[]] * 30
    rows = follow(tracker(motion="constant-velocity"), seen)
    last, coasted = rows[59][0], rows[89][0]
    np.testing.assert_allclose(coasted.state[2:], last.state[2:])
    np.testing.assert_allclose(coasted.state[:2], last.state[:2] + last.state[2:] * 30 * FRAME_NS * 1e-9)
    assert coasted.covariance[0, 0] > 4 * last.covariance[0, 0]


def test_a_gap_in_the_recording_ends_a_track_too() -> None:
    followed = tracker(coast_s=2.0)
    follow(followed, straight(10))
    assert states([followed.step(T0 + 5_000_000_000, [at(0.3)])]) == [[(2, "tentative")]]


def test_prediction_is_the_state_carried_on() -> None:
    for horizon_s in (0.0, 0.5, 2.0):
        for (track,) in follow(tracker(horizon_s=horizon_s, motion="constant-velocity"), straight(20)):
            assert track.horizon_s == horizon_s
            np.testing.assert_allclose(track.predicted_xy_m, track.state[:2] + horizon_s * track.state[2:], atol=1e-12)


def test_without_noise_a_straight_line_is_predicted_exactly() -> None:
    seen = [[at(0.7 * k * FRAME_NS * 1e-9, -0.2 * k * FRAME_NS * 1e-9, 1e-6)] for k in range(60)]
    (track,) = follow(tracker(), seen)[-1]
    t = 59 * FRAME_NS * 1e-9 + 0.5
    np.testing.assert_allclose(track.predicted_xy_m, [0.7 * t, -0.2 * t], atol=1e-4)


@pytest.mark.parametrize("measurement", ["position", "paper"])
def test_prediction_half_a_second_ahead_of_a_straight_drive(measurement: MeasurementModel) -> None:
    errors = []
    for seed in range(5):
        rows = follow(tracker(measurement=measurement), straight(240, seed))
        for k in range(60, 240):
            t = k * FRAME_NS * 1e-9 + 0.5
            errors.append(rows[k][0].predicted_xy_m - (t, 0.0))
    rmse = float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))
    assert rmse <= 0.08
    assert abs(np.mean(errors, axis=0)[0]) < 0.02  # no lag


def test_a_platform_that_brakes_is_caught_up_with_within_half_a_second() -> None:
    # 1 m/s, then 1 m/s^2 for a second, then standing: what counts is how long the velocity stays wrong
    t = np.arange(150) * FRAME_NS * 1e-9
    braking = np.clip(t - 2.0, 0.0, 1.0)
    x = np.minimum(t, 2.0) + braking - braking**2 / 2
    noise = np.random.default_rng(9).normal(size=(len(t), 2)) * SIGMA_M
    rows = follow(tracker(), [[at(x[k] + noise[k, 0], noise[k, 1])] for k in range(len(t))])
    assert all(len(row) == 1 for row in rows)
    speeds = np.array([row[0].state[2] for row in rows])
    settled = speeds[np.searchsorted(t, 3.5) :]
    assert np.abs(settled).max() < 0.25


def test_uneven_frames_are_weighed_by_their_times() -> None:
    rng = np.random.default_rng(11)
    followed, t_ns = tracker(), T0
    for k in range(300):
        t = (t_ns - T0) * 1e-9
        (track,) = followed.step(t_ns, [at(2.0 * t + rng.normal() * SIGMA_M, rng.normal() * SIGMA_M)])
        t_ns += int(rng.choice([5_000_000, 33_333_333, 100_000_000]))
        if k > 100:
            assert track.state[2] == pytest.approx(2.0, abs=0.5)
            assert track.state[3] == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize("gap_ns", [1, 1_000, 1_000_000, FRAME_NS])
def test_the_second_measurement_does_not_throw_the_velocity(gap_ns: int) -> None:
    config = TrackerConfig()
    followed = Tracker(config, "world")
    followed.step(T0, [at(0.0)])
    (track,) = followed.step(T0 + gap_ns, [at(3 * SIGMA_M, -3 * SIGMA_M)])
    # the difference alone would say 0.06 m / dt: 60 km/s in a microsecond
    assert np.abs(track.state[2:]).max() < config.init_velocity_sigma_mps
    if gap_ns <= 1_000:
        assert np.abs(track.state[2:]).max() < 0.2


@pytest.mark.parametrize("measurement", ["position", "paper"])
def test_an_outlier_of_5_m_does_not_move_the_track(measurement: MeasurementModel) -> None:
    seen = straight(90)
    seen[60] = [at(seen[60][0].xy_m[0] + 5.0, 0.0)]
    rows = follow(tracker(measurement=measurement, motion="constant-velocity"), seen)
    assert states(rows)[60] == [(1, "coasting"), (2, "tentative")]
    assert rows[60][0].nis is None
    np.testing.assert_allclose(rows[60][0].state[2:], rows[59][0].state[2:])
    assert states(rows)[61][0] == (1, "confirmed")
    assert states(rows)[-1] == [(1, "confirmed")]


def test_the_gate_is_where_the_chi_square_says() -> None:
    for factor, hit in ((0.99, True), (1.01, False)):
        followed = tracker(motion="constant-velocity", accel_sigma_mps2=2.0, same_place_m=0.0)
        (track,) = follow(followed, straight(60))[-1]
        dt = FRAME_NS * 1e-9
        A = np.eye(4) + dt * np.eye(4, k=2)
        G = np.vstack([dt**2 / 2 * np.eye(2), dt * np.eye(2)])
        S = (A @ track.covariance @ A.T + 2.0**2 * G @ G.T)[:2, :2] + SIGMA_M**2 * np.eye(2)
        away = factor * np.sqrt(chi2_quantile(0.999, 2) * S[0, 0])
        x, y = (A @ track.state)[:2]
        row = followed.step(T0 + 60 * FRAME_NS, [at(x + away, y)])
        assert (row[0].status == "confirmed") == hit


def test_a_hard_brake_keeps_its_track() -> None:
    """Beyond the gate, but where no other pad can be: the track follows, and doubts what it knew."""
    for same_place_m, kept in ((0.5, True), (0.0, False)):
        followed = tracker(same_place_m=same_place_m)
        (before,) = follow(followed, straight(60))[-1]
        x, y = before.state[:2]
        stopped = [followed.step(T0 + (60 + i) * FRAME_NS, [at(x - 0.25, y)]) for i in range(30)]
        assert ({row[0].track_id for row in stopped} == {before.track_id} and len(stopped[0]) == 1) == kept
        if kept:
            assert (stopped[0][0].nis or 0.0) > chi2_quantile(0.999, 2)
            assert abs(stopped[-1][0].state[2]) < 0.2


def test_a_track_the_platform_left_gives_way() -> None:
    seen = straight(90)
    followed = tracker(replace_hits=5, coast_s=10.0)
    follow(followed, seen[:60])
    notes, rows = [], []
    for k in range(60, 90):  # the same drive, 3 m to the side
        x, y = seen[k][0].xy_m
        rows.append(followed.step(T0 + k * FRAME_NS, [at(x, y + 3.0)]))
        notes.append(followed.note)
    assert states(rows)[3] == [(1, "coasting"), (2, "confirmed")]
    assert states(rows)[4:] == [[(2, "confirmed")]] * 26
    assert [note for note in notes if note] == ["track 1 gives way to track 2"]
    np.testing.assert_allclose(rows[-1][0].state[1], 3.0, atol=0.1)


def test_two_platforms_keep_their_tracks_through_order_and_cover() -> None:
    left, right = straight(90, 1), straight(90, 2)
    seen = [[left[k][0], at(right[k][0].xy_m[0], right[k][0].xy_m[1] + 1.0)] for k in range(90)]
    seen = [frame[::-1] if k % 2 else frame for k, frame in enumerate(seen)]
    for k in range(40, 60):  # the left one is covered
        seen[k] = [m for m in seen[k] if m.xy_m[1] > 0.5]
    rows = follow(tracker(), seen)
    for k, row in enumerate(rows):
        assert [track.track_id for track in row] == [1, 2]
        assert row[0].state[1] == pytest.approx(0.0, abs=0.2)
        assert row[1].state[1] == pytest.approx(1.0, abs=0.2)
        assert (row[0].status == "coasting") == (40 <= k < 60)


def test_a_proven_track_chooses_before_a_young_one() -> None:
    followed = tracker()
    follow(followed, straight(60))
    t = 60 * FRAME_NS * 1e-9
    # a false measurement begins a track that reaches wide; the next true one, 3 sigma off, is nearer to that one
    followed.step(T0 + 60 * FRAME_NS, [at(t), at(t, 0.3)])
    row = followed.step(T0 + 61 * FRAME_NS, [at(t + FRAME_NS * 1e-9, 0.06)])
    assert states([row]) == [[(1, "confirmed"), (2, "tentative")]]
    assert row[1].nis is None


def test_each_measurement_is_used_once() -> None:
    followed = tracker()
    rows = follow(followed, [[at(0.0), at(0.0)]] * 3)
    assert states(rows)[-1] == [(1, "confirmed"), (2, "confirmed")]
    row = followed.step(T0 + 3 * FRAME_NS, [at(0.0)])
    assert sorted(status for _, status in states([row])[0]) == ["coasting", "confirmed"]


@pytest.mark.parametrize("measurement", ["position", "paper"])
def test_a_repeated_stamp_is_one_more_look_at_the_same_moment(measurement: MeasurementModel) -> None:
    followed = tracker(measurement=measurement, motion="constant-velocity")
    (before,) = follow(followed, straight(60))[-1]
    (again,) = followed.step(T0 + 59 * FRAME_NS, [])
    np.testing.assert_array_equal(again.state, before.state)
    np.testing.assert_array_equal(again.covariance, before.covariance)
    (again,) = followed.step(T0 + 59 * FRAME_NS, [at(*before.state[:2])])
    assert again.status == "confirmed"
    assert again.covariance[0, 0] < before.covariance[0, 0]
    np.testing.assert_allclose(again.state, before.state, atol=1e-9)
    assert followed.note == ""


@pytest.mark.parametrize("motion", ["adaptive", "constant-velocity"])
def test_a_late_frame_is_put_in_at_its_right_place(motion: MotionName) -> None:
    seen = straight(60)
    seen[30].append(at(50.0, 50.0))  # begins a track that a late frame must not number anew
    in_order, late = tracker(motion=motion), tracker(motion=motion)
    rows = follow(in_order, seen)
    order = [*range(50), 51, 52, 50, 54, 53, *range(55, 60)]
    late_rows = {k: late.step(T0 + k * FRAME_NS, seen[k]) for k in order}
    for k in (50, 53, 55, 59):
        assert states([late_rows[k]]) == states([rows[k]])
        np.testing.assert_allclose(late_rows[k][0].state, rows[k][0].state, rtol=1e-12)
        np.testing.assert_allclose(late_rows[k][0].covariance, rows[k][0].covariance, rtol=1e-12)
    assert late.note == ""


def test_a_late_frame_renames_no_track() -> None:
    followed = tracker()
    follow(followed, straight(10))
    assert states([followed.step(T0 + 11 * FRAME_NS, [at(0.36), at(9.0)])]) == [[(1, "confirmed"), (2, "tentative")]]
    row = followed.step(T0 + 10 * FRAME_NS, [at(0.33), at(20.0)])  # begins a track before that
    assert states([row]) == [[(1, "confirmed"), (3, "tentative")]]
    assert followed.taken == (1, 3)
    row = followed.step(T0 + 12 * FRAME_NS, [])
    assert sorted(number for number, _ in states([row])[0]) == [1, 2, 3]


def test_a_stamp_far_back_ends_all_tracks() -> None:
    followed = tracker(backward_s=0.1)
    follow(followed, straight(60))
    row = followed.step(T0 - 1_000_000_000, [at(0.0)])
    assert states([row]) == [[(2, "tentative")]]
    assert "time went back by 2.967 s" in followed.note
    followed.step(T0 - 900_000_000, [at(0.0)])
    assert followed.note == ""


def test_a_clock_that_stands_still_keeps_little() -> None:
    followed = tracker()
    for _ in range(600):
        followed.step(T0, [at(0.0)])
    assert len(followed._past) <= 256


def test_stamps_since_1970_lose_nothing() -> None:
    # a float of such seconds or nanoseconds is wrong by up to 0.2 microseconds: 4 % of this step
    a, b = tracker(), tracker()
    for k in range(20):
        (at_zero,) = a.step(k * 5_000, [at(1e-3 * k)])
        (since_1970,) = b.step(T0 + k * 5_000, [at(1e-3 * k)])
        np.testing.assert_array_equal(at_zero.state, since_1970.state)


def test_the_paper_s_model_stays_finite_through_everything() -> None:
    rng = np.random.default_rng(13)
    followed = tracker(measurement="paper", coast_s=5.0)
    t_ns = T0
    for _ in range(500):
        t_ns += int(rng.choice([0, 1_000, FRAME_NS, 2_000_000_000]))
        seen = [at(rng.normal() * 0.1, rng.normal() * 0.1)] if rng.random() < 0.7 else []
        for track in followed.step(t_ns, seen):
            assert np.isfinite(track.state).all()
            assert np.isfinite(track.covariance).all()
            assert np.linalg.eigvalsh(track.covariance)[0] > 0


def test_two_trackers_count_for_themselves_and_the_same_input_gives_the_same_output() -> None:
    a, b = tracker(), tracker()
    for row_a, row_b in zip(follow(a, straight(30)), follow(b, straight(30)), strict=True):
        assert row_a[0].track_id == row_b[0].track_id == 1
        np.testing.assert_array_equal(row_a[0].state, row_b[0].state)


def test_numbers_are_not_used_again_after_a_reset() -> None:
    followed = tracker()
    follow(followed, straight(5))
    followed.reset()
    assert states(follow(followed, straight(1), start_ns=0)) == [[(2, "tentative")]]


def test_no_measurements_no_tracks() -> None:
    assert follow(tracker(), [[]] * 5) == [()] * 5


def test_a_sure_measurement_counts_more_than_an_unsure_one() -> None:
    def after(sigma_m: float) -> Array:
        followed = tracker()
        follow(followed, straight(60))
        return followed.step(T0 + 60 * FRAME_NS, [at(2.0, 0.02, sigma_m)])[0].state

    assert abs(after(0.01)[1] - 0.02) < abs(after(0.1)[1] - 0.02)


@pytest.mark.parametrize("name", BOUNDS)
def test_numbers_out_of_bounds_are_refused(name: str) -> None:
    low, high = BOUNDS[name]
    for value in (low - 1, high + 1, float("nan")):
        with pytest.raises(UsageError, match=name):
            TrackerConfig(**{name: value})  # type: ignore[arg-type]


def test_settings_that_cannot_work_are_refused() -> None:
    with pytest.raises(UsageError, match="confirm_hits = 6 can never be reached in 5"):
        TrackerConfig(confirm_hits=6)
    with pytest.raises(UsageError, match="unknown measurement 'velocity'"):
        TrackerConfig(measurement="velocity")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="unknown motion 'warp'"):
        TrackerConfig(motion="warp")  # type: ignore[arg-type]
    for horizon_s in (-0.1, 61.0, float("nan")):
        with pytest.raises(UsageError, match="horizons_s"):
            TrackerConfig(horizons_s=(0.5, horizon_s))


@pytest.mark.parametrize(
    ("xy_m", "covariance"),
    [
        ([np.nan, 0.0], np.eye(2)),
        ([0.0, 0.0], np.full((2, 2), np.inf)),
        ([0.0, 0.0], np.zeros((2, 2))),
        ([0.0, 0.0], np.diag([1.0, -1.0])),
    ],
)
def test_measurements_without_sense_are_refused(xy_m: list[float], covariance: Array) -> None:
    with pytest.raises(ValueError, match="position"):
        PlanarMeasurement(np.array(xy_m), covariance)
