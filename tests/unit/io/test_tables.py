from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.geometry import Pose
from landtool.io.tables import TABLES, TableWriter, format_cell, read_rows, read_table
from landtool.types import Detection, FrameResult, PadPose, Prediction, TagObservation, Track

T_NS = 1_700_000_000_123_456_789  # a float cannot hold it


def full_result() -> FrameResult:
    corners = np.array([[10.5, 20.25], [30.0, 20.0], [30.0, 40.0], [10.0, 1 / 3]])
    covariance = np.diag([1.0, 4.0, 9.0, 0.01, 0.02, 0.06])
    quaternion = [-0.5, 0.5, -0.5, 0.5]  # w is negative on purpose
    return FrameResult(
        index=7,
        t_ns=T_NS,
        file='a "b", c.png',
        status="damaged",
        reason="two lines\r\nof text",
        haze=0.25,
        dehazed=True,
        stage="near",
        search="region",
        detections=(Detection("pad", 0.875, 1.0, 2.0, 3.0, 4.5), Detection("pad", 0.5, -0.5, 0.0, 9.0, 9.0)),
        tags=(TagObservation("tag36h11", 5, 1, 61.5, corners, 0.1),),
        pose=PadPose(Pose.from_quaternion([0.1, -0.2, 5.0], quaternion), covariance, "tag", 0.25, 0.125),
        body_T_pad=Pose.from_quaternion([1.0, 2.0, -3.0], quaternion),
        world_T_pad=Pose.from_quaternion([4.0, 5.0, 0.5], quaternion),
        tracks=(
            Track(
                3,
                "confirmed",
                "world",
                np.array([1.0, 2.0, 3.0, 4.0]),
                np.diag([0.1, 0.2, 0.3, 0.4]),
                None,
                0.5,
                np.array([2.5, 4.0]),
                (Prediction(1.0, np.array([4.0, 6.0]), np.diag([0.5, 0.25])),),
            ),
        ),
    )


# the header lines that programs outside rely on, letter by letter
HEADERS = {
    "detections.csv": "frame,t_ns,label,score,x_min_px,y_min_px,x_max_px,y_max_px",
    "tags.csv": "frame,t_ns,family,tag_id,hamming,margin,x0_px,y0_px,x1_px,y1_px,x2_px,y2_px,x3_px,y3_px",
    "poses.csv": "frame,t_ns,method,x_m,y_m,z_m,qw,qx,qy,qz,var_x_m2,var_y_m2,var_z_m2,var_rot_rad2,"
    "ambiguity,reproj_px",
    "platform.csv": "frame,t_ns,reference,x_m,y_m,z_m,qw,qx,qy,qz",
    "tracks.csv": "frame,t_ns,track_id,state,reference,x_m,y_m,vx_mps,vy_mps,var_x_m2,var_y_m2,var_vx,var_vy,nis,"
    "horizon_s,x_pred_m,y_pred_m",
    "predictions.csv": "frame,t_ns,track_id,reference,horizon_s,x_pred_m,y_pred_m,var_x_m2,var_y_m2",
    "frames.csv": "frame,t_ns,file,status,haze,dehazed,stage,search,reason",
}
ROWS = {
    "detections.csv": [f"7,{T_NS},pad,0.875,1,2,3,4.5", f"7,{T_NS},pad,0.5,-0.5,0,9,9"],
    "tags.csv": [f"7,{T_NS},tag36h11,5,1,61.5,10.5,20.25,30,20,30,40,10,0.333333333"],
    "poses.csv": [f"7,{T_NS},tag,0.1,-0.2,5,0.5,-0.5,0.5,-0.5,1,4,9,0.03,0.25,0.125"],
    "platform.csv": [f"7,{T_NS},body,1,2,-3,0.5,-0.5,0.5,-0.5", f"7,{T_NS},world,4,5,0.5,0.5,-0.5,0.5,-0.5"],
    "tracks.csv": [f"7,{T_NS},3,confirmed,world,1,2,3,4,0.1,0.2,0.3,0.4,,0.5,2.5,4"],
    "predictions.csv": [f"7,{T_NS},3,world,1,4,6,0.5,0.25"],
    "frames.csv": [f'7,{T_NS},"a ""b"", c.png",damaged,0.25,1,near,region,"two lines\r\nof text"'],
}


def write(path: Path, *results: FrameResult) -> Path:
    with TableWriter(path, TABLES[path.name]) as writer:
        for result in results:
            writer.write(result)
    return path


@pytest.mark.parametrize("name", sorted(TABLES))
def test_bytes_of_a_full_frame(tmp_path: Path, name: str) -> None:
    written = write(tmp_path / name, full_result()).read_bytes().decode()
    assert written == "\n".join([HEADERS[name], *ROWS[name]]) + "\n"


def test_every_table_is_covered() -> None:
    assert set(HEADERS) == set(TABLES)


@pytest.mark.parametrize("name", sorted(TABLES))
def test_nothing_known(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / name, FrameResult(0, None, file="a.png"))
    rows = ["0,,a.png,ok,,0,,,"] if name == "frames.csv" else []
    assert path.read_text().splitlines() == [HEADERS[name], *rows]
    assert write(tmp_path / "empty" / name).read_text() == HEADERS[name] + "\n"


@pytest.mark.parametrize("name", sorted(TABLES))
def test_reads_back_what_was_written(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / name, full_result(), FrameResult(8, None))
    table = read_table(path)
    assert list(table.columns) == HEADERS[name].split(",")
    assert table.ints("t_ns")[0] == T_NS
    with path.open(newline="") as file:
        reference = list(csv.DictReader(file))
    assert len(table) == len(reference)
    for row, expected in zip(read_rows(path), reference, strict=True):
        assert {key: format_cell(value).strip('"') for key, value in row.items()} == {
            key: format_cell(value).strip('"') for key, value in expected.items()
        }


def test_typed_columns(tmp_path: Path) -> None:
    frames = read_table(write(tmp_path / "frames.csv", full_result(), FrameResult(8, None)))
    np.testing.assert_array_equal(frames.floats("haze"), [0.25, np.nan])
    assert frames.ints("t_ns") == [T_NS, None]
    assert frames.texts("file") == ['a "b", c.png', ""]
    assert frames.texts("reason") == ["two lines\r\nof text", ""]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (math.nan, ""),
        (math.inf, ""),
        (-math.inf, ""),
        (-0.0, "0"),
        (float(np.float32(0.1)), "0.100000001"),
        (1e-12, "1e-12"),
        (-(2**63), "-9223372036854775808"),
        (np.int64(3), "3"),
        (True, "1"),
        ("", ""),
        ("a b", "a b"),
        ("a,b", '"a,b"'),
        ('"', '""""'),
        ("\r", '"\r"'),
    ],
)
def test_cells(value: int | float | str | None, text: str) -> None:
    assert format_cell(value) == text


def test_a_name_that_is_no_text_is_still_written(tmp_path: Path) -> None:
    path = write(tmp_path / "frames.csv", FrameResult(0, None, file="a\udcff.png"))
    assert read_table(path).texts("file") == ["a\\udcff.png"]


def test_refuses_an_existing_table_and_leaves_nothing_on_failure(tmp_path: Path) -> None:
    path = write(tmp_path / "frames.csv", FrameResult(0, None))
    before = path.read_text()
    with pytest.raises(OutputExistsError):
        write(path)
    writer = TableWriter(path, TABLES["frames.csv"], overwrite=True)
    with pytest.raises(ZeroDivisionError), writer:
        writer.write(FrameResult(1, 1 // 0))
    assert path.read_text() == before
    assert list(tmp_path.iterdir()) == [path]


HEADER = HEADERS["frames.csv"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty; its first line must name the columns frame"),
        (b"frame,t_ns\n", "line 1: not exactly one column file, status"),
        (f"{HEADER},frame\n".encode(), "line 1: not exactly one column frame"),
        (f"{HEADER}\n0,,,ok,,0,,,\n1,5,a.p".encode(), "line 3: 3 fields where the header has 9"),
        (f"{HEADER}\n0.5,,,ok,,0,,,\n".encode(), "line 2: frame '0.5' is not a whole number"),
        (f"{HEADER}\n1_0,,,ok,,0,,,\n".encode(), "line 2: frame '1_0' is not a whole number"),
        (f"{HEADER}\n0,,,ok,nan,0,,,\n".encode(), "line 2: haze 'nan' is not a finite number"),
        (f"{HEADER}\n0,,,ok,1e999,0,,,\n".encode(), "line 2: haze '1e999' is not a finite number"),
        (f"{HEADER}\n0,,,ok,x,0,,,\n".encode(), "line 2: haze 'x' is not a finite number"),
        (f'{HEADER}\n0,,"a"b,ok,,0,,,\n'.encode(), "line 2: "),
        (f'{HEADER}\n0,,"a,ok,,0,,,\n'.encode(), "line 2: unexpected end of data"),
        (b"\xff\xfe\x00", "is no UTF-8 text"),
        (bytes(300), "line 1: "),
    ],
)
def test_broken_files_name_file_and_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "frames.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_table(path)
    assert f"{path}: {message}" in str(caught.value)
    assert caught.value.hint


def test_reads_what_other_programs_make_of_it(tmp_path: Path) -> None:
    path = tmp_path / "frames.csv"
    text = f"extra,{HEADER}\n9,0,5,,ok,,0,,,\n\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert list(read_rows(path, {"t_ns": int, "frame": float})) == [{"t_ns": 5, "frame": 0.0}]


def test_paths_that_are_no_tables(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file"):
        read_table(tmp_path / "frames.csv")
    with pytest.raises(UsageError, match="known: detections"):
        read_table(tmp_path / "other.csv")
