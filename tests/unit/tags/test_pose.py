from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotvec_from_rotation
from landtool.pad import PadSpec, PadTag
from landtool.synth.truth import tag_corners_px
from landtool.tags.pose import Solution, pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.types import TagObservation
from tests.scenes import CAMERA, PAD, view
from tests.unit.tags.small import shoot

LENS = Camera(640, 480, 554.0, 550.0, 322.0, 236.0, "plumb_bob", (-0.28, 0.09, 0.001, -0.002, 0.0))
FISHEYE = Camera(640, 480, 300.0, 300.0, 319.5, 239.5, "equidistant", (0.02, -0.01, 0.0, 0.0))
CENTRES = ((0.0, 0.0), (0.3, 0.3), (0.3, -0.3), (-0.3, 0.3), (-0.3, -0.3))
FIVE = PadSpec(tags=tuple(PadTag(id=i, size=0.16, x=x, y=y) for i, (x, y) in enumerate(CENTRES)))


def observe(
    camera: Camera, pose: Pose, pad: PadSpec = PAD, noise_px: float = 0.0, rng: np.random.Generator | None = None
) -> list[TagObservation]:
    """Observe all tags of a pad, exactly or with noise; stated: 0.02 px where there is none."""
    tags = []
    for tag in pad.tags:
        corners = tag_corners_px(camera, pose, pad, tag)
        if rng is not None:
            corners = corners + rng.normal(0.0, noise_px, (4, 2))
        tags.append(TagObservation(tag.family, tag.id, 0, 100.0, corners, (noise_px or 0.02) ** 2 * np.eye(8)))
    return tags


def solve(observations: list[TagObservation], camera: Camera, pad: PadSpec = PAD) -> tuple[Solution, ...]:
    corners = pad_corners(observations, camera, pad)
    assert corners is not None
    return pad_solutions(corners)


def difference(solution: Solution, truth: Pose) -> Array:
    """Return (dt, dw) (6,) from a solution to the truth, as its covariance has it."""
    turn = rotvec_from_rotation(truth.rotation @ solution.camera_T_pad.rotation.T)
    return np.concatenate([truth.translation - solution.camera_T_pad.translation, turn])


def poses(n: int, seed: int, tilt: tuple[float, float] = (0.0, 35.0), reach: float = 0.25) -> list[Pose]:
    """Return random camera_T_pad; reach: how far off the optical axis the pad may be, times its distance."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(n):
        azimuth, yaw = rng.uniform(0.0, 6.28, 2)
        x, y = rng.uniform(-reach, reach, 2)
        found.append(view(rng.uniform(1.0, 6.0), rng.uniform(*tilt), azimuth, yaw, (x, y)))
    return found


@pytest.mark.parametrize("camera", [CAMERA, LENS, FISHEYE])
def test_exact_corners_give_the_exact_pose_first(camera: Camera) -> None:
    for truth in poses(20, seed=1, tilt=(3.0, 35.0)):
        best = solve(observe(camera, truth), camera)[0]
        np.testing.assert_allclose(difference(best, truth), 0.0, atol=1e-4)
        assert best.reproj_px < 1e-3


def test_both_mirror_images_are_returned_where_the_tag_is_small() -> None:
    for pose in poses(20, seed=2, tilt=(4.0, 12.0), reach=0.0):
        truth = Pose(pose.rotation, 5.0 * pose.translation / pose.translation[2])
        first, second = solve(observe(CAMERA, truth), CAMERA)
        assert first.chi2 <= second.chi2
        # mirrored about the line of sight: the normals' mean lies along it
        sight = truth.translation / np.linalg.norm(truth.translation)
        mean = first.camera_T_pad.rotation[:, 2] + second.camera_T_pad.rotation[:, 2]
        assert abs(sight @ mean) / np.linalg.norm(mean) > 0.98


def test_moving_the_pad_moves_the_pose() -> None:
    for truth in poses(10, seed=3, tilt=(5.0, 30.0)):
        pad_T_moved = Pose.from_rotvec([0.05, -0.1, 0.0], [0.0, 0.0, 0.7])
        here = solve(observe(CAMERA, truth), CAMERA)[0].camera_T_pad
        there = solve(observe(CAMERA, truth @ pad_T_moved), CAMERA)[0].camera_T_pad
        between = here.inverse() @ there
        np.testing.assert_allclose(between.translation, pad_T_moved.translation, atol=1e-3)
        assert between.angle_to(pad_T_moved) < 1e-3


def test_a_larger_pad_is_farther_away() -> None:
    truth = view(2.0, 20.0, 1.0, 2.0)
    tags = observe(CAMERA, truth)
    small, large = (solve(tags, CAMERA, PAD.scaled(d))[0] for d in (1.0, 2.5))
    np.testing.assert_allclose(large.camera_T_pad.translation, 2.5 * small.camera_T_pad.translation, atol=1e-6)


def test_a_tag_not_of_the_pad_says_nothing() -> None:
    truth = view(2.0, 10.0, 0.0, 0.0)
    assert pad_corners([], CAMERA, PAD) is None
    other = PadSpec(tags=(PadTag(id=9),))
    assert pad_corners(observe(CAMERA, truth, other), CAMERA, PAD) is None


def test_five_tags_together_are_better_than_one() -> None:
    rng = np.random.default_rng(4)
    one: list[tuple[float, float]] = []
    five: list[tuple[float, float]] = []
    for truth in poses(30, seed=5, tilt=(5.0, 30.0)):
        tags = observe(CAMERA, truth, FIVE, 0.05, rng)
        for errors, part in ((one, tags[:1]), (five, tags)):
            best = min(solve(part, CAMERA, FIVE), key=lambda s: s.camera_T_pad.angle_to(truth))
            turned = float(np.linalg.norm(difference(best, truth)[3:]))
            errors.append((turned, float(np.trace(best.covariance[3:, 3:]))))
    turned_by_one, turned_by_five = np.median(one, axis=0), np.median(five, axis=0)
    assert (turned_by_five < 0.3 * turned_by_one).all()


def within_band(nees: list[float], level: float = 0.95) -> bool:
    low, high = chi2.ppf([(1 - level) / 2, (1 + level) / 2], 6 * len(nees)) / len(nees)
    return bool(low < np.mean(nees) < high)


@pytest.mark.parametrize(("pad", "camera"), [(PAD, CAMERA), (PAD, LENS), (FIVE, CAMERA), (PAD, FISHEYE)])
def test_the_covariance_says_how_large_the_errors_are(pad: PadSpec, camera: Camera) -> None:
    rng = np.random.default_rng(6)
    nees = []
    for truth in poses(300, seed=7, tilt=(10.0, 35.0)):
        near = Pose(truth.rotation, truth.translation / np.linalg.norm(truth.translation) * 2.0)
        solutions = solve(observe(camera, near, pad, 0.03, rng), camera, pad)
        error = difference(min(solutions, key=lambda s: s.camera_T_pad.angle_to(near)), near)
        best = min(solutions, key=lambda s: s.camera_T_pad.angle_to(near))
        nees.append(float(error @ np.linalg.solve(best.covariance, error)))
    assert within_band(nees, 0.999)


def rendered_nees(n: int, seed: int) -> list[float]:
    """Of poses measured in rendered pictures, tags of 15 to 120 px tilted up to 35 degrees."""
    rng = np.random.default_rng(seed)
    reader = TagReader(ReaderConfig.of_pad(PAD))
    nees = []
    for _ in range(n):
        shot = shoot(float(np.exp(rng.uniform(np.log(15), np.log(120)))), rng, tilt_deg=(5.0, 35.0))
        tags = list(reader.read_frame(shot.image))
        solutions = solve(tags, shot.camera)
        best = min(solutions, key=lambda s: s.camera_T_pad.angle_to(shot.camera_T_pad))
        error = difference(best, shot.camera_T_pad)
        nees.append(float(error @ np.linalg.solve(best.covariance, error)))
    return nees


def test_the_covariance_holds_on_rendered_truth() -> None:
    assert within_band(rendered_nees(200, seed=8))


@pytest.mark.full
def test_the_covariance_holds_on_a_thousand_rendered_pictures() -> None:
    mean = float(np.mean(rendered_nees(1000, seed=9)))
    assert 0.9 * 6.0 < mean < 1.1 * 6.0
