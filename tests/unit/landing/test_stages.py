from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.stages import READABLE_PX, StageSwitch, altitude_m, readable_altitude_m
from landtool.pad import PadSpec, PadTag
from tests.scenes import CAMERA, PAD


def test_the_stage_follows_the_height_and_says_why() -> None:
    switch = StageSwitch(6.0)
    told = [(switch.at(height), switch.note) for height in (9.0, 6.5, 5.5, 5.3, 5.0, 6.5, 6.7)]
    assert [stage for stage, _ in told] == ["far", "far", "far", "near", "near", "near", "far"]
    assert [note for _, note in told if note] == [
        "near stage: 5.3 m high, below the switch at 6.0 m",
        "far stage: 6.7 m high, above the switch at 6.0 m",
    ]


def test_hovering_at_the_switch_stays_in_one_stage() -> None:
    switch = StageSwitch(6.0)
    switch.at(5.0)
    assert {switch.at(6.0 + 0.5 * math.sin(i)) for i in range(50)} == {"near"}


@pytest.mark.parametrize(("height_m", "stage"), [(5.9, "near"), (6.1, "far")])
def test_the_first_height_decides_without_hysteresis_and_without_a_word(height_m: float, stage: str) -> None:
    switch = StageSwitch(6.0)
    assert switch.at(None) == "far"
    assert (switch.at(height_m), switch.note) == (stage, "")


def test_an_unknown_height_changes_nothing() -> None:
    switch = StageSwitch(6.0)
    switch.at(7.0)
    switch.at(3.0)
    assert switch.note
    assert (switch.at(None), switch.note) == ("near", "")


def test_without_a_tag_the_stage_is_far() -> None:
    assert readable_altitude_m(CAMERA, PadSpec(tags=())) is None
    assert {StageSwitch(None).at(height) for height in (20.0, 1.0, None)} == {"far"}


@pytest.mark.parametrize("height_m", [0.0, -1.0, math.inf, math.nan])
def test_an_impossible_switch_is_refused(height_m: float) -> None:
    with pytest.raises(UsageError, match=r"a switch altitude of .* m is impossible"):
        StageSwitch(height_m)


def test_the_largest_tag_is_readable_at_the_default_switch() -> None:
    height_m = readable_altitude_m(CAMERA, PAD)
    assert height_m is not None
    assert CAMERA.fx * PAD.tag_size_m(PAD.tags[0]) / height_m == pytest.approx(READABLE_PX)
    # twice the pad, or one more tag of twice the size, is readable from twice as high
    both = PadSpec(tags=(PadTag(), PadTag(id=7, size=0.32, x=0.3)), quiet_zone=None, letter=None)
    assert readable_altitude_m(CAMERA, PAD.scaled(2.0)) == pytest.approx(2.0 * height_m)
    assert readable_altitude_m(CAMERA, both) == pytest.approx(2.0 * height_m)


def test_the_height_is_along_the_worlds_z_where_the_attitude_is_known() -> None:
    # the drone is banked by 30 degrees and sees the pad straight along its own z
    camera_T_pad = Pose(STRAIGHT_DOWN.rotation.T, np.array([0.0, 0.0, 10.0]))
    world_T_body = Pose(rotation_from_rotvec([math.radians(30.0), 0.0, 0.0]), np.array([3.0, 4.0, 50.0]))
    assert altitude_m(STRAIGHT_DOWN, camera_T_pad, None) == pytest.approx(10.0)
    assert altitude_m(STRAIGHT_DOWN, camera_T_pad, world_T_body) == pytest.approx(10.0 * math.cos(math.radians(30.0)))


def test_the_height_is_the_bodys_not_the_cameras() -> None:
    # the camera hangs 0.2 m below the body
    mount = Pose(STRAIGHT_DOWN.rotation, np.array([0.0, 0.0, -0.2]))
    camera_T_pad = Pose(STRAIGHT_DOWN.rotation.T, np.array([0.5, 0.0, 3.0]))
    assert altitude_m(mount, camera_T_pad, None) == pytest.approx(3.2)
