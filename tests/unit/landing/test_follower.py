"""Which of a pad's poses is believed, over rendered frames with exact truth."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.follower import HEADING_OPEN, MIRROR_KEPT, PadFollower
from landtool.landing.measure import HALF_TURN, PadMeasurer, mirrored
from landtool.tags.pose import Solution
from landtool.types import Image, PadPose
from tests.scenes import CAMERA, PAD, photograph, view

FRAME_NS = 33_000_000
MEASURER = PadMeasurer(CAMERA, PAD, "srgb")
GREY = np.full((480, 640, 3), 90, np.uint8)
LEVEL = Pose(np.eye(3), np.zeros(3))  # the drone's attitude in the world


def shots(truth: Pose, count: int, *, grey_noise: float = 3.0) -> list[Image]:
    rng = np.random.default_rng(11)
    return [photograph(truth, rng, grey_noise=grey_noise) for _ in range(count)]


def follow(
    images: Sequence[Image], start: Pose, world_T_body: Pose | None = LEVEL, follower: PadFollower | None = None
) -> list[tuple[PadPose, str]]:
    """Measure by the print frame by frame, where the pad was in the frame before."""
    follower, place, found = follower or PadFollower(STRAIGHT_DOWN), start, []
    for index, image in enumerate(images):
        seen = follower.by_print(image, MEASURER, place, index * FRAME_NS, world_T_body)
        assert seen is not None
        found.append(seen)
        place = seen[0].camera_T_pad
    return found


def normal_off_deg(pose: Pose, truth: Pose) -> float:
    return math.degrees(math.acos(min(float(pose.rotation[:, 2] @ truth.rotation[:, 2]), 1.0)))


def solution(pose: Pose, chi2: float = 1.0, sigma_deg: float = 0.3) -> Solution:
    return Solution(pose, np.diag([1e-6] * 3 + [math.radians(sigma_deg) ** 2] * 3), chi2, 0.1)


@pytest.mark.parametrize("distance_m", [6.0, 15.0])
def test_the_mirror_image_is_settled_over_time(distance_m: float) -> None:
    # a platform that leans by 10 degrees, begun at the mirror image of its pose
    truth = view(distance_m, 10.0, 1.0, 0.5, off=(0.15, 0.0))
    found = follow(shots(truth, 12), mirrored(truth))
    assert normal_off_deg(mirrored(truth), truth) > 5.0
    assert normal_off_deg(found[-1][0].camera_T_pad, truth) < 2.5
    assert found[-1][0].method == "target"


def test_a_pad_of_an_open_mirror_image_says_the_other_pose() -> None:
    truth = view(20.0, 10.0, 1.0, 0.5)
    pose, _ = follow(shots(truth, 1, grey_noise=8.0), truth, None)[0]
    if pose.alternative is not None:  # told apart at once it has none
        assert pose.alternative.angle_to(pose.camera_T_pad) > math.radians(1.0)
        assert 0.0 < pose.ambiguity <= 1.0
    else:
        assert pose.ambiguity == 0.0
    assert np.linalg.eigvalsh(pose.covariance).min() > 0.0


def test_half_a_turn_is_settled_by_the_pixels_of_the_tag() -> None:
    truth = view(6.0, 8.0, 1.0, 0.5)
    found = follow(shots(truth, 10), truth @ HALF_TURN)
    first, last = found[0], found[-1]
    assert HEADING_OPEN in first[1]
    assert HEADING_OPEN not in last[1]
    assert math.degrees(last[0].camera_T_pad.angle_to(truth)) < 3.0
    # while it is open, the heading's variance says so
    up = truth.rotation[:, 2]
    spread = [up @ pose.covariance[3:, 3:] @ up for pose, _ in (first, last)]
    assert spread[0] > 10.0 * spread[1]


def test_a_read_tag_knows_the_heading_at_once() -> None:
    truth = view(4.0, 8.0, 1.0, 0.5)
    follower = PadFollower(STRAIGHT_DOWN)
    assert not follower.heading_known
    pose, said = follower.by_tag([solution(truth)], 0, LEVEL)
    assert (pose.method, pose.ambiguity, pose.alternative, said) == ("tag", 0.0, None, "")
    assert follower.heading_known
    (by_print, said), *_ = follow(shots(truth, 1), truth, follower=follower)
    assert said == ""
    assert math.degrees(by_print.camera_T_pad.angle_to(truth)) < 1.0


def test_of_a_tags_two_poses_the_past_keeps_the_one_it_knows() -> None:
    truth = view(5.0, 10.0, 1.0, 0.5, off=(0.1, 0.0))
    follower = PadFollower(STRAIGHT_DOWN)
    for index in range(10):
        follower.by_tag([solution(truth, 1.0), solution(mirrored(truth), 9.0)], index * FRAME_NS, LEVEL)
    swapped = [solution(mirrored(truth), 1.0), solution(truth, 3.0)]
    pose, said = follower.by_tag(swapped, 10 * FRAME_NS, LEVEL)
    assert pose.camera_T_pad.angle_to(truth) < 1e-6
    assert (pose.better_fit_rejected, said) == (True, MIRROR_KEPT)
    assert pose.alternative is swapped[0].camera_T_pad
    assert 0.0 < pose.ambiguity < 1.0


def test_a_tag_that_turned_as_no_pad_can_is_a_surprise() -> None:
    truth = view(4.0, 5.0, 1.0, 0.5)
    follower = PadFollower(STRAIGHT_DOWN)
    assert not follower.is_surprised(solution(truth), 0, LEVEL)  # nothing is known yet
    for index in range(5):
        follower.by_tag([solution(truth)], index * FRAME_NS, LEVEL)
    turned = Pose(truth.rotation @ rotation_from_rotvec([0.0, math.radians(12.0), 0.0]), truth.translation)
    assert not follower.is_surprised(solution(truth), 5 * FRAME_NS, LEVEL)
    assert follower.is_surprised(solution(turned), 5 * FRAME_NS, LEVEL)
    # one that is not sure of itself is none
    assert not follower.is_surprised(solution(turned, sigma_deg=10.0), 5 * FRAME_NS, LEVEL)


def test_after_a_long_time_nothing_is_known_any_more() -> None:
    truth = view(4.0, 5.0, 1.0, 0.5)
    turned = Pose(truth.rotation @ rotation_from_rotvec([0.0, math.radians(12.0), 0.0]), truth.translation)
    follower = PadFollower(STRAIGHT_DOWN)
    follower.by_tag([solution(truth)], 0, LEVEL)
    assert not follower.is_surprised(solution(turned), 60_000_000_000, LEVEL)


def test_what_is_not_there_is_not_measured() -> None:
    truth = view(6.0, 8.0, 1.0, 0.5)
    follower = PadFollower(STRAIGHT_DOWN)
    assert follower.by_print(GREY, MEASURER, truth, 0, LEVEL) is None
    assert follower.at_box(GREY, MEASURER, [truth], 0, LEVEL) is None
    assert follower.at_box(GREY, MEASURER, [], 0, LEVEL) is None


def test_a_pad_at_a_box_keeps_its_known_heading() -> None:
    truth = view(6.0, 8.0, 1.0, 0.5)
    follower = PadFollower(STRAIGHT_DOWN)
    follower.by_tag([solution(truth)], 0, LEVEL)
    (image,) = shots(truth, 1)
    seen = follower.at_box(image, MEASURER, [truth @ HALF_TURN], FRAME_NS, LEVEL)
    assert seen is not None
    assert math.degrees(seen[0].camera_T_pad.angle_to(truth)) < 2.0


def test_without_a_clock_a_picture_stands_alone() -> None:
    truth = view(6.0, 8.0, 1.0, 0.5)
    follower = PadFollower(STRAIGHT_DOWN)
    for image in shots(truth, 2):
        seen = follower.by_print(image, MEASURER, truth, None, None)
        assert seen is not None
        assert normal_off_deg(seen[0].camera_T_pad, truth) < 3.0
        assert np.isfinite(seen[0].covariance).all()
