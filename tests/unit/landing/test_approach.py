"""The finder from frame to frame on rendered approaches: no flips, and where it looks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.detect.stage import DetectStage
from landtool.landing.memory import LOOK_ROUND_EVERY
from landtool.pad import PadSpec
from landtool.types import Frame
from tests.approach import Approach
from tests.method import Told, followed, pad_finder, ring_box
from tests.scenes import PAD, mirrored, photograph, view

FPS = 30
FRAME_NS = 1_000_000_000 // FPS
EMPTY = np.full((480, 640, 3), 90, np.uint8)


def flips(frames: int, seed: int, pad: PadSpec = PAD) -> tuple[int, int]:
    """Fly from 5 m to 1 m with tilts around 5 degrees; return (poses, flipped poses from the fourth on)."""
    rng = np.random.default_rng(seed)
    approach = Approach(
        duration_s=frames / FPS,
        height_start_m=5.0,
        height_end_m=1.0,
        speed_mps=1.0,
        sway_rad=math.radians(5.0),
        sway_period_s=rng.uniform(2.0, 5.0),
        lateral_start_m=(0.4, -0.3),
        yaw_rad=rng.uniform(0.0, 6.28),
    )
    truths = [approach.camera_T_pad(index / FPS) for index in range(frames)]
    shots = (Frame(index, index * FRAME_NS, photograph(truth, rng, pad=pad)) for index, truth in enumerate(truths))
    posed = wrong = 0
    for result in followed(shots, pad_finder(pad)):
        if result.pose is not None:
            posed += 1
            wrong += posed > 3 and mirrored(result.pose.camera_T_pad, truths[result.index])
    return posed, wrong


@pytest.mark.parametrize("pad", [PAD, PadSpec(ring=None, letter=None)], ids=["pad", "tag alone"])
def test_no_pose_is_flipped(pad: PadSpec) -> None:
    posed, wrong = flips(40, seed=1, pad=pad)
    assert (posed, wrong) == (40, 0)


@pytest.mark.full
def test_no_pose_is_flipped_in_a_thousand_frames() -> None:
    posed, wrong = flips(1000, seed=2)
    assert wrong == 0
    assert posed >= 999


def test_the_whole_picture_is_read_only_when_nothing_is_known() -> None:
    image = photograph(view(3.0, 5.0, 1.0, 0.5), np.random.default_rng(0))
    results = list(followed(Frame(i, i * FRAME_NS, image) for i in range(3)))
    assert [result.search for result in results] == ["frame", "region", "region"]
    assert [len(result.tags) for result in results] == [1, 1, 1]


def test_near_the_network_looks_only_now_and_then_while_the_pad_is_seen() -> None:
    truth = view(3.0, 5.0, 1.0, 0.5)
    network, image = Told(ring_box(truth)), photograph(truth, np.random.default_rng(0))
    frames = (Frame(i, i * FRAME_NS, image) for i in range(LOOK_ROUND_EVERY + 1))
    results = list(followed(frames, pad_finder(detector=DetectStage(network, regions=True))))
    assert {result.stage for result in results[1:]} == {"near"}
    assert network.asked == 2
    assert [len(result.detections) for result in results] == [1, *[0] * (LOOK_ROUND_EVERY - 1), 1]
    assert {track.track_id for result in results for track in result.tracks} == {1}


def test_far_the_network_looks_at_every_frame() -> None:
    truth = view(12.0, 5.0, 1.0, 0.5)
    network, image = Told(ring_box(truth)), photograph(truth, np.random.default_rng(0))
    frames = (Frame(i, i * FRAME_NS, image) for i in range(5))
    results = list(followed(frames, pad_finder(detector=DetectStage(network, regions=True))))
    assert {result.stage for result in results} == {"far"}
    assert network.asked == len(results) == 5
    poses = [result.pose for result in results]
    assert all(pose is not None and pose.method == "target" for pose in poses)


def test_the_pad_is_found_again_after_it_left_the_picture() -> None:
    truth = view(3.0, 5.0, 1.0, 0.5)
    image = photograph(truth, np.random.default_rng(0))
    shown = [True] * 4 + [False] * 4 + [True] * 2
    results = list(followed(Frame(i, i * FRAME_NS, image if seen else EMPTY) for i, seen in enumerate(shown)))
    assert [result.pose is not None for result in results] == shown
    assert {result.reason for result in results[4:8]} == {"nothing of the pad found"}
    assert [result.tracks[0].track_id for result in results] == [1] * 10
    assert results[5].tracks[0].status == "coasting"


def test_all_tags_are_read_in_the_whole_picture_when_asked() -> None:
    image = photograph(view(3.0, 5.0, 1.0, 0.5), np.random.default_rng(0))
    finder = pad_finder(everywhere=True)
    results = list(followed((Frame(i, i * FRAME_NS, image) for i in range(3)), finder))
    assert [(result.search, len(result.tags)) for result in results] == [("frame", 1)] * 3
    assert all(result.pose is not None and result.pose.method == "tag" for result in results)


def test_a_picture_of_another_size_gives_tags_but_no_pose() -> None:
    image = photograph(view(2.0, 5.0, 1.0, 0.5), np.random.default_rng(0))[:, 40:]
    (result,) = followed([Frame(0, 0, np.ascontiguousarray(image))])
    assert len(result.tags) == 1
    assert result.pose is None
    assert "picture of 600x480, calibration for 640x480" in result.reason


def test_an_empty_picture_says_so() -> None:
    (result,) = followed([Frame(0, 0, EMPTY)])
    assert (result.tags, result.pose, result.reason) == ((), None, "nothing of the pad found")


def test_a_picture_without_a_clock_is_measured_but_not_tracked() -> None:
    truth = view(3.0, 5.0, 1.0, 0.5)
    (result,) = followed([Frame(0, None, photograph(truth, np.random.default_rng(0)))])
    assert result.pose is not None
    assert np.linalg.norm(result.pose.camera_T_pad.translation - truth.translation) < 0.01 * 3.0
    assert result.tracks == ()
