"""The truth of a clip as a file: what may be missing, what is refused, and which frame a row is about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.evaluate.clip_truth import read_clip_truth
from landtool.evaluate.facts import Facts
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from tests.golden.clip import FIXTURES
from tests.unit.evaluate.clips import CAMERA, FPS, SPEED_MPS, STEP_NS, true_frame, truth_of

POSE = ",".join(f"camera_T_pad_{name}" for name in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"))
BOX = "x_min_px,y_min_px,x_max_px,y_max_px"
AHEAD = "0,0,4,0,1,0,0"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "clip.truth.csv"


def refused(file: Path, text: str) -> str:
    file.write_text(text)
    with pytest.raises(InputError) as error:
        read_clip_truth(file)
    assert error.value.file == str(file)
    return error.value.reason


def test_a_generated_clips_truth_tells_everything() -> None:
    truth = read_clip_truth(FIXTURES / "approach.truth.csv")
    assert (len(truth.frames), truth.missing) == (120, ())
    frame = truth.at(60)
    assert frame is not None
    for name in ("camera_T_pad", "world_T_pad", "world_T_body", "velocity_mps", "box_px", "tag_corners_px"):
        assert getattr(frame, name) is not None
    assert (frame.index, frame.occluded, frame.beta_per_m) == (60, False, 0.0)
    facts = truth.facts(60)
    assert facts.distance_m == pytest.approx(np.linalg.norm(frame.camera_T_pad.translation))  # type: ignore[union-attr]
    assert facts.tilt_deg is not None
    assert 0.0 < facts.tilt_deg < 30.0
    box = truth.labelled(60, Path("60.png"), 640, 480).boxes[0]
    assert facts.size_px == max(box.x_max_px - box.x_min_px, box.y_max_px - box.y_min_px)


def test_the_truths_poses_put_the_first_tags_corners_where_it_says() -> None:
    frame = read_clip_truth(FIXTURES / "approach.truth.csv").at(60)
    assert frame is not None
    from landtool.io.calibration import read_camera

    camera, pad = read_camera(FIXTURES / "approach.camera.yaml"), PadSpec.read(FIXTURES / "approach.pad.toml")
    assert frame.camera_T_pad is not None
    corners = camera.project(frame.camera_T_pad.apply(pad.tag_corners_m(pad.tags[0])))
    assert np.abs(corners - frame.tag_corners_px).max() < 5.0  # what a rolling shutter makes


def test_what_is_missing_is_said_and_undefined(file: Path) -> None:
    file.write_text(f"frame,{BOX}\n3,10,20,50,40\n1,,,,\n")
    truth = read_clip_truth(file)
    assert [frame.index for frame in truth.frames] == [1, 3]
    assert truth.facts(3) == Facts(size_px=40.0)
    assert truth.labelled(1, Path("1.png"), 64, 48).boxes == ()
    assert truth.facts(2) == Facts()
    assert truth.at(2) is None
    with pytest.raises(KeyError):
        truth.labelled(2, Path("2.png"), 64, 48)
    assert any("no t_ns: velocities, lag, predictions" in said for said in truth.missing)
    assert any("no camera_T_pad" in said for said in truth.missing)
    motion = truth.motion("world", STRAIGHT_DOWN)
    assert motion.later_m(0, 0.5) is None
    assert np.isnan(motion.velocities_mps).all()


def test_without_boxes_no_frame_is_a_background(file: Path) -> None:
    file.write_text(f"frame,{POSE}\n0,{AHEAD}\n")
    truth = read_clip_truth(file)
    assert not truth.has_boxes
    with pytest.raises(KeyError):
        truth.labelled(0, Path("0.png"), 64, 48)


def test_without_numbers_frames_are_matched_by_their_times(file: Path) -> None:
    file.write_text(f"t_ns,{POSE}\n1000000000,{AHEAD}\n1050000000,{AHEAD}\n")
    truth = read_clip_truth(file)
    assert truth.row(7, 1_050_400_000) == 1
    assert truth.row(7, 1_020_000_000) is None
    assert truth.row(0) is None


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is empty"),
        (f"frame,{POSE}\n", "holds no frames"),
        (f"frame,{POSE}\n0,{AHEAD}\n1,{AHEAD[:5]}", "line 3: 4 fields"),
        (f"frame,{POSE}\n0,{AHEAD}\n1,{AHEAD}\n1,{AHEAD}\n", "line 4: frame 1 is there twice"),
        (f"t_ns,{POSE}\n5,{AHEAD}\n5,{AHEAD}\n", "line 3: t_ns 5 is there twice"),
        (f"frame,t_ns,{POSE}\n0,9,{AHEAD}\n1,8,{AHEAD}\n", "line 3: the time is not after"),
        (f"{POSE}\n{AHEAD}\n", "line 1: neither a column frame nor t_ns"),
        ("frame,t_ns\n0,0\n", "line 1: there are neither poses of the pad nor boxes"),
        ("frame,x_min_px,y_min_px\n0,1,2\n", "line 1: there is x_min_px, but not x_max_px, y_max_px"),
        (f"frame,{POSE}\n0,0,0,4,0,1,,0\n", "line 2: camera_T_pad_qy is empty"),
        (f"frame,{POSE}\n,{AHEAD}\n", "line 2: frame is empty"),
        (f"frame,{POSE}\n-1,{AHEAD}\n", "line 2: frame -1 is negative"),
        (f"frame,{POSE}\n0,0,0,4,0,2,0,0\n", "line 2: the quaternion of camera_T_pad"),
        (f"frame,{POSE}\n0,0,0,0,0,1,0,0\n", "line 2: the pad's centre is in the camera"),
        (f"frame,{POSE}\n0,0,0,nan,0,1,0,0\n", "line 2: camera_T_pad_z_m 'nan'"),
        (f"frame,{POSE}\n0.5,{AHEAD}\n", "line 2: frame '0.5'"),
        (f"frame,{BOX}\n0,50,20,10,40\n", "line 2: the box ends before it begins"),
        (f"frame,{BOX},visible_fraction\n0,5,20,10,40,7\n", "line 2: visible_fraction = 7 is no share"),
    ],
)
def test_a_broken_truth_is_refused_with_its_line(file: Path, text: str, reason: str) -> None:
    assert refused(file, text).startswith(reason)


def test_a_truth_that_is_not_there(file: Path) -> None:
    with pytest.raises(UsageError):
        read_clip_truth(file)


def test_later_places_lie_between_the_rows_and_end_with_the_clip() -> None:
    motion = truth_of(21).motion("world", STRAIGHT_DOWN)
    later = motion.later_m(2, 0.125)
    assert later == pytest.approx([SPEED_MPS * (2 / FPS + 0.125), 0.0])
    assert motion.later_m(20, 0.0) == pytest.approx([SPEED_MPS, 0.0])
    assert motion.later_m(20, 0.01) is None


def test_velocities_are_the_truths_own_in_the_world_and_slopes_in_the_body() -> None:
    told = np.array([9.0, 0.0, 0.0])
    truth = truth_of(5)
    lying = type(truth)(truth.path, tuple(true_frame(i, 0.1 * i, velocity_mps=told) for i in range(5)))
    assert lying.motion("world", STRAIGHT_DOWN).velocities_mps[:, 0] == pytest.approx([9.0] * 5)
    assert lying.motion("body", STRAIGHT_DOWN).velocities_mps == pytest.approx(np.tile([2.0, 0.0], (5, 1)))


def test_a_pad_is_measurable_when_it_is_wide_and_half_of_it_seen() -> None:
    pad = PadSpec()
    for height_m, changes, wanted in (
        (16.0, {}, True),
        (17.0, {}, False),
        (4.0, {"visible_fraction": 0.5}, False),
        (4.0, {"visible_fraction": None}, True),
    ):
        true = true_frame(0, 0.0, height_m, **changes).pad(CAMERA)
        assert true is not None
        assert true.measurable(pad) is wanted
    aside = true_frame(0, 9.0, 4.0, visible_fraction=None).pad(CAMERA)
    assert aside is not None
    assert not aside.visible


def test_times_since_1970_keep_their_steps() -> None:
    start = 1_790_000_000_000_000_000
    truth = type(truth_of(1))(
        Path("t"), tuple(true_frame(i, 0.1 * i, t_ns=start + i * STEP_NS) for i in range(4))
    )  # fmt: skip
    assert truth.motion("body", STRAIGHT_DOWN).velocities_mps[:, 0] == pytest.approx([2.0] * 4, rel=1e-4)
