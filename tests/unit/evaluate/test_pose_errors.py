"""Errors of poses: what they are made of, look-alikes, honest covariances, and which pictures are asked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.evaluate.metric import Metric
from landtool.evaluate.pose_difference import half_turned, mirrored, normalised, pose_difference
from landtool.evaluate.pose_errors import POSE_ERROR_COLUMNS, pose_error_row, pose_errors, still_pose_errors
from landtool.evaluate.pose_metrics import pose_metrics
from landtool.geometry import Pose, rotation_from_rotvec
from tests.unit.evaluate.clips import CAMERA, PAD, measured, result, tracked, true_frame, truth_of

TRUE = Pose(rotation_from_rotvec([math.pi - 0.3, 0.0, 0.0]), np.array([0.0, 3.0, 4.0]))


def by_key(metrics: list[Metric]) -> dict[str, Metric]:
    assert len({metric.key for metric in metrics}) == len(metrics)
    return {metric.key: metric for metric in metrics}


def test_errors_along_and_across_the_line_of_sight() -> None:
    along, across = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    found = Pose(rotation_from_rotvec([0.0, 0.0, 0.1]) @ TRUE.rotation, TRUE.translation - 0.3 * along + 0.4 * across)
    off = pose_difference(found, TRUE)
    assert (off.place_m, off.along_m, off.across_m) == pytest.approx((0.5, 0.3, 0.4))
    assert off.rotation_deg == pytest.approx(math.degrees(0.1))
    tilt = abs(TRUE.rotation[2, 2])  # a turn about z moves a normal by less, as it is not along z
    assert off.normal_deg == pytest.approx(math.degrees(0.1 * math.sqrt(1.0 - tilt**2)), rel=1e-3)


def test_the_mirror_image_and_half_a_turn_are_told_from_each_other() -> None:
    ray = TRUE.translation / np.linalg.norm(TRUE.translation)
    about_ray = Pose(rotation_from_rotvec(math.pi * ray) @ TRUE.rotation, TRUE.translation)
    assert mirrored(about_ray, TRUE)
    turned = Pose(TRUE.rotation @ rotation_from_rotvec([0.0, 0.0, math.pi]), TRUE.translation)
    assert half_turned(turned, TRUE)
    assert not mirrored(turned, TRUE)
    assert not mirrored(TRUE, TRUE)


def test_a_covariance_without_inverse_tells_nothing() -> None:
    assert normalised(np.ones(2), np.zeros((2, 2))) is None
    assert normalised(np.array([3.0, 0.0]), np.diag([9.0, 1.0])) == pytest.approx(1.0)


def test_errors_drawn_from_their_covariance_are_honest() -> None:
    rng = np.random.default_rng(1)
    root = np.linalg.cholesky(np.diag([1e-4, 4e-4, 9e-4, 1e-3, 1e-3, 2e-3]) + 2e-5)
    truth = truth_of(600, speed_mps=0.0)
    results = []
    for frame in truth.frames:
        step = root @ rng.normal(size=6)
        pose = measured(frame.camera_T_pad, off_m=step[:3], turn=step[3:], covariance=root @ root.T)  # type: ignore
        results.append(result(frame.index or 0, pose=pose))
    metrics = by_key(pose_metrics(pose_errors("clip", results, truth, CAMERA, PAD)))
    for name in ("pose.nees_place", "pose.nees_rotation"):
        found = metrics[name]
        assert found.value == pytest.approx(1.0, abs=0.12)
        assert found.low is not None
        assert found.high is not None
        assert found.low < found.value < found.high  # type: ignore[operator]
        assert (found.better, found.expected, found.count) == ("expected", 1.0, 600)


def test_a_row_for_every_frame_that_shows_the_pad_found_or_not() -> None:
    frames = [
        true_frame(0), true_frame(1), true_frame(2, visible_fraction=0.0), true_frame(3, visible_fraction=0.0),
        true_frame(4, 0.0, 20.0),
    ]  # fmt: skip
    truth = type(truth_of(1))(truth_of(1).path, tuple(frames))
    true = frames[0].camera_T_pad
    assert true is not None
    results = [
        result(0, pose=measured(true, off_m=(0.04, 0.0, 0.0)), tracks=(tracked((0, 0)),)),
        result(1),
        result(2),
        result(3, pose=measured(true)),
        result(4, pose=measured(true, method="box"), tracks=(tracked((0, 0), status="coasting"),)),
        result(9, pose=measured(true)),  # no truth
    ]
    errors = pose_errors("a clip", results, truth, CAMERA, PAD)
    assert [error.frame for error in errors] == [0, 1, 3, 4]
    assert [error.confirmed for error in errors] == [True, False, False, False]
    assert [error.measurable for error in errors] == [True, True, False, False]
    assert errors[3].place_m is not None
    assert errors[3].normal_deg is None
    metrics = by_key(pose_metrics(errors))
    share = metrics["pose.pose_share"]
    assert (share.value, share.count) == (0.5, 2)
    assert metrics["pose.across_percent_median"].count == 2
    assert metrics["pose.box_share"].value == pytest.approx(1 / 3)
    assert metrics["pose.pose_share:distance_m=4-6"].value == 0.5
    assert "pose.normal_deg_median:distance_m=16-25" not in metrics  # a box says nothing of it
    for error in errors:
        assert len(pose_error_row("m", error)) == len(POSE_ERROR_COLUMNS)
    assert dict(zip(POSE_ERROR_COLUMNS, pose_error_row("m", errors[1]), strict=True))["flipped"] is None


def test_flips_count_after_confirmation_unless_the_covariance_says_so() -> None:
    truth = truth_of(4, speed_mps=0.0)
    true = truth.frames[0].camera_T_pad
    assert true is not None
    turn = math.pi * true.rotation[:, 2]
    unsure = np.diag([1e-4] * 3 + [1.0] * 3)
    proven = (tracked((0, 0)),)
    results = [
        result(0, pose=measured(true, turn=turn)),  # nothing is confirmed yet
        result(1, pose=measured(true, turn=turn), tracks=proven),
        result(2, pose=measured(true, turn=turn, covariance=unsure), tracks=proven),
        result(3, pose=measured(true), tracks=proven),
    ]
    errors = pose_errors("clip", results, truth, CAMERA, PAD)
    assert [error.flipped for error in errors] == [True, True, False, False]
    assert errors[2].half_turn_told
    flips = by_key(pose_metrics(errors))["pose.flips_per_1000"]
    assert flips.value == pytest.approx(1000 / 3)
    stills = [(str(k), found, truth.frames[k].pad(CAMERA)) for k, found in enumerate(results)]
    told = [(path, found, true) for path, found, true in stills if true is not None]
    of_stills = by_key(pose_metrics(still_pose_errors(told, PAD), "still_pose"))
    assert of_stills["still_pose.flips_per_1000"].value == pytest.approx(500.0)


def test_nothing_to_judge_is_undefined() -> None:
    metrics = pose_metrics([])
    assert {metric.said for metric in metrics} == {"undefined, 0 of 0"}
    assert {"pose_share", "nees_place", "flips_per_1000", "place_m_median"} <= {metric.name for metric in metrics}
    unfound = pose_metrics(pose_errors("clip", [result(0)], truth_of(1), CAMERA, PAD))
    assert by_key(unfound)["pose.pose_share"].value == 0.0
    assert by_key(unfound)["pose.normal_deg_median"].said == "undefined, 0 of 1"


def test_a_worse_pose_makes_worse_numbers() -> None:
    truth = truth_of(40, speed_mps=0.0)

    def numbers(off_m: float) -> dict[str, Metric]:
        results = [
            result(f.index or 0, pose=measured(f.camera_T_pad, off_m=(0.0, 0.0, off_m)))  # type: ignore[arg-type]
            for f in truth.frames
        ]
        return by_key(pose_metrics(pose_errors("clip", results, truth, CAMERA, PAD)))

    good, bad = numbers(0.004), numbers(0.04)
    assert good["pose.along_percent_median"].value == pytest.approx(0.1)
    assert bad["pose.place_percent_p95"].value == pytest.approx(1.0)
    assert bad["pose.nees_place"].value == pytest.approx(100 * good["pose.nees_place"].value)  # type: ignore[operator]
