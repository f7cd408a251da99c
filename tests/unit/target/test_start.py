"""Poses to begin at, from a box around rendered pads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.target.start import affine_poses, faces_camera, start_poses
from tests.method import edges_of, ring_box
from tests.scenes import CAMERA, PAD, photograph, view

BARREL = Camera(640, 480, 554.0, 554.0, 319.5, 239.5, "plumb_bob", (-0.3, 0.1, 0.0, 0.0, 0.0))
HALF_TURN = Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


def box_of(truth: Pose, rng: np.random.Generator, camera: Camera = CAMERA) -> Array:
    """A network's box of the ring: its edges off by 4 % of its size."""
    edges = edges_of(ring_box(truth, camera=camera))
    return np.asarray(edges + rng.uniform(-0.04, 0.04, 4) * (edges[2:] - edges[:2]).max())


@pytest.mark.parametrize("camera", [CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize(("distance_m", "turn_deg"), [(3.0, 8.0), (8.0, 12.0), (15.0, 25.0)])
def test_one_of_the_starts_is_the_true_pose_up_to_half_a_turn(
    distance_m: float, turn_deg: float, camera: Camera
) -> None:
    rng = np.random.default_rng(round(distance_m))
    for _ in range(6):
        away = rng.uniform(-0.15, 0.15, 2)
        truth = view(distance_m, rng.uniform(10.0, 30.0), *rng.uniform(0.0, 6.28, 2), off=(away[0], away[1]))
        image = photograph(truth, rng, camera=camera)
        starts = start_poses(image, camera, box_of(truth, rng, camera), PAD)
        assert 1 <= len(starts) <= 2
        assert all(faces_camera(start) for start in starts)
        angles = [min(s.angle_to(truth), (s @ HALF_TURN).angle_to(truth)) for s in starts]
        assert math.degrees(min(angles)) < turn_deg
        best = starts[int(np.argmin(angles))]
        off = np.linalg.norm(best.translation - truth.translation) / distance_m
        assert off < 0.05


def test_an_affine_view_has_the_two_poses_of_it() -> None:
    # seen from the axis, so far away that there is no perspective left
    truth = view(400.0, 30.0, 1.0, 0.5)
    camera = Camera(640, 480, 40_000.0, 40_000.0, 319.5, 239.5)
    radius_m = PAD.ring.outer * PAD.diameter_m / 2.0 if PAD.ring else 0.0
    # u is the pad's -y, v its -x
    u, v = truth.rotation[:2, 1], truth.rotation[:2, 0]
    axes = -np.column_stack([u, v]) * radius_m * camera.fx / 400.0
    poses = affine_poses(camera, axes, np.array([319.5, 239.5]), PAD)
    assert len(poses) == 2
    assert min(pose.angle_to(truth) for pose in poses) < math.radians(0.2)
    normals = np.array([pose.rotation[:, 2] for pose in poses])
    # mirror images about the line of sight
    assert normals[0] * [-1.0, -1.0, 1.0] == pytest.approx(normals[1], abs=0.01)


def test_nothing_to_begin_at_gives_no_pose() -> None:
    box = np.array([250.0, 170.0, 390.0, 310.0])
    assert start_poses(np.full((480, 640, 3), 90, np.uint8), CAMERA, box, PAD) == ()
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3), np.uint8)
    assert start_poses(noise, CAMERA, box, PAD) == ()


def test_a_ring_without_the_letter_is_not_begun_at() -> None:
    truth = view(5.0, 10.0, 1.0, 0.5)
    image = photograph(truth, np.random.default_rng(0), pad=PadSpec(letter=None, quiet_zone=None, tags=()))
    assert start_poses(image, CAMERA, edges_of(ring_box(truth)), PAD) == ()


@pytest.mark.parametrize(
    ("pose", "faces"),
    [
        (view(3.0, 20.0, 1.0, 0.5), True),
        (Pose(np.eye(3), np.array([0.0, 0.0, 3.0])), False),
        (Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, -3.0])), False),
    ],
    ids=["above", "from below", "behind"],
)
def test_a_pad_shows_its_upper_side(pose: Pose, faces: bool) -> None:
    assert faces_camera(pose) is faces
