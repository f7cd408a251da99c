from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.box import box_edges, box_pose
from landtool.pad import PadSpec
from landtool.types import Detection, PadPose
from tests.method import edges_of, ring_box
from tests.scenes import CAMERA, PAD, view

BARREL = Camera(640, 480, 554.0, 554.0, 319.5, 239.5, "plumb_bob", (-0.3, 0.1, 0.0, 0.0, 0.0))
DOWN = STRAIGHT_DOWN.rotation


def measured(truth: Pose, camera: Camera = CAMERA, last: Pose | None = None) -> PadPose:
    pose = box_pose(camera, PAD, edges_of(ring_box(truth, camera=camera)), DOWN, last=last)
    assert pose is not None
    return pose


def away(pose: PadPose, truth: Pose) -> tuple[float, float]:
    """Shares of the distance along the ray and across it."""
    distance = float(np.linalg.norm(truth.translation))
    off, ray = pose.camera_T_pad.translation - truth.translation, truth.translation / distance
    along = float(off @ ray)
    return abs(along) / distance, float(np.linalg.norm(off - along * ray)) / distance


@pytest.mark.parametrize("camera", [CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize("distance_m", [5.0, 20.0, 40.0])
@pytest.mark.parametrize("off", [(0.0, 0.0), (0.35, -0.2)])
def test_an_exact_box_of_a_level_pad_has_its_place(distance_m: float, off: tuple[float, float], camera: Camera) -> None:
    truth = view(distance_m, 0.0, 0.0, 0.5, off=off)
    along, across = away(measured(truth, camera), truth)
    # far off the axis it depends on the tilt how large a circle is seen, and on the lens
    assert along < (0.02 if off == (0.0, 0.0) else 0.09)
    assert across < 0.005


def test_a_tilt_is_in_the_distances_doubt() -> None:
    for azimuth in np.linspace(0.0, 3.0, 6):
        truth = view(20.0, 12.0, float(azimuth), 0.5, off=(0.2, 0.1))
        pose = measured(truth)
        error = pose.camera_T_pad.translation - truth.translation
        assert float(error @ np.linalg.solve(pose.covariance[:3, :3], error)) / 3.0 < 3.0


def test_a_box_says_the_bearing_far_better_than_the_distance() -> None:
    for distance_m in (3.0, 20.0):
        spread = np.sqrt(np.diag(measured(view(distance_m, 0.0, 0.0, 0.5)).covariance))
        assert spread[0] == pytest.approx(spread[1], rel=1e-3)
        assert spread[0] < 0.25 * spread[2]


def test_a_box_that_is_off_is_off_by_what_it_says() -> None:
    rng, shares = np.random.default_rng(0), []
    for _ in range(200):
        truth = view(rng.uniform(17.0, 35.0), rng.uniform(0.0, 10.0), *rng.uniform(0.0, 6.28, 2))
        edges = edges_of(ring_box(truth))
        off = rng.normal(0.0, 0.04, 4) * (edges[2:] - edges[:2]).max()
        pose = box_pose(CAMERA, PAD, edges + off, DOWN)
        assert pose is not None
        error = pose.camera_T_pad.translation - truth.translation
        shares.append(float(error @ np.linalg.solve(pose.covariance[:3, :3], error)) / 3.0)
    assert 0.1 < np.mean(shares) < 1.5


def test_a_box_cut_by_the_border_knows_little() -> None:
    inside, at_border = view(5.0, 0.0, 0.0, 0.5, off=(0.4, 0.0)), view(5.0, 0.0, 0.0, 0.5, off=(0.55, 0.0))
    edges = edges_of(ring_box(at_border))
    edges[2] = CAMERA.width - 0.5
    cut = box_pose(CAMERA, PAD, edges, DOWN)
    assert cut is not None
    assert cut.covariance[0, 0] > 5.0 * measured(inside).covariance[0, 0]
    assert math.sqrt(cut.covariance[2, 2]) > 0.2 * 5.0


def test_the_pad_is_level_and_keeps_the_heading_it_had() -> None:
    banked = rotation_from_rotvec([0.2, -0.1, 0.0]) @ DOWN
    truth = view(10.0, 0.0, 0.0, 2.0)
    edges = edges_of(ring_box(truth))
    first, known = box_pose(CAMERA, PAD, edges, banked), box_pose(CAMERA, PAD, edges, banked, last=truth)
    assert first is not None
    assert known is not None
    for pose in (first, known):
        rotation = pose.camera_T_pad.rotation
        assert (banked @ rotation)[:, 2] == pytest.approx([0.0, 0.0, 1.0])
        assert rotation @ rotation.T == pytest.approx(np.eye(3))
        assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert float(known.camera_T_pad.rotation[:, 0] @ truth.rotation[:, 0]) > 0.95
    # any heading is as likely, until one was known
    up = banked.T @ np.array([0.0, 0.0, 1.0])
    assert math.sqrt(up @ first.covariance[3:, 3:] @ up) == pytest.approx(math.pi / math.sqrt(3.0))
    assert math.degrees(math.sqrt(up @ known.covariance[3:, 3:] @ up)) == pytest.approx(20.0)
    assert np.linalg.eigvalsh(known.covariance).min() > 0.0


def test_what_has_no_ring_or_no_ray_has_no_pose() -> None:
    box = np.array([300.0, 220.0, 340.0, 260.0])
    assert box_pose(CAMERA, PadSpec(ring=None), box, DOWN) is None
    fisheye = Camera(640, 480, 150.0, 150.0, 319.5, 239.5, "equidistant", (0.0, 0.0, 0.0, 0.0))
    assert box_pose(fisheye, PAD, np.array([0.0, 0.0, 40.0, 40.0]), DOWN) is None


def test_the_edges_of_a_box_in_their_order() -> None:
    assert box_edges(Detection("pad", 0.5, 1.0, 2.0, 30.0, 40.0)) == pytest.approx([1.0, 2.0, 30.0, 40.0])
