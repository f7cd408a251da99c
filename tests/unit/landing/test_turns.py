from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.turns import Turn, level, measured

DOWN = STRAIGHT_DOWN.rotation  # of the camera, in the reference frame


def rotated(about: tuple[float, float, float], angle_deg: float) -> Array:
    return rotation_from_rotvec(math.radians(angle_deg) * np.array(about))


def turn(tilt_deg: float = 0.0, yaw_deg: float = 0.0, sigma_deg: float = 1.0) -> Turn:
    rotation = rotated((1.0, 0.0, 0.0), tilt_deg) @ rotated((0.0, 0.0, 1.0), yaw_deg)
    return Turn(rotation, np.eye(3) * math.radians(sigma_deg) ** 2)


def tilt_deg(known: Turn) -> float:
    return math.degrees(math.acos(min(float(known.reference_R_pad[2, 2]), 1.0)))


def test_the_random_walk_adds_variance_with_the_time() -> None:
    known = turn(sigma_deg=0.1)
    once = known.after(0.1, in_world=True)
    twice = known.after(0.05, in_world=True).after(0.05, in_world=True)
    # the heading is drawn back to nothing: its variance grows by Q dt
    grown = math.degrees(math.sqrt(once.covariance[2, 2] - known.covariance[2, 2]))
    assert grown == pytest.approx(30.0 * math.sqrt(0.1), rel=1e-6)
    # two steps are one of both times, up to what is known of level pads
    assert twice.covariance[2, 2] == pytest.approx(once.covariance[2, 2])
    assert twice.covariance[0, 0] == pytest.approx(once.covariance[0, 0], rel=0.01)
    tilt_only = math.degrees(math.sqrt(once.covariance[0, 0] - known.covariance[0, 0]))
    assert tilt_only == pytest.approx(2.5 * math.sqrt(0.1), rel=0.05)


def test_no_time_changes_nothing() -> None:
    known = turn(tilt_deg=6.0)
    now = known.after(0.0, in_world=True)
    assert now.reference_R_pad == pytest.approx(known.reference_R_pad)
    assert now.covariance == pytest.approx(known.covariance)
    assert now.cost == known.cost


def test_seen_from_a_drone_of_unknown_attitude_a_pad_tilts_faster() -> None:
    world, body = (turn(sigma_deg=0.1).after(0.2, in_world=in_world) for in_world in (True, False))
    assert body.covariance[0, 0] > 5.0 * world.covariance[0, 0]
    assert body.covariance[2, 2] == pytest.approx(world.covariance[2, 2])


def test_it_is_drawn_back_to_level_and_keeps_its_heading() -> None:
    known = turn(tilt_deg=8.0, yaw_deg=70.0, sigma_deg=2.0)
    later = known
    for _ in range(90):
        later = later.after(1.0 / 30.0, in_world=True)
    assert tilt_deg(later) < 0.35 * tilt_deg(known)
    axis = later.reference_R_pad[:, 0]
    assert math.degrees(math.atan2(axis[1], axis[0])) == pytest.approx(70.0, abs=2.0)
    # of a level pad nothing is learnt but that
    assert math.sqrt(later.covariance[0, 0]) < math.radians(4.0)


def test_a_tilted_pad_costs_more_than_a_level_one() -> None:
    costs = [turn(tilt_deg=tilt).after(0.5, in_world=True).cost for tilt in (0.0, 2.5, 7.5)]
    # half the squared tilt over the variance, for a third of the time in which it is thought anew
    assert costs == pytest.approx([0.0, 0.5 / 3.0, 0.5 / 3.0 * 9.0], rel=1e-6)
    assert turn(tilt_deg=7.5).after(0.5, in_world=False).cost < costs[2]


def test_a_long_time_counts_the_level_once() -> None:
    assert turn(tilt_deg=2.5).after(100.0, in_world=True).cost == pytest.approx(0.5)


def test_the_surprise_is_half_the_mahalanobis_distance() -> None:
    known = turn(yaw_deg=30.0, sigma_deg=2.0)
    assert known.surprise(known.reference_R_pad) == pytest.approx(0.0)
    other = rotated((0.0, 1.0, 0.0), 6.0) @ known.reference_R_pad
    assert known.surprise(other) == pytest.approx(0.5 * 3.0**2)


def test_what_is_known_is_said_in_the_cameras_frame() -> None:
    known = Turn(np.eye(3), np.diag([1.0, 4.0, 9.0]))
    # the camera's x is minus the reference's y
    assert np.diag(known.known(DOWN)) == pytest.approx([0.25, 1.0, 1.0 / 9.0])
    assert known.known(np.eye(3)) == pytest.approx(np.diag([1.0, 0.25, 1.0 / 9.0]))


def test_a_measured_pose_keeps_its_spread_and_a_little_more() -> None:
    covariance = np.diag([1.0, 1.0, 1.0, 1e-4, 4e-4, 9e-4])
    camera_T_pad = Pose(DOWN.T @ rotated((0.0, 0.0, 1.0), 20.0), np.array([0.0, 0.0, 5.0]))
    seen = measured(camera_T_pad, covariance, DOWN, 2.5)
    assert seen.reference_R_pad == pytest.approx(rotated((0.0, 0.0, 1.0), 20.0))
    assert seen.cost == 2.5
    least = math.radians(0.3) ** 2
    assert np.diag(seen.covariance) == pytest.approx([4e-4 + least, 1e-4 + least, 9e-4 + least])


@pytest.mark.parametrize("in_world", [True, False])
def test_before_a_pad_is_measured_it_is_thought_level_and_of_any_heading(in_world: bool) -> None:
    tilted = rotated((1.0, 0.0, 0.0), 15.0) @ rotated((0.0, 0.0, 1.0), 40.0)
    thought = level(Pose(DOWN.T @ tilted, np.array([0.0, 0.0, 5.0])), DOWN, in_world=in_world)
    assert tilt_deg(thought) == pytest.approx(0.0, abs=1e-4)
    assert float(thought.reference_R_pad[:, 0] @ tilted[:, 0]) > 0.95
    assert math.sqrt(thought.covariance[2, 2]) == pytest.approx(math.pi)
    assert math.degrees(math.sqrt(thought.covariance[0, 0])) == pytest.approx(2.5 if in_world else 8.0)
    # so a level pad of another heading surprises little, a tilted one much
    assert thought.surprise(rotated((0.0, 0.0, 1.0), 130.0)) < 1.0
    assert thought.surprise(rotated((1.0, 0.0, 0.0), 24.0) @ rotated((0.0, 0.0, 1.0), 40.0)) > 4.0
