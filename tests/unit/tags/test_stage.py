from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.tags.stage import TagStage
from landtool.types import Frame
from tests.approach import Approach
from tests.scenes import CAMERA, PAD, mirrored, photograph, view

FPS = 30


def stage(pad: PadSpec = PAD) -> TagStage:
    return TagStage(TagReader(ReaderConfig.of_pad(pad)), pad, CAMERA, STRAIGHT_DOWN)


def flips(frames: int, seed: int, pad: PadSpec = PAD) -> tuple[int, int]:
    """Fly from 5 m to 1 m with tilts around 5 degrees; return (poses, flipped poses from the third on)."""
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
    near, posed, wrong = stage(pad), 0, 0
    for index in range(frames):
        truth = approach.camera_T_pad(index / FPS)
        reading = near.read(Frame(index, index * 1_000_000_000 // FPS, photograph(truth, rng, pad=pad)))
        if reading.pose is not None:
            posed += 1
            wrong += posed > 3 and mirrored(reading.pose.camera_T_pad, truth)
    return posed, wrong


def test_no_pose_is_flipped() -> None:
    posed, wrong = flips(40, seed=1)
    assert (posed, wrong) == (40, 0)


@pytest.mark.full
def test_no_pose_is_flipped_in_a_thousand_frames() -> None:
    posed, wrong = flips(1000, seed=2)
    assert wrong == 0
    assert posed >= 999


def test_the_whole_frame_is_searched_only_when_nothing_is_known() -> None:
    near, rng = stage(), np.random.default_rng(0)
    image = photograph(view(3.0, 5.0, 1.0, 0.5), rng)
    searches = [near.read(Frame(i, i * 33_000_000, image)).search for i in range(3)]
    assert searches == ["frame", "region", "region"]


def test_a_picture_of_another_size_gives_tags_but_no_pose() -> None:
    image = photograph(view(2.0, 5.0, 1.0, 0.5), np.random.default_rng(0))[:, 40:]
    reading = stage().read(Frame(0, 0, np.ascontiguousarray(image)))
    assert len(reading.tags) == 1
    assert reading.pose is None
    assert "600x480" in reading.reason


def test_an_empty_picture_says_so() -> None:
    reading = stage().read(Frame(0, 0, np.full((480, 640, 3), 90, np.uint8)))
    assert (reading.tags, reading.pose, reading.reason) == ((), None, "no tag read")
