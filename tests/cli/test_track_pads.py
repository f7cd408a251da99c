"""`landtool track` with drone poses, pads and cameras that lack something."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from landtool.io.tables import TABLES, read_table
from tests.cli.conftest import Track
from tests.cli.landing import APPROACH, TIMES_NS

CAM = ("--camera", "camera.yaml")


def write_ego(path: Path, times_ns: list[int], shift_ns: int = 0) -> None:
    lines = ["t_ns,x_m,y_m,z_m,qw,qx,qy,qz"]
    for t_ns in times_ns:
        pose, _ = APPROACH.pose_at(t_ns * 1e-9)
        lines.append(
            ",".join([str(t_ns + shift_ns), *map(repr, map(float, (*pose.translation, *pose.quaternion_wxyz)))])
        )
    path.write_text("\n".join(lines) + "\n")


def assert_only_numbers(folder: Path) -> None:
    for name in TABLES:
        for line in (folder / name).read_text().splitlines()[1:]:
            assert not {"nan", "inf", "-inf"} & set(line.lower().split(",")), f"{name}: {line}"


def test_a_gap_in_the_drones_poses(track: Track, here: Path) -> None:
    early = [t_ns for t_ns in range(0, 1_000_000_000, 20_000_000) if not 100_000_000 < t_ns < 900_000_000]
    write_ego(here / "ego.csv", early)
    assert track("clip.mp4", *CAM, "--ego", "ego.csv", "-o", "out").code == 0
    folder = here / "out/clip"
    assert_only_numbers(folder)
    reasons = read_table(folder / "frames.csv").texts("reason")
    inside = [100_000_000 < t_ns < 900_000_000 for t_ns in TIMES_NS]
    assert ["drone's own pose is not known" in reason for reason in reasons] == inside
    assert len(read_table(folder / "poses.csv").ints("frame")) == len(TIMES_NS)


def test_the_drones_poses_on_another_clock(track: Track, here: Path) -> None:
    write_ego(here / "ego.csv", list(range(0, 1_000_000_000, 20_000_000)), shift_ns=10**18)
    assert track("clip.mp4", *CAM, "--ego", "ego.csv", "-o", "out").code == 0
    folder = here / "out/clip"
    assert_only_numbers(folder)
    assert read_table(folder / "tracks.csv").ints("frame") == []
    assert len(read_table(folder / "poses.csv").ints("frame")) == len(TIMES_NS)
    reasons = read_table(folder / "frames.csv").texts("reason")
    assert "they are from 1000000000.000 to 1000000000.980 s, the frame is at 0.000 s" in reasons[0]
    assert all("drone's own pose is not known" in reason for reason in reasons)


def test_a_value_of_the_drones_pose_that_is_no_number(track: Track, here: Path) -> None:
    write_ego(here / "ego.csv", [0, 500_000_000])
    (here / "ego.csv").write_text((here / "ego.csv").read_text() + f"1000000000,{math.nan},0,2,1,0,0,0\n")
    told = track("clip.mp4", *CAM, "--ego", "ego.csv", "-o", "out")
    assert (told.code, told.out) == (1, "")
    assert told.err.startswith("landtool: error: ego.csv: line 4: ")
    assert told.err.count("\n") == 1


@pytest.mark.parametrize("part", ["ring", "letter", "board"])
def test_a_pad_file_without_a_part(part: str, track: Track, here: Path) -> None:
    (here / "pad.toml").write_text(f"{part} = false\n")
    told = track("clip.mp4", *CAM, "--pad", "pad.toml", "-o", "out")
    assert told.code == 0
    assert ("the pad has no ring" in told.err) == (part == "ring")
    assert_only_numbers(here / "out/clip")
    assert read_table(here / "out/clip/poses.csv").texts("method") == ["tag"] * len(TIMES_NS)


def test_a_camera_file_without_a_distortion_model(track: Track, here: Path) -> None:
    lines = (here / "camera.yaml").read_text().splitlines(keepends=True)
    (here / "bare.yaml").write_text("".join(line for line in lines if "distortion_model" not in line))
    told = track("clip.mp4", "--camera", "bare.yaml", "-o", "out")
    assert told.err.count("\n") == (0 if told.code == 0 else 1)
    assert told.code in (0, 1)
    if told.code == 0:
        assert_only_numbers(here / "out/clip")
    else:
        assert "distortion" in told.err
