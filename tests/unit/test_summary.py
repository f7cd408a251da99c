from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from landtool.geometry import Pose
from landtool.summary import Summary
from landtool.target.tone_gauge import ToneEstimate
from landtool.tone import Tone
from landtool.types import Frame, FrameResult, LostFrame, PadPose
from tests.scenes import CAMERA, PAD


def result(index: int, *, pad_z_m: float = 0.0, altitude_m: float = 3.0) -> tuple[Frame | LostFrame, FrameResult]:
    pose = PadPose(Pose.from_rotvec([0.0, 0.0, altitude_m], [3.14, 0.0, 0.0]), np.eye(6), "target", 0.0, 0.1)
    world_T_pad = Pose(np.eye(3), np.array([0.0, 0.0, pad_z_m]))
    known = FrameResult(index, index, pose=pose, altitude_m=altitude_m, world_T_pad=world_T_pad, stage="near")
    return LostFrame(index, index, "no picture"), known


def notes(results: Iterable[tuple[Frame | LostFrame, FrameResult]]) -> str:
    summary = Summary(CAMERA, PAD)
    list(summary.watch(iter(results)))
    return "; ".join(summary.notes())


def test_a_pad_that_climbs_in_the_world_is_suspicious() -> None:
    assert "height in the world changes by 4.0 m" in notes(result(i, pad_z_m=float(i)) for i in range(5))
    assert "height" not in notes(result(i, pad_z_m=0.2 * i) for i in range(5))


def test_a_drone_below_its_pad_is_suspicious() -> None:
    assert "frames in which the drone is below the pad it looks down on: 2" in notes(
        result(i, altitude_m=-3.0) for i in range(2)
    )


@pytest.mark.parametrize(
    ("tone", "settled", "said"),
    [
        ("srgb", True, "sRGB's curve explains"),
        ("none", True, "--tone none uses it"),
        (1.8, True, "--tone 1.8 uses it"),
        (1.8, False, "not sure enough"),
    ],
)
def test_what_is_said_of_the_tone_curve(tone: Tone, settled: bool, said: str) -> None:
    told = ToneEstimate(1.83, 0.1, 0.7, 12, tone, settled)
    summary = Summary(CAMERA, PAD, tone=lambda: told)
    list(summary.watch(iter([result(0)])))
    (line,) = [line for line in summary.lines() if "tone curve" in line]
    assert said in line
    assert summary.facts(1.0)["tone"]["gamma"] == 1.83
    assert summary.facts(1.0)["lines"] == summary.lines()
