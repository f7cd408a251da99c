from __future__ import annotations

import numpy as np
import pytest

from landtool.geometry import Pose
from landtool.io.poses import STRAIGHT_DOWN, EgoPoses
from landtool.tracking.ego import EgoTrajectory
from landtool.tracking.platform import PlatformTracker
from landtool.tracking.tracker import TrackerConfig
from landtool.types import PadPose, PoseMethod

SECOND = 1_000_000_000


def below(x_m: float, y_m: float, method: PoseMethod = "tag", yaw_rad: float = 0.0, down_m: float = 3.0) -> PadPose:
    """The pad under a level drone, (x, y) forward and left of it."""
    body_T_pad = Pose.from_rotvec([x_m, y_m, -down_m], [0.0, 0.0, yaw_rad])
    sigma_m = 0.1 if method == "box" else 0.01
    return PadPose(STRAIGHT_DOWN.inverse() @ body_T_pad, np.eye(6) * sigma_m**2, method, 0.0, 0.1)


def ego(t_ns: list[int], x_m: list[float], max_gap_s: float = 0.5) -> EgoTrajectory:
    places = np.array([[x, 0.0, 3.0] for x in x_m])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(x_m), 1))
    return EgoTrajectory(EgoPoses(np.array(t_ns, dtype=np.int64), places, turns), max_gap_s)


def test_without_ego_the_place_is_the_bodys() -> None:
    stepped = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN).step(0, (below(0.5, -0.2),))
    assert stepped.tracks[0].reference == "body"
    assert stepped.tracks[0].state[:2] == pytest.approx([0.5, -0.2])
    assert stepped.said == ""
    assert stepped.taken == (1,)


def test_with_ego_the_drones_motion_is_taken_out() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, ego([0, SECOND], [0.0, 0.4], max_gap_s=2.0))
    tracker.step(0, (below(0.5, 0.0),))
    stepped = tracker.step(SECOND // 2, (below(0.3, 0.0),))
    assert stepped.tracks[0].reference == "world"
    assert stepped.tracks[0].state[:2] == pytest.approx([0.5, 0.0], abs=1e-6)


def test_outside_the_egos_time_nothing_is_measured_and_the_times_are_told_once() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, ego([0, SECOND // 4], [0.0, 0.0]))
    stepped = tracker.step(SECOND, (below(0.0, 0.0),))
    assert stepped.tracks == ()
    assert stepped.taken == (None,)
    assert "own pose is not known at this time: they are from 0.000 to 0.250 s, the frame is at 1.000" in stepped.said
    assert tracker.step(SECOND + 1, (below(0.0, 0.0),)).said == "the drone's own pose is not known at this time"
    assert tracker.camera_T_reference(SECOND) is None
    assert tracker.expected(SECOND) == ()


def test_no_clock_no_track() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, record=True)
    stepped = tracker.step(None, (below(0.0, 0.0),))
    assert (stepped.tracks, stepped.said, stepped.taken) == ((), "no clock, so no track", (None,))
    assert tracker.step(None, ()).said == ""
    assert tracker.expected(None) == ()
    assert tracker.smoothed() == {}


FRAME = SECOND // 30


def test_a_pad_is_expected_where_it_will_be() -> None:
    seconds = 2
    tracker = PlatformTracker(
        TrackerConfig(), STRAIGHT_DOWN, ego(list(range(0, seconds * SECOND + 1, FRAME)), [0.0] * (30 * seconds + 1))
    )
    for k in range(45):  # 1 m/s forward, coming nearer by 0.6 m/s
        tracker.step(k * FRAME, (below(k / 30, 0.2, yaw_rad=0.5, down_m=3.0 - 0.02 * k),))
    (pad,) = tracker.expected(46 * FRAME)
    true = below(46 / 30, 0.2, yaw_rad=0.5, down_m=3.0 - 0.02 * 46).camera_T_pad
    np.testing.assert_allclose(pad.camera_T_pad.translation, true.translation, atol=0.02)
    assert pad.camera_T_pad.angle_to(true) < 1e-6
    assert (pad.track_id, pad.confirmed) == (1, True)
    assert pad.age_s == pytest.approx(2 / 30, abs=1e-6)
    assert 0.0 < pad.sigma_m < 0.1
    # nothing is expected long after, nor where the drone's own pose is not known
    assert tracker.expected(44 * FRAME + 2 * SECOND + FRAME) == ()
    later = PlatformTracker(TrackerConfig(coast_s=0.1), STRAIGHT_DOWN)
    later.step(0, (below(0.0, 0.0),))
    assert len(later.expected(FRAME)) == 1
    assert later.expected(4 * FRAME) == ()


def test_what_is_expected_is_less_sure_the_later_it_is() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN)
    for k in range(30):
        tracker.step(k * FRAME, (below(0.0, 0.0),))
    soon, late = (tracker.expected(t)[0].sigma_m for t in (30 * FRAME, 60 * FRAME))
    assert late > 2.0 * soon


def test_a_box_does_not_turn_the_pad() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN)
    tracker.step(0, (below(0.0, 0.0, "box", 1.0),))
    assert tracker.expected(FRAME)[0].camera_T_pad.angle_to(below(0, 0, yaw_rad=1.0).camera_T_pad) < 1e-6
    for k, (method, yaw_rad) in enumerate((("target", 0.5), ("box", 2.0), ("box", 3.0)), start=1):
        tracker.step(k * FRAME, (below(0.0, 0.0, method, yaw_rad),))  # type: ignore[arg-type]
    assert tracker.expected(4 * FRAME)[0].camera_T_pad.angle_to(below(0, 0, yaw_rad=0.5).camera_T_pad) < 1e-6


def test_a_change_of_method_breaks_no_track() -> None:
    rng = np.random.default_rng(3)
    tracker = PlatformTracker(TrackerConfig(gate_probability=0.99999), STRAIGHT_DOWN)
    for k in range(120):
        method: PoseMethod = "box" if k < 60 or 70 <= k < 75 else "target" if k < 90 else "tag"
        sigma_m = 0.1 if method == "box" else 0.01
        stepped = tracker.step(k * FRAME, (below(rng.normal() * sigma_m, rng.normal() * sigma_m, method),))
        assert stepped.taken == (1,)


def test_two_pads_keep_their_tracks_in_any_order() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN)
    for k in range(40):
        one, two = below(0.0, 0.0), below(0.6, 0.0)
        stepped = tracker.step(k * FRAME, (one, two) if k % 2 == 0 else (two, one))
        assert stepped.taken == ((1, 2) if k % 2 == 0 else (2, 1))
    assert [track.status for track in stepped.tracks] == ["confirmed", "confirmed"]
    assert [pad.track_id for pad in tracker.expected(40 * FRAME)] == [1, 2]
    assert tracker.step(40 * FRAME, (below(0.6, 0.0),)).taken == (2,)


def test_a_delay_of_the_camera_is_made_up_for() -> None:
    delay_s = 0.1
    stamps = list(range(0, 3 * SECOND, FRAME))
    # the drone goes 2 m/s, the platform below it too
    own = ego(stamps, [2.0 * t * 1e-9 for t in stamps])
    off = {}
    for told in (0.0, delay_s):
        tracker = PlatformTracker(TrackerConfig(camera_delay_s=told), STRAIGHT_DOWN, own, record=True)
        for k in range(5, 70):
            stepped = tracker.step(k * FRAME, (below(0.0, 0.0),))
        off[told] = stepped.tracks[0].state[0] - 2.0 * 69 * FRAME * 1e-9
        smoothed = tracker.smoothed()
        assert len(smoothed) == 65
        assert smoothed[64, 1].mean[0] == pytest.approx(stepped.tracks[0].state[0], abs=0.02)
        np.testing.assert_allclose(stepped.tracks[0].predictions[2].xy_m, stepped.tracks[0].predicted_xy_m)
    assert off[delay_s] == pytest.approx(0.0, abs=0.01)
    # the place is looked up at the exposure: a picture of 0.1 s ago shows where the drone was then
    pose = PlatformTracker(TrackerConfig(camera_delay_s=delay_s), STRAIGHT_DOWN, own).world_T_body(SECOND)
    assert pose is not None
    assert pose.translation[0] == pytest.approx(2.0 * 0.9, abs=1e-6)


def test_gaps_and_steps_of_the_clock_make_no_nan() -> None:
    stamps = [*range(0, SECOND, FRAME), *range(2 * SECOND, 3 * SECOND, FRAME)]
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, ego(stamps, [0.0] * len(stamps)), record=True)
    rng = np.random.default_rng(4)
    t_ns, rows = 0, 0
    for _ in range(300):
        t_ns = max(
            0, t_ns + int(rng.choice([0, FRAME, FRAME, -2 * FRAME, 1, -SECOND], p=[0.1, 0.3, 0.3, 0.1, 0.1, 0.1]))
        )
        poses = tuple(below(rng.normal() * 0.01, rng.normal() * 0.01) for _ in range(int(rng.integers(0, 3))))
        stepped = tracker.step(t_ns, poses)
        assert len(stepped.taken) == len(poses)
        for track in stepped.tracks:
            rows += 1
            assert np.isfinite(track.state).all()
            assert np.linalg.eigvalsh(track.covariance)[0] > 0
        assert all(np.isfinite(pad.camera_T_pad.translation).all() for pad in tracker.expected(t_ns))
    assert rows > 50
    smoothed = tracker.smoothed()
    assert smoothed
    assert all(np.isfinite(state.mean).all() and np.isfinite(state.covariance).all() for state in smoothed.values())


def test_one_frame_is_a_run_too() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, record=True)
    (track,) = tracker.step(7, (below(0.1, 0.2),)).tracks
    smoothed = tracker.smoothed()
    np.testing.assert_allclose(smoothed[0, 1].mean, track.state)
    np.testing.assert_allclose(smoothed[0, 1].covariance, track.covariance)


def test_smoothing_needs_a_recording() -> None:
    with pytest.raises(RuntimeError, match="recorded nothing"):
        PlatformTracker(TrackerConfig(), STRAIGHT_DOWN).smoothed()
