"""A pad seen by the camera becomes a place in the body's or the world's plane, its noise with it."""

from __future__ import annotations

import numpy as np

from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.tracking.reference import EgoNoise, to_reference
from landtool.types import PadPose


def seen(camera_T_pad: Pose, covariance: np.ndarray | None = None) -> PadPose:
    full = np.diag([1e-4, 4e-4, 9e-4, 0.1, 0.1, 0.1]) if covariance is None else covariance
    return PadPose(camera_T_pad, full, "tag", 0.1, 0.2)


def test_straight_down_and_without_the_drone_s_pose() -> None:
    # 1 m to the right and 2 m down in the image: 1 m to the drone's right (-y), 2 m behind it (-x)
    measured = to_reference(seen(Pose(np.eye(3), np.array([1.0, 2.0, 5.0]))), STRAIGHT_DOWN)
    np.testing.assert_allclose(measured.xy_m, [-2.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(measured.covariance, np.diag([4e-4, 1e-4]), atol=1e-15)


def test_the_mount_s_place_counts() -> None:
    body_T_camera = Pose(STRAIGHT_DOWN.rotation, np.array([0.3, -0.1, 0.0]))
    measured = to_reference(seen(Pose(np.eye(3), np.array([0.0, 0.0, 5.0]))), body_T_camera)
    np.testing.assert_allclose(measured.xy_m, [0.3, -0.1], atol=1e-12)


def test_a_pad_that_stands_still_stays_in_the_world_while_the_drone_moves() -> None:
    rng = np.random.default_rng(7)
    world_T_pad = Pose.from_rotvec([3.0, -2.0, 0.4], [0.0, 0.0, 0.7])
    body_T_camera = Pose(STRAIGHT_DOWN.rotation @ rotation_from_rotvec([0.2, 0.1, 0.0]), np.array([0.1, 0.0, -0.1]))
    for _ in range(20):
        world_T_body = Pose.from_rotvec([*rng.normal(size=2), 6.0], rng.normal(size=3) * 0.4)
        camera_T_pad = (world_T_body @ body_T_camera).inverse() @ world_T_pad
        measured = to_reference(seen(camera_T_pad), body_T_camera, world_T_body)
        np.testing.assert_allclose(measured.xy_m, [3.0, -2.0], atol=1e-12)


def test_the_covariance_is_that_of_the_moved_points() -> None:
    rng = np.random.default_rng(8)
    a = rng.normal(size=(6, 6)) * 0.02
    covariance = a @ a.T
    camera_T_pad = Pose.from_rotvec([0.5, 0.2, 4.0], [2.9, 0.3, 0.1])
    world_T_body = Pose.from_rotvec([1.0, 2.0, 6.0], [0.3, -0.2, 1.0])
    measured = to_reference(seen(camera_T_pad, covariance), STRAIGHT_DOWN, world_T_body)
    moves = rng.multivariate_normal(np.zeros(6), covariance, 20_000)
    # the perturbation is t + dt in the camera frame; the turn dw leaves the pad's centre where it is
    places = (world_T_body @ STRAIGHT_DOWN).apply(camera_T_pad.translation + moves[:, :3])[:, :2]
    sampled = np.cov(places.T)
    np.testing.assert_allclose(measured.covariance, sampled, atol=0.03 * np.trace(sampled))
    np.testing.assert_allclose(measured.xy_m, places.mean(axis=0), atol=5e-3)


def test_what_the_drones_own_pose_is_off_by_is_in_the_covariance() -> None:
    rng = np.random.default_rng(9)
    camera_T_pad = Pose.from_rotvec([1.5, -0.8, 5.0], [3.0, 0.2, 0.1])
    world_T_body = Pose.from_rotvec([1.0, 2.0, 6.0], [0.1, -0.2, 1.0])
    noise = EgoNoise(position_m=0.02, attitude_rad=0.01)
    exact = seen(camera_T_pad, np.zeros((6, 6)) + 1e-12 * np.eye(6))
    measured = to_reference(exact, STRAIGHT_DOWN, world_T_body, noise)
    places = []
    for _ in range(20_000):
        off = world_T_body.perturbed(np.concatenate([rng.normal(0.0, 0.02, 3), rng.normal(0.0, 0.01, 3)]))
        places.append((off @ STRAIGHT_DOWN).apply(camera_T_pad.translation)[:2])
    sampled = np.cov(np.array(places).T)
    np.testing.assert_allclose(measured.covariance, sampled, atol=0.03 * np.trace(sampled))
    in_body = to_reference(exact, STRAIGHT_DOWN, None, noise)
    assert np.trace(in_body.covariance) < 1e-9
