"""Errors of tags: corners, legible tags that were not read, readings of nothing, and the pose of a tag alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from landtool.evaluate.metric import Metric
from landtool.evaluate.tag_errors import (
    TAG_ERROR_COLUMNS,
    TagError,
    still_tag_errors,
    tag_error_rows,
    tag_errors,
    tag_metrics,
)
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.pad import PadSpec, PadTag
from landtool.types import TagObservation
from tests.unit.evaluate.clips import CAMERA, PAD, result, truth_of

TWO = PadSpec(tags=(PadTag(), PadTag(id=7, size=0.1, x=0.2)))


def reading(corners: Array, tag_id: int = 5) -> TagObservation:
    return TagObservation("tag36h11", tag_id, 0, 50.0, corners, np.eye(8) * 0.01)


def true_corners(pose: Pose | None, pad: PadSpec = PAD, which: int = 0) -> Array:
    assert pose is not None
    return CAMERA.project(pose.apply(pad.tag_corners_m(pad.tags[which])))


def judged(offset_px: tuple[float, float] = (0.0, 0.0), *, frames: int = 3, height_m: float = 3.0) -> list[TagError]:
    truth = truth_of(frames, speed_mps=0.0, height_m=height_m)
    results = [
        result(k, tags=(reading(true_corners(frame.camera_T_pad) + offset_px),)) for k, frame in enumerate(truth.frames)
    ]
    return tag_errors("clip", results, truth, CAMERA, PAD)


def values(errors: list[TagError]) -> dict[str, Metric]:
    return {metric.key: metric for metric in tag_metrics(errors)}


def test_exact_corners_make_no_error() -> None:
    errors = judged()
    assert all(e.read and e.legible and not e.wrong and not e.flipped for e in errors)
    assert errors[0].tag_px == pytest.approx(400.0 * 0.16 / 3.0)
    assert errors[0].tilt_deg == pytest.approx(0.0, abs=1e-6)
    metrics = values(errors)
    assert metrics["tags.corner_px_p95"].value == pytest.approx(0.0, abs=1e-9)
    assert metrics["tags.place_percent_median"].value == pytest.approx(0.0, abs=1e-3)
    assert (metrics["tags.read_share"].value, metrics["tags.wrong_ids"].said) == (1.0, "0, 3 of 3")
    assert metrics["tags.read_share:tag_px=20-30"].count == 3


def test_half_a_pixel_of_convention_shows() -> None:
    metrics = values(judged((0.5, 0.5)))
    assert metrics["tags.corner_px_median"].value == pytest.approx(math.sqrt(0.5))
    moved_m = math.sqrt(0.5) / 400.0 * 3.0
    assert metrics["tags.place_percent_median"].value == pytest.approx(100.0 * moved_m / 3.0, rel=1e-3)


def test_a_legible_tag_that_nobody_read_is_missed_and_a_small_one_is_not_asked() -> None:
    for height_m, rows in ((3.0, 1), (4.5, 1), (4.6, 0)):  # 14 px at 4.57 m
        truth = truth_of(1, height_m=height_m)
        errors = tag_errors("clip", [result(0)], truth, CAMERA, PAD)
        assert [(e.read, e.legible) for e in errors] == [(False, True)] * rows
    assert values(errors)["tags.read_share"].said == "undefined, 0 of 0"
    truth = truth_of(1, height_m=3.0)
    assert values(tag_errors("clip", [result(0)], truth, CAMERA, PAD))["tags.read_share"].value == 0.0


@pytest.mark.parametrize(
    ("changes", "legible"),
    [
        ({"hidden": 0.1}, False),
        ({"hidden": None, "visible_fraction": 0.4}, False),
        ({"hidden": None, "visible_fraction": 0.6}, True),
        ({"hidden": None, "occluded": True}, False),
        ({"hidden": None, "visible_fraction": None}, True),
    ],
)
def test_a_hidden_tag_is_not_asked(changes: dict[str, object], legible: bool) -> None:
    truth = truth_of(1, height_m=3.0, **changes)
    assert len(tag_errors("clip", [result(0)], truth, CAMERA, PAD)) == legible


def test_readings_of_other_tags_and_of_other_places_are_wrong() -> None:
    truth = truth_of(1, height_m=3.0)
    corners = true_corners(truth.frames[0].camera_T_pad)
    tags = (reading(corners), reading(corners, 9), reading(corners + 40.0))
    errors = tag_errors("clip", [result(0, tags=tags)], truth, CAMERA, PAD)
    assert [(e.tag_id, e.wrong) for e in errors] == [(5, False), (9, True), (5, True)]
    assert values(errors)["tags.wrong_ids"].said == "2, 3 of 3"
    rows = list(tag_error_rows("m", errors))
    assert len(rows) == 1
    assert len(rows[0]) == len(TAG_ERROR_COLUMNS)


def test_the_truths_own_corners_hold_for_the_first_tag_and_projection_for_the_others() -> None:
    truth = truth_of(1, height_m=2.0)
    pose = truth.frames[0].camera_T_pad
    first, second = (true_corners(pose, TWO, k) for k in (0, 1))
    sheared = replace(truth.frames[0], tag_corners_px=first + (3.0, 0.0))
    truth = replace(truth, frames=(sheared,))
    found = result(0, tags=(reading(first + (3.0, 0.0)), reading(second + (0.0, 1.0), 7)))
    errors = tag_errors("clip", [found], truth, CAMERA, TWO)
    assert [e.corner_px for e in errors] == pytest.approx([0.0, 1.0])
    assert errors[1].distance_m == pytest.approx(math.hypot(2.0, 0.2))


def test_a_mirrored_solution_is_a_flip() -> None:
    truth = truth_of(1, height_m=3.0)
    frame = truth.frames[0]
    assert frame.camera_T_pad is not None
    tilted = rotation_from_rotvec([0.35, 0.0, 0.0]) @ frame.camera_T_pad.rotation
    image = rotation_from_rotvec([-0.35, 0.0, 0.0]) @ frame.camera_T_pad.rotation
    truth = replace(truth, frames=(replace(frame, camera_T_pad=Pose(tilted, frame.camera_T_pad.translation)),))
    corners = true_corners(Pose(image, frame.camera_T_pad.translation))
    errors = tag_errors("clip", [result(0, tags=(reading(corners),))], truth, CAMERA, PAD)
    assert errors[0].flipped
    assert errors[0].normal_deg == pytest.approx(math.degrees(0.7), abs=0.1)
    assert values(errors)["tags.flip_share"].value == 1.0


def test_single_pictures_are_judged_in_the_same_way() -> None:
    truth = truth_of(1, height_m=3.0)
    true = truth.frames[0].pad(CAMERA)
    assert true is not None
    found = result(0, t_ns=None, tags=(reading(true_corners(true.camera_T_pad)),))
    (error,) = still_tag_errors([("a.png", found, true)], PAD)
    assert (error.clip, error.corner_px) == ("a.png", pytest.approx(0.0))


def test_no_tags_at_all_is_undefined() -> None:
    metrics = tag_metrics([])
    assert {metric.said for metric in metrics} == {"undefined, 0 of 0"}
    assert len(metrics) == 7
