"""The whole print registered to rendered views with exact truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import Letter, PadSpec
from landtool.target.register import Registered, register_target
from landtool.types import Image
from tests.scenes import CAMERA, PAD, photograph, view

BARREL = Camera(640, 480, 554.0, 554.0, 319.5, 239.5, "plumb_bob", (-0.3, 0.1, 0.001, -0.001, 0.0))
# By the distance: shares of it along the ray and across it, and degrees of the normal, medians over VIEWS
BOUNDS = {
    3.0: (0.002, 0.0002, 0.25),
    8.0: (0.0015, 0.0001, 0.3),
    15.0: (0.002, 0.0001, 0.4),
    20.0: (0.002, 0.0001, 0.5),
}
VIEWS = 5


def turned_by(pose: Pose, tilt_deg: float, about: Sequence[float]) -> Pose:
    """The pose with its pad turned about an axis of the camera frame through its middle."""
    turn = math.radians(tilt_deg) * np.asarray(about, dtype=np.float64)
    return pose.perturbed(np.concatenate([np.zeros(3), turn]))


def start_near(truth: Pose, rng: np.random.Generator) -> Pose:
    """A start as a tracker has it: off by some hundredths of the pad's size, and turned by some degrees."""
    off = rng.uniform(-0.04, 0.04, 3) * [1.0, 1.0, 0.5 * truth.translation[2]]
    return truth.perturbed(np.concatenate([off, rng.uniform(-0.05, 0.05, 3)]))


def errors(found: Pose, truth: Pose) -> tuple[float, float, float]:
    """Shares of the distance along the ray and across it, and degrees between the normals."""
    distance = float(np.linalg.norm(truth.translation))
    ray, off = truth.translation / distance, found.translation - truth.translation
    along = float(off @ ray)
    cosine = min(float(found.rotation[:, 2] @ truth.rotation[:, 2]), 1.0)
    across = float(np.linalg.norm(off - along * ray))
    return abs(along) / distance, across / distance, math.degrees(math.acos(cosine))


@lru_cache(maxsize=4)
def seen_at(distance_m: float, tilt_deg: float = 8.0) -> tuple[Image, Pose]:
    truth = view(distance_m, tilt_deg, 1.0, 0.5)
    return photograph(truth, np.random.default_rng(3)), truth


def registered(image: Image, start: Pose, **settings: object) -> Registered:
    found = register_target(image, CAMERA, start, PAD, **settings)  # type: ignore[arg-type]
    assert found is not None
    return found


@pytest.mark.parametrize("camera", [CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize("distance_m", BOUNDS)
def test_a_start_that_is_off_leads_to_the_true_pose(distance_m: float, camera: Camera) -> None:
    rng = np.random.default_rng(round(distance_m))
    off = []
    for _ in range(VIEWS):
        azimuth, yaw, away = rng.uniform(0.0, 6.28), rng.uniform(0.0, 6.28), rng.uniform(0.1, 0.2, 2)
        truth = view(distance_m, rng.uniform(10.0, 25.0), azimuth, yaw, off=(away[0], away[1]))
        image = photograph(truth, rng, camera=camera)
        found = register_target(image, camera, start_near(truth, rng), PAD)
        assert found is not None
        assert found.at_rest
        assert found.likeness > 0.9
        off.append(errors(found.camera_T_pad, truth))
    assert (np.median(off, axis=0) < BOUNDS[distance_m]).all(), np.median(off, axis=0)


def test_the_covariance_is_of_the_size_of_the_errors() -> None:
    rng, shares = np.random.default_rng(7), []
    for _ in range(10):
        truth = view(8.0, rng.uniform(5.0, 25.0), rng.uniform(0.0, 6.28), rng.uniform(0.0, 6.28))
        found = registered(photograph(truth, rng), start_near(truth, rng))
        turn = Pose(found.camera_T_pad.rotation @ truth.rotation.T, np.zeros(3)).rotvec
        error = np.concatenate([found.camera_T_pad.translation - truth.translation, turn])
        shares.append(float(error @ np.linalg.solve(found.covariance, error)) / 6.0)
    assert 0.1 < np.median(shares) < 3.0


def test_a_known_turn_pulls_the_orientation() -> None:
    image, truth = seen_at(20.0)
    other = turned_by(truth, 6.0, [1.0, 0.0, 0.0])
    free = registered(image, other)
    pulled = registered(image, other, turn_known=np.eye(3) / math.radians(0.2) ** 2)
    assert pulled.camera_T_pad.angle_to(other) < math.radians(0.5)
    assert free.camera_T_pad.angle_to(other) > 2.0 * pulled.camera_T_pad.angle_to(other)
    # what was known and what is seen are both known now
    assert np.trace(pulled.covariance[3:, 3:]) < 0.1 * np.trace(free.covariance[3:, 3:])
    near = registered(image, truth, turn_known=np.eye(3) / math.radians(0.2) ** 2)
    assert errors(near.camera_T_pad, truth)[2] < 0.5


def test_the_last_picture_spares_steps_and_changes_nothing() -> None:
    image, truth = seen_at(8.0)
    first = registered(image, start_near(truth, np.random.default_rng(1)))
    again = registered(image, first.camera_T_pad, before=first)
    assert again.camera_T_pad.angle_to(first.camera_T_pad) < math.radians(0.2)
    assert np.linalg.norm(again.camera_T_pad.translation - first.camera_T_pad.translation) < 0.002
    assert registered(image, first.camera_T_pad, before=first, steps=1).at_rest


@pytest.mark.parametrize(
    ("pad", "start"),
    [
        (PAD, view(3.0, 5.0, 1.0, 0.5, off=(0.9, 0.0))),
        (PAD, Pose(view(3.0, 5.0, 1.0, 0.5).rotation, np.array([0.0, 0.0, -3.0]))),
        (PAD, Pose(np.diag([1.0, -1.0, -1.0]) @ view(3.0, 5.0, 1.0, 0.5).rotation, np.array([0.0, 0.0, 3.0]))),
        (PadSpec(ring=None), view(3.0, 8.0, 1.0, 0.5)),
        (PadSpec(board=None), view(3.0, 8.0, 1.0, 0.5)),
        (PAD, view(200.0, 5.0, 1.0, 0.5)),
    ],
    ids=["out of the picture", "behind", "turned away", "no ring", "no board", "too small"],
)
def test_there_is_no_pose(pad: PadSpec, start: Pose) -> None:
    image, _ = seen_at(3.0)
    assert register_target(image, CAMERA, start, pad) is None


def test_a_picture_without_light_gives_no_pose() -> None:
    truth = view(3.0, 5.0, 1.0, 0.5)
    assert register_target(np.zeros((480, 640, 3), np.uint8), CAMERA, truth, PAD) is None


@pytest.mark.parametrize("share_out", [0.25, 0.45])
def test_a_print_cut_by_the_border_is_registered(share_out: float) -> None:
    distance_m = 4.0
    # the middle lies so far inside that a share of the ring's diameter is out
    column = (0.5 - share_out) * CAMERA.fx * PAD.diameter_m / distance_m
    truth = view(distance_m, 8.0, 1.0, 0.5, off=((column - CAMERA.cx) / CAMERA.fx, 0.05))
    found = registered(photograph(truth, np.random.default_rng(5)), start_near(truth, np.random.default_rng(6)))
    along, across, turned_deg = errors(found.camera_T_pad, truth)
    assert (along < 0.003, across < 0.001, turned_deg < 1.5) == (True, True, True)


def test_something_over_a_part_of_the_print_does_not_move_it() -> None:
    image, truth = seen_at(5.0)
    covered = image.copy()
    middle = CAMERA.project(truth.translation[None])[0].round().astype(int)
    cv2.rectangle(covered, (int(middle[0]) + 15, 0), (int(middle[0]) + 35, 479), (60, 90, 40), -1)
    whole, part = registered(image, truth), registered(covered, start_near(truth, np.random.default_rng(2)))
    along, across, turned_deg = errors(part.camera_T_pad, truth)
    assert (along < 0.005, across < 0.002, turned_deg < 2.0) == (True, True, True)
    assert part.share < whole.share - 0.05


def _likeness_as(pad: PadSpec, distance_m: float) -> float:
    truth = view(distance_m, 8.0, 1.0, 0.5)
    return registered(photograph(truth, np.random.default_rng(4), pad=pad), truth).likeness


@pytest.mark.parametrize("distance_m", [5.0, 12.0])
def test_another_sign_is_less_alike(distance_m: float) -> None:
    # a thin, wide H without a tag
    other = PadSpec(letter=Letter(height=0.34, width=0.7, stroke=0.05), quiet_zone=None, tags=())
    own = _likeness_as(PAD, distance_m)
    assert own > 0.95
    assert _likeness_as(other, distance_m) < own - 0.03
    ground = np.random.default_rng(0).integers(40, 200, (480, 640, 3), np.uint8)
    noise = register_target(ground, CAMERA, view(distance_m, 8.0, 1.0, 0.5), PAD)
    assert noise is None or noise.likeness < 0.3


def test_the_true_heading_is_likelier_than_half_a_turn() -> None:
    image, truth = seen_at(5.0)
    half: Array = np.diag([-1.0, -1.0, 1.0])
    assert registered(image, truth).chi2 < registered(image, truth @ Pose(half, np.zeros(3))).chi2 - 10.0


def test_the_residual_is_a_fraction_of_a_pixel_in_a_clean_picture() -> None:
    image, truth = seen_at(8.0)
    found = registered(image, truth)
    assert 0.0 < found.reproj_px < 0.3
    # photographed with a blur of 0.6 px on both axes
    assert found.blur_px2[[0, 2]] == pytest.approx([0.36, 0.36], abs=0.15)
    assert abs(found.blur_px2[1]) < 0.1
