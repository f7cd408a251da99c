"""What truth.csv says of a generated picture, and what is said when it is broken."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.evaluate.stills_truth import read_stills_truth
from landtool.io.labels import read_yolo
from tests.shared import ROOT

STILLS = ROOT / "datasets" / "fixtures" / "stills"
LINES = (STILLS / "truth.csv").read_text().splitlines()
HEAD = LINES[0].split(",")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Return a truth.csv of two pictures, the first with a pad and the second without."""
    rows = [line.split(",") for line in LINES[1:]]
    with_pad = next(row for row in rows if row[2] == "1" and row[HEAD.index("x_min_px")])
    without = next(row for row in rows if row[2] == "0")
    for row in (with_pad, without):
        (tmp_path / row[0]).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(STILLS / row[0], tmp_path / row[0])
    return written(tmp_path / "truth.csv", [with_pad, without])


def written(path: Path, rows: list[list[str]]) -> Path:
    path.write_text("".join(",".join(row) + "\n" for row in [HEAD, *rows]))
    return path


def changed(path: Path, **cells: str) -> Path:
    """Change cells of the first row."""
    first, *others = (line.split(",") for line in path.read_text().splitlines()[1:])
    for name, value in cells.items():
        first[HEAD.index(name)] = value
    return written(path, [first, *others])


def test_every_picture_of_the_fixture_has_its_truth() -> None:
    truths = read_stills_truth(STILLS / "truth.csv")
    dataset = read_yolo(STILLS / "data.yaml")
    images = [image for split in dataset.splits for image in dataset.read(split)]
    assert sorted(truths) == sorted(image.path.relative_to(STILLS).as_posix() for image in images)
    for image in images:
        truth = truths[image.path.relative_to(STILLS).as_posix()]
        assert (truth.camera.width, truth.camera.height) == (image.width, image.height)
        for box in image.boxes:
            assert truth.present
            assert truth.camera_T_pad is not None
            side = max(box.x_max_px - box.x_min_px, box.y_max_px - box.y_min_px)
            assert truth.facts.size_px == pytest.approx(side, abs=1e-3)
            assert truth.facts.distance_m == pytest.approx(np.linalg.norm(truth.camera_T_pad.translation))
    assert {truth.present for truth in truths.values()} == {True, False}
    assert any((truth.facts.fog_per_m or 0.0) > 0.0 for truth in truths.values())


def test_the_pose_and_the_corners_are_of_the_same_pad() -> None:
    # the first tag's corners, seen by this camera from this pose, lie on the pad's plane within a metre of its centre
    for truth in read_stills_truth(STILLS / "truth.csv").values():
        if truth.camera_T_pad is None or truth.tag_corners_px is None:
            continue
        rays = truth.camera.unproject(truth.tag_corners_px)
        normal, place = truth.camera_T_pad.rotation[:, 2], truth.camera_T_pad.translation
        on_plane = rays * ((normal @ place) / (rays @ normal))[:, None]
        corners_m = truth.camera_T_pad.inverse().apply(on_plane)
        side = np.linalg.norm(corners_m[1] - corners_m[0])
        assert np.linalg.norm(corners_m, axis=1).max() < 1.0
        assert np.linalg.norm(corners_m[2] - corners_m[3]) == pytest.approx(side, rel=0.02)


def test_without_a_pad_nothing_is_said_of_it(table: Path) -> None:
    truth = list(read_stills_truth(table).values())[1]
    assert (truth.present, truth.camera_T_pad, truth.tag_corners_px, truth.visible_fraction) == (False, None, None, 0.0)
    facts = truth.facts
    assert (facts.distance_m, facts.size_px, facts.tilt_deg, facts.shadow) == (None, None, None, None)
    assert facts.fog_per_m is not None
    assert facts.blur_px is not None


@pytest.mark.parametrize(
    ("applied", "blur_px"),
    [
        ("", 0.0),
        ("psf_sigma_px=0.5", 0.5),
        ("defocus_radius_px=3", 1.5),
        ("motion_px=12", math.sqrt(12.0)),
        ("sky=clear psf_sigma_px=3 defocus_radius_px=8 motion_px=0 gamma=0.9", 5.0),
    ],
)
def test_blur_is_the_deviation_of_all_that_blurs(table: Path, applied: str, blur_px: float) -> None:
    truth = next(iter(read_stills_truth(changed(table, applied=applied)).values()))
    assert truth.facts.blur_px == pytest.approx(blur_px)


def test_tilt_is_between_the_normal_and_the_line_of_sight(table: Path) -> None:
    place = {f"camera_T_pad_{axis}_m": value for axis, value in zip("xyz", ("3", "0", "4"), strict=True)}
    turn = {f"camera_T_pad_q{axis}": value for axis, value in zip("wxyz", ("0", "1", "0", "0"), strict=True)}
    truth = next(iter(read_stills_truth(changed(table, **place, **turn)).values()))
    # the pad faces the camera's plane: the line of sight leans by atan(3 / 4)
    assert truth.facts.tilt_deg == pytest.approx(math.degrees(math.atan2(3.0, 4.0)))


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ({"present": "2"}, r"row 1 \(images/.*\): present is neither 0 nor 1"),
        ({"present": "x"}, "line 2: present 'x' is not a whole number"),
        ({"distance_m": "nan"}, "line 2: distance_m 'nan' is not a finite number"),
        ({"camera_T_pad_x_m": ""}, "row 1 .*: camera_T_pad_x_m is empty"),
        ({"x2_px": ""}, "row 1 .*: x2_px is empty"),
        ({"visible_fraction": ""}, "row 1 .*: visible_fraction is empty"),
        ({f"camera_T_pad_q{axis}": "0" for axis in "wxyz"}, "row 1 .*: a quaternion needs"),
        ({f"camera_T_pad_{axis}_m": "0" for axis in "xyz"}, "row 1 .*: the pad is where the camera is"),
        ({"fx_px": "0"}, "row 1 .*: focal length 0"),
        ({"applied": "psf_sigma_px=wide"}, "row 1 .*: applied: psf_sigma_px 'wide' is not a finite number"),
        ({"applied": "motion_px=inf"}, "row 1 .*: applied: motion_px 'inf'"),
        ({"file": ""}, r"row 1 \(no file\): it names no picture"),
    ],
)
def test_a_broken_row_is_named(table: Path, cells: dict[str, str], said: str) -> None:
    with pytest.raises(InputError, match=rf"truth\.csv: {said}"):
        read_stills_truth(changed(table, **cells))


def test_a_picture_named_twice(table: Path) -> None:
    table.write_text(table.read_text() + table.read_text().splitlines()[1] + "\n")
    with pytest.raises(InputError, match=r"row 3 .*: the picture is named twice"):
        read_stills_truth(table)


def test_a_cut_file(table: Path) -> None:
    table.write_text(table.read_text()[:-60])
    with pytest.raises(InputError, match=r"truth\.csv: line 3: .* the file may be cut"):
        read_stills_truth(table)


def test_another_table(table: Path) -> None:
    table.write_text("file,split\na,test\n")
    with pytest.raises(InputError, match=r"truth\.csv: line 1: not exactly one column present"):
        read_stills_truth(table)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"truth\.csv: No such file"):
        read_stills_truth(tmp_path / "truth.csv")


def test_no_rows(table: Path) -> None:
    assert read_stills_truth(written(table, [])) == {}


def test_no_picture_that_is_there(table: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    with pytest.raises(InputError, match="none of the pictures it names is there; keep it in the dataset's folder"):
        read_stills_truth(Path(shutil.copy(table, moved / "truth.csv")))
