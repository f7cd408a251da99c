from __future__ import annotations

import numpy as np
import pytest

from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.tags.choose import SolutionChooser
from landtool.tags.pose import Solution

FRAME_NS = 33_000_000


def solution(tilt_deg: float, chi2: float, sigma_deg: float = 1.0) -> Solution:
    """The pad 4 m below a level drone, tilted about the body's x axis."""
    turn = rotation_from_rotvec([np.radians(tilt_deg), 0.0, 0.0])
    pose = STRAIGHT_DOWN.inverse() @ Pose(turn, np.array([0.0, 0.0, -4.0]))
    return Solution(pose, np.eye(6) * np.radians(sigma_deg) ** 2, chi2, 0.1)


def test_without_a_past_the_level_pad_wins_over_a_slightly_better_fit() -> None:
    chooser = SolutionChooser(STRAIGHT_DOWN)
    assert chooser.choose([solution(50.0, 1.0), solution(2.0, 1.5)], 0, None) == 1


def test_a_clearly_better_fit_wins_over_the_prior() -> None:
    chooser = SolutionChooser(STRAIGHT_DOWN)
    assert chooser.choose([solution(30.0, 1.0), solution(-10.0, 60.0)], 0, None) == 0


def test_the_past_is_kept_when_the_fits_are_alike() -> None:
    chooser = SolutionChooser(STRAIGHT_DOWN)
    for frame in range(10):
        assert chooser.choose([solution(12.0, 1.0), solution(-12.0, 9.0)], frame * FRAME_NS, None) == 0
    assert chooser.choose([solution(-12.0, 1.0), solution(12.0, 3.0)], 10 * FRAME_NS, None) == 1


def test_evidence_adds_up_to_a_change_of_mind() -> None:
    chooser = SolutionChooser(STRAIGHT_DOWN)
    chooser.choose([solution(12.0, 1.0), solution(-12.0, 4.0)], 0, None)
    chosen = [
        chooser.choose([solution(-12.0, 1.0), solution(12.0, 9.0)], frame * FRAME_NS, None) for frame in range(1, 12)
    ]
    assert chosen[-1] == 0


def test_a_long_gap_or_reset_forgets() -> None:
    chooser = SolutionChooser(STRAIGHT_DOWN)
    for frame in range(10):
        chooser.choose([solution(12.0, 1.0), solution(-12.0, 9.0)], frame * FRAME_NS, None)
    assert chooser.choose([solution(-12.0, 1.0), solution(12.0, 1.5)], 60_000_000_000, None) == 0


def test_the_drones_attitude_tells_a_tipped_pad_from_a_banking_drone() -> None:
    world_T_body = Pose(rotation_from_rotvec([np.radians(20.0), 0.0, 0.0]), np.array([0.0, 0.0, 4.0]))
    banked, mirror = solution(-20.0, 2.0), solution(20.0, 1.0)
    assert SolutionChooser(STRAIGHT_DOWN).choose([mirror, banked], 0, world_T_body) == 1


@pytest.mark.parametrize("t_ns", [None, 0])
def test_one_solution_is_taken(t_ns: int | None) -> None:
    assert SolutionChooser(STRAIGHT_DOWN).choose([solution(40.0, 1.0)], t_ns, None) == 0
