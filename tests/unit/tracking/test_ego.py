"""Interpolation of the drone's own poses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp  # type: ignore[import-untyped]

from landtool.errors import UsageError
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import EgoPoses
from landtool.tracking.ego import EgoTrajectory

T0 = 1_700_000_000_000_000_000  # a float holds such a stamp to 256 ns only


def trajectory(t_s: list[float], rotvecs: np.ndarray, max_gap_s: float = 0.5) -> EgoTrajectory:
    stamps = np.array([T0 + round(t * 1e9) for t in t_s])
    quaternions = np.array([Pose.from_rotvec(np.zeros(3), r).quaternion_wxyz for r in rotvecs])
    places = np.column_stack([t_s, np.square(t_s), np.ones(len(t_s))])
    return EgoTrajectory(EgoPoses(stamps, places, quaternions), max_gap_s)


def test_between_poses_it_is_lerp_and_slerp() -> None:
    rng = np.random.default_rng(3)
    t_s = [0.0, 0.1, 0.25, 0.4]
    rotvecs = rng.normal(size=(4, 3))
    ego = trajectory(t_s, rotvecs)
    slerp = Slerp(t_s, Rotation.from_rotvec(rotvecs))
    for t in (0.0, 0.03, 0.1, 0.2, 0.2500001, 0.4):
        pose = ego.at(T0 + round(t * 1e9))
        assert pose is not None
        np.testing.assert_allclose(pose.rotation, slerp(t).as_matrix(), atol=1e-9)
        np.testing.assert_allclose(pose.translation, [t, np.interp(t, t_s, np.square(t_s)), 1.0], atol=1e-9)


def test_a_quaternion_of_the_other_sign_takes_no_detour() -> None:
    quaternions = np.array([[1.0, 0, 0, 0], -Pose.from_rotvec(np.zeros(3), [0, 0, 0.2]).quaternion_wxyz])
    ego = EgoTrajectory(EgoPoses(np.array([0, 100]), np.zeros((2, 3)), quaternions))
    middle = ego.at(50)
    assert middle is not None
    np.testing.assert_allclose(middle.rotation, rotation_from_rotvec([0, 0, 0.1]), atol=1e-12)


def test_nothing_is_made_up_outside_or_in_a_gap() -> None:
    ego = trajectory([0.0, 0.5, 1.1, 1.2], np.zeros((4, 3)))
    assert ego.at(T0 - 1) is None
    assert ego.at(T0 + 1_200_000_001) is None
    assert ego.at(T0 + 800_000_000) is None  # 0.6 s apart
    assert ego.at(T0 + 500_000_001) is None
    assert ego.at(T0 + 250_000_000) is not None  # exactly 0.5 s apart
    for t_ns in (0, 500_000_000, 1_100_000_000, 1_200_000_000):  # what was measured is known
        assert ego.at(T0 + t_ns) is not None


def test_one_pose_is_known_at_its_own_time_only() -> None:
    ego = trajectory([0.0], np.zeros((1, 3)))
    assert ego.at(T0) is not None
    assert ego.at(T0 + 1) is None


@pytest.mark.parametrize("max_gap_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_gap_that_is_no_time_is_refused(max_gap_s: float) -> None:
    with pytest.raises(UsageError, match="max_gap_s"):
        trajectory([0.0], np.zeros((1, 3)), max_gap_s)


def test_between_two_poses_their_noise_is_less() -> None:
    ego = trajectory([0.0, 0.1], np.zeros((2, 3)))
    shares = [ego.noise_share(T0 + t_ns) for t_ns in (0, 50_000_000, 25_000_000, 100_000_000, 200_000_000)]
    assert shares == pytest.approx([1.0, 0.5, 0.75**2 + 0.25**2, 1.0, 1.0])
    assert ego.span_ns == (T0, T0 + 100_000_000)
