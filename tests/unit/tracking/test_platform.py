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


def ego(t_ns: list[int], x_m: list[float]) -> EgoTrajectory:
    places = np.array([[x, 0.0, 3.0] for x in x_m])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(x_m), 1))
    return EgoTrajectory(EgoPoses(np.array(t_ns, dtype=np.int64), places, turns))


def test_without_ego_the_place_is_the_bodys() -> None:
    tracks, said = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN).step(0, below(0.5, -0.2))
    assert tracks[0].reference == "body"
    assert tracks[0].state[:2] == pytest.approx([0.5, -0.2])
    assert said == ""


def test_with_ego_the_drones_motion_is_taken_out() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, ego([0, SECOND], [0.0, 0.4]))
    tracker.step(0, below(0.5, 0.0))
    tracks, _ = tracker.step(SECOND // 2, below(0.3, 0.0))
    assert tracks[0].reference == "world"
    assert tracks[0].state[:2] == pytest.approx([0.5, 0.0], abs=1e-6)


def test_outside_the_egos_time_nothing_is_measured() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN, ego([0, SECOND // 4], [0.0, 0.0]))
    tracks, said = tracker.step(SECOND, below(0.0, 0.0))
    assert tracks == ()
    assert "own pose is not known" in said
    assert tracker.camera_T_reference(SECOND) is None


def test_no_clock_no_track() -> None:
    tracker = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN)
    assert tracker.step(None, below(0.0, 0.0)) == ((), "no clock, so no track")
    assert tracker.step(None, None) == ((), "")
