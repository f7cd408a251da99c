"""Whether the poses of rendered views err as much as their covariances say, and what is added to them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from landtool.geometry import Array, Pose, rotvec_from_rotation
from landtool.landing.measure import PadMeasurer, with_doubt
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.types import Image
from tests.scenes import CAMERA, PAD, photograph, view

MEASURER = PadMeasurer(CAMERA, PAD, "srgb")
READER = TagReader(ReaderConfig.of_pad(PAD))
VIEWS = 8
Measure = Callable[[float, int], tuple[float, float]]


def normalised(found: Pose, covariance: Array, truth: Pose) -> tuple[float, float]:
    """Return the squared errors of place and orientation by their covariance, 3 degrees of freedom each."""
    off = found.translation - truth.translation
    turn = rotvec_from_rotation(found.rotation @ truth.rotation.T)
    place, spread = covariance[:3, :3], covariance[3:, 3:]
    return float(off @ np.linalg.solve(place, off)), float(turn @ np.linalg.solve(spread, turn))


def scene(distance_m: float, seed: int) -> tuple[Pose, Image, np.random.Generator]:
    """Return a view of the pad with noise, its true pose, and the randomness it came from."""
    rng = np.random.default_rng((seed, round(10 * distance_m)))
    off = (float(rng.uniform(-0.15, 0.15)), float(rng.uniform(-0.1, 0.1)))
    tilt_deg, azimuth, yaw = (float(rng.uniform(low, high)) for low, high in ((2.0, 12.0), (0.0, 6.28), (0.0, 6.28)))
    truth = view(distance_m, tilt_deg, azimuth, yaw, off=off)
    return truth, photograph(truth, rng), rng


def by_print(distance_m: float, seed: int) -> tuple[float, float]:
    truth, image, rng = scene(distance_m, seed)
    step = np.concatenate([rng.normal(0.0, 0.003 * distance_m, 3), rng.normal(0.0, 0.02, 3)])
    found = MEASURER.by_print(image, truth.perturbed(step))
    assert found is not None
    return normalised(found.camera_T_pad, found.covariance, truth)


def by_tags(distance_m: float, seed: int) -> tuple[float, float]:
    truth, image, _ = scene(distance_m, seed)
    (found,) = MEASURER.by_tags(image, READER.read_frame(image))
    return normalised(found.camera_T_pad, found.covariance, truth)


@pytest.mark.parametrize(("measure", "distance_m"), [(by_print, 8.0), (by_print, 14.0), (by_tags, 1.5), (by_tags, 3.5)])
def test_errors_are_as_large_as_their_covariance_says(measure: Measure, distance_m: float) -> None:
    """Before what no picture tells is added: these views are of a flat pad by a camera without rolling shutter."""
    place, turn = np.array([measure(distance_m, seed) for seed in range(VIEWS)]).mean(axis=0)

    most = chi2.ppf(0.9999, 3 * VIEWS) / VIEWS
    assert 0.3 < place < most
    # the tilt of a print without a flaw is known better than is said
    assert 0.05 < turn < most


def test_rows_away_from_the_middle_are_less_sure() -> None:
    turn = view(5.0, 0.0, 0.0, 0.0).rotation
    middle = with_doubt(Pose(turn, np.array([0.0, 0.0, 5.0])), np.zeros((6, 6)))
    aside = with_doubt(Pose(turn, np.array([2.0, 0.0, 5.0])), np.zeros((6, 6)))
    low = with_doubt(Pose(turn, np.array([0.0, 2.0, 5.0])), np.zeros((6, 6)))

    assert np.trace(low[:3, :3]) > 1.5 * np.trace(aside[:3, :3]) > np.trace(middle[:3, :3])
    # a rolling shutter tilts the pad about the camera's rows
    assert middle[3, 3] > 2.0 * middle[4, 4] > 2.0 * middle[5, 5]


def test_doubt_is_added_whatever_is_known() -> None:
    pose = view(3.0, 8.0, 1.0, 0.4, off=(0.1, 0.1))
    added = with_doubt(pose, np.zeros((6, 6)))

    assert np.linalg.eigvalsh(added).min() > 0.0
    assert np.allclose(with_doubt(pose, np.eye(6)) - np.eye(6), added)


def test_a_near_pad_is_found_from_a_start_far_off() -> None:
    truth = view(0.65, 4.0, 1.0, 0.2, off=(0.0, 0.45))
    image = photograph(truth, np.random.default_rng(3))
    found = MEASURER.by_print(image, truth.perturbed([0.04, -0.03, 0.02, 0.01, 0.01, 0.01]))

    assert found is not None
    assert np.linalg.norm(found.camera_T_pad.translation - truth.translation) < 0.003 * 0.65


def test_a_picture_without_the_print_is_not_explained() -> None:
    rng = np.random.default_rng(1)
    stripes = np.where(np.arange(640) // 40 % 2, 40, 90).astype(np.uint8)[None, :, None]
    image = np.clip(stripes + rng.normal(0.0, 3.0, (480, 640, 3)), 0, 255).astype(np.uint8)

    assert MEASURER.by_print(image, view(7.0, 3.0, 0.0, 0.0)) is None


def test_a_near_tag_is_refined_though_its_edges_are_a_little_off() -> None:
    """Blur and a tone that is not the camera's move the edges of a tag this large by far more than noise."""
    truth = view(0.62, 3.0, 1.0, 0.3)
    image = photograph(truth, np.random.default_rng(2), grey_noise=1.0, blur_px=1.6)
    bent = PadMeasurer(CAMERA, PAD, 1.7)
    (found,) = bent.by_tags(image, READER.read_frame(image))

    off = found.camera_T_pad.translation - truth.translation
    assert np.linalg.norm(off) < 0.002 * 0.62
    assert found.camera_T_pad.angle_to(truth) < np.radians(0.2)


def test_large_tags_are_no_better_known_than_blur_and_tone_allow() -> None:
    """A corner's own noise is some thousandths of a pixel there; what its edges may be off is far more."""
    tag_only = replace(PAD, ring=None, letter=None, board=None)
    truth = view(0.35, 8.0, 1.0, 0.5)
    image = photograph(truth, np.random.default_rng(3), pad=tag_only)
    tags = TagReader(ReaderConfig.of_pad(tag_only)).read_frame(image)
    (best, *_) = PadMeasurer(CAMERA, tag_only, "srgb").by_tags(image, tags)
    across_m = math.sqrt(float(best.covariance[0, 0]))
    side_m = PAD.tag_size_m(PAD.tags[0])
    assert 0.2 * 0.001 * side_m < across_m < 0.01 * side_m
