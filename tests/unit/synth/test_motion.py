from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.synth.motion import Approach
from tests.unit.synth.brute import PINHOLE

STRAIGHT = Approach(duration_s=10.0, height_start_m=8.0, height_end_m=1.0, speed_mps=3.0)
TURNING = replace(STRAIGHT, turn_rate_radps=0.2, lateral_start_m=(0.5, -0.3), sway_rad=0.1, yaw_rad=0.4)


def test_a_straight_drive_goes_along_x() -> None:
    np.testing.assert_allclose(STRAIGHT.world_T_pad(2.0).translation, [6.0, 0.0, 0.3], atol=1e-12)
    np.testing.assert_allclose(STRAIGHT.world_T_pad(2.0).rotation, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("approach", [STRAIGHT, TURNING], ids=["straight", "turning"])
@pytest.mark.parametrize("t_s", [0.0, 3.3, 12.0])
def test_the_pad_drives_where_it_points(approach: Approach, t_s: float) -> None:
    dt = 1e-5
    after, before = approach.world_T_pad(t_s + dt).translation, approach.world_T_pad(t_s - dt).translation
    velocity = (after - before) / (2.0 * dt)
    np.testing.assert_allclose(velocity, approach.pad_velocity_mps(t_s), atol=1e-6)
    np.testing.assert_allclose(velocity, 3.0 * approach.world_T_pad(t_s).rotation[:, 0], atol=1e-6)


def test_a_full_turn_ends_where_it_began() -> None:
    circle = replace(TURNING, turn_rate_radps=0.5)
    period = 2.0 * np.pi / 0.5
    np.testing.assert_allclose(circle.world_T_pad(period).translation, [0.0, 0.0, 0.3], atol=1e-9)
    # half way round it is a diameter to the left
    np.testing.assert_allclose(circle.world_T_pad(period / 2.0).translation, [0.0, 12.0, 0.3], atol=1e-9)


def test_the_drone_sinks_steadily_and_then_holds() -> None:
    heights = [STRAIGHT.camera_T_pad(t).translation[2] for t in (0.0, 5.0, 10.0, 30.0)]
    np.testing.assert_allclose(heights, [8.0, 4.5, 1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(STRAIGHT.camera_T_pad(4.0).translation[:2], 0.0, atol=1e-12)


def test_the_lateral_error_decays_in_the_platforms_heading() -> None:
    for t_s in (0.0, 3.0, 6.0):
        world_T_body, world_T_pad = TURNING.pose_at(t_s)
        place = (world_T_pad.inverse() @ world_T_body).translation
        np.testing.assert_allclose(place[:2], np.array([0.5, -0.3]) * np.exp(-t_s / 3.0), atol=1e-12)


def test_a_drone_ahead_and_left_sees_the_upright_pad_below_and_right() -> None:
    # the sentence in pad.md about the frames
    camera_T_pad = replace(STRAIGHT, lateral_start_m=(0.4, 0.3)).camera_T_pad(0.0)
    (x, y), (x_top, y_top) = PINHOLE.project(camera_T_pad.apply([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    assert x > PINHOLE.cx
    assert y > PINHOLE.cy
    assert x_top == pytest.approx(x)
    assert y_top < y
    assert (camera_T_pad.inverse().translation[:2] > 0.0).all()


def test_sway_is_roll_and_pitch_of_the_given_size_about_a_level_heading() -> None:
    swaying = replace(STRAIGHT, sway_rad=0.1, yaw_rad=0.7)
    up = np.array([swaying.pose_at(t)[0].rotation[:, 2] for t in np.linspace(0.0, 26.0, 2000)])
    tilt = np.arccos(up[:, 2])
    assert 0.1 < tilt.max() < 0.1 * 2**0.5 + 1e-3
    assert tilt.min() < 0.02
    forward = swaying.pose_at(0.0)[0].rotation[:, 0]
    assert np.arctan2(forward[1], forward[0]) == pytest.approx(0.7, abs=0.01)


def test_the_ground_is_the_worlds_floor_under_the_camera() -> None:
    ground_T_camera = TURNING.camera_T_ground(2.0).inverse()
    world_T_body, _ = TURNING.pose_at(2.0)
    np.testing.assert_allclose(ground_T_camera.translation, world_T_body.translation, atol=1e-12)
    pad = TURNING.camera_T_ground(2.0).inverse() @ TURNING.camera_T_pad(2.0)
    np.testing.assert_allclose(pad.translation, TURNING.world_T_pad(2.0).translation, atol=1e-12)


@pytest.mark.parametrize("name", ["duration_s", "height_start_m", "height_end_m", "lateral_decay_s", "sway_period_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_impossible_motions_are_refused(name: str, value: float) -> None:
    with pytest.raises(UsageError, match=name):
        replace(STRAIGHT, **{name: value})  # type: ignore[arg-type]
