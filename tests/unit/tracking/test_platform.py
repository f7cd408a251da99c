from __future__ import annotations

import numpy as np
import pytest

from landtool.geometry import Pose
from landtool.io.poses import STRAIGHT_DOWN, EgoPoses
from landtool.tracking.ego import EgoTrajectory
from landtool.tracking.platform import PlatformTracker
from landtool.tracking.tracker import TrackerConfig
from landtool.types import PadPose

SECOND = 1_000_000_000


def below(x_m: float, y_m: float) -> PadPose:
    """The pad 3 m under a level drone, (x, y) forward and left of it."""
    body_T_pad = Pose(np.eye(3), np.array([x_m, y_m, -3.0]))
    return PadPose(STRAIGHT_DOWN.inverse() @ body_T_pad, np.eye(6) * 1e-4, "tag", 0.0, 0.1)


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
