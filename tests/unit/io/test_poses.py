"""The drone's poses and the camera's mount as files, good and bad."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN, EgoPoses, read_ego, read_mount

HEADER = "t_ns,x_m,y_m,z_m,qw,qx,qy,qz\n"
CSV = HEADER + "1700000000123456789,1,2,3,1,0,0,0\n1700000000223456789,1.5,-2,3e0,0.6,0,0,0.8\n"
TUM = """\
# timestamp tx ty tz qx qy qz qw
1700000000.123456789 1 2 3 0 0 0 1

1700000000.223456789   1.5 -2 3e0  0 0 0.8 0.6
"""


def put(tmp_path: Path, content: str | bytes) -> Path:
    file = tmp_path / "poses.dat"
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return file


@pytest.mark.parametrize(
    "text",
    [
        CSV,
        "\ufeff" + CSV.replace("\n", "\r\n"),
        CSV.replace(",", ", "),
        "# made by hand\n\n" + CSV,
        "\n".join(f"{i},{line}" for i, line in enumerate(CSV.splitlines())),  # another column is no harm
        TUM,
        TUM.replace(" ", "\t").replace("#\ttimestamp", "# timestamp"),
    ],
)
def test_both_formats_are_read_to_the_nanosecond(text: str, tmp_path: Path) -> None:
    ego = read_ego(put(tmp_path, text))
    assert ego.t_ns.tolist() == [1700000000123456789, 1700000000223456789]
    np.testing.assert_array_equal(ego.positions_m, [[1, 2, 3], [1.5, -2, 3]])
    np.testing.assert_allclose(ego.quaternions_wxyz, [[1.0, 0.0, 0.0, 0.0], [0.6, 0.0, 0.0, 0.8]], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [("-0.5", -500_000_000), ("0", 0), ("1.7e9", 1_700_000_000_000_000_000), ("0.0000000014", 1)],
)
def test_tum_seconds(text: str, t_ns: int, tmp_path: Path) -> None:
    assert read_ego(put(tmp_path, f"{text} 0 0 0 0 0 0 1\n")).t_ns.tolist() == [t_ns]


def test_columns_may_stand_in_any_order_and_quaternions_be_rounded(tmp_path: Path) -> None:
    half = float(np.sqrt(0.5))
    ego = read_ego(put(tmp_path, "qz,qw,qx,qy,z_m,y_m,x_m,t_ns\n-0.707,0.707,0,0,3,2,1,5\n"))
    np.testing.assert_allclose(ego.quaternions_wxyz, [[half, 0.0, 0.0, -half]])
    np.testing.assert_array_equal(ego.positions_m, [[1, 2, 3]])


GOOD = "1,0,0,0,1,0,0,0\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "holds no poses"),
        ("# only a comment\n", "holds no poses"),
        (HEADER, "holds no poses"),
        (b"\x89PNG\r\n\xff", "is no text"),
        (GOOD, "line 1: needs one column 't_ns'"),
        (HEADER.replace("qw,", "") + GOOD, "line 1: needs one column 'qw'"),
        (HEADER.replace("qx", "qw") + GOOD, "line 1: needs one column 'qw'"),
        (HEADER + GOOD + "2,0,0,0,1,0,0\n", "line 3: 7 columns where 8"),
        (HEADER + GOOD + "2,0,0,0,1,0,0,0,0\n", "line 3: 9 columns where 8"),
        (HEADER + "\n# note\n" + GOOD + "2,0,,0,1,0,0,0\n", "line 5: '' is no number"),
        (HEADER + GOOD + "2,0,nan,0,1,0,0,0\n", "line 3: a value is not a finite number"),
        (HEADER + GOOD + "2,0,0,0,inf,0,0,0\n", "line 3: a value is not a finite number"),
        (HEADER + GOOD + "2,0,0,0,nan,0,0,0\n", "line 3: a value is not a finite number"),
        (HEADER + GOOD + "2,0,0,0,0,0,0,0\n", "line 3: the quaternion is not of length 1"),
        (HEADER + GOOD + "2,0,0,0,2,0,0,0\n", "line 3: the quaternion is not of length 1"),
        (HEADER + GOOD + "1,0,0,0,1,0,0,0\n", "line 3: the time of the line before is repeated"),
        (HEADER + GOOD + "0,0,0,0,1,0,0,0\n", "line 3: the time is before"),
        (HEADER + "1.5,0,0,0,1,0,0,0\n", "line 2: t_ns '1.5' is no whole number"),
        (HEADER + f"{2**63},0,0,0,1,0,0,0\n", "line 2: the time 9223372036854775808 ns is too large"),
        ("1 0 0 0 0 0 0\n", "line 1: 7 columns where 8"),
        ("just some words\n", "line 1: 3 columns where 8"),
        ("t x y z qx qy qz qw\n", "line 1: 'x' is no number"),
        ("t 0 0 0 0 0 0 1\n", "line 1: the time 't' is no number"),
        ("nan 0 0 0 0 0 0 1\n", "line 1: the time 'nan' is not finite"),
        ("1e999999 0 0 0 0 0 0 1\n", "line 1: the time '1e999999' is not finite or too large"),
        ("1 0 0 0 0 0 0 1\n1.0000000001 0 0 0 0 0 0 1\n", "line 2: the time of the line before is repeated"),
    ],
)
def test_the_wrong_line_is_named(content: str | bytes, said: str, tmp_path: Path) -> None:
    file = put(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_ego(file)
    assert str(caught.value).startswith(f"{file}: {said}")
    assert caught.value.hint


def test_poses_that_come_from_no_file_are_checked_too() -> None:
    turn = [[1.0, 0, 0, 0]] * 2
    with pytest.raises(InputError, match="pose 2: the time is before"):
        EgoPoses(np.array([5, 4]), np.zeros((2, 3)), np.array(turn))
    with pytest.raises(ValueError, match="2 stamps, 1 positions"):
        EgoPoses(np.array([5, 6]), np.zeros((1, 3)), np.array(turn))
    with pytest.raises(ValueError, match="read-only"):
        EgoPoses(np.array([5, 6]), np.zeros((2, 3)), np.array(turn)).t_ns[0] = 1


MOUNT = "[body_T_camera]\ntranslation_m = [0.1, 0, -0.05]\nquaternion_wxyz = [0, 0.7071, -0.7071, 0]\n"


def test_mount(tmp_path: Path) -> None:
    body_T_camera = read_mount(put(tmp_path, MOUNT))
    np.testing.assert_array_equal(body_T_camera.translation, [0.1, 0.0, -0.05])
    assert body_T_camera.angle_to(STRAIGHT_DOWN) < 1e-9


def test_straight_down_has_its_axes_where_the_conventions_say() -> None:
    # image right is body right (-y), image down is backwards (-x), the view is down (-z)
    np.testing.assert_array_equal(STRAIGHT_DOWN.apply(np.eye(3)), [[0, -1, 0], [-1, 0, 0], [0, 0, -1]])
    assert np.linalg.det(STRAIGHT_DOWN.rotation) == pytest.approx(1.0)
    # a nod of the camera, its image top still forward, looks ahead of the drone
    nodded = Pose(STRAIGHT_DOWN.rotation @ rotation_from_rotvec([0.3, 0, 0]), np.zeros(3))
    assert nodded.rotation[0, 2] > 0.2


@pytest.mark.parametrize(
    ("content", "said", "hint"),
    [
        ("", "holds no table [body_T_camera]", "quaternion_wxyz"),
        ("body_T_camera = 5", "holds no table [body_T_camera]", "quaternion_wxyz"),
        (MOUNT.replace("body_T_camera", "body_t_camera"), "unknown key 'body_t_camera'", "'body_T_camera'"),
        (MOUNT.replace("_wxyz", "_xyzw"), "unknown key 'body_T_camera.quaternion_xyzw'", "quaternion_wxyz'"),
        (MOUNT.replace("translation_m = [0.1, 0, -0.05]\n", ""), "translation_m must be 3", "give"),
        (MOUNT.replace("-0.05", "nan"), "translation_m must be 3 finite", "give"),
        (MOUNT.replace("-0.05", "true"), "translation_m must be 3 finite", "give"),
        (MOUNT.replace(", -0.05", ""), "translation_m must be 3 finite", "give"),
        (MOUNT.replace("0.7071", "0.5"), "not of length 1", "w first"),
        ("[body_T_camera", "no valid TOML", "give"),
        (b"\xff\xfe", "no valid TOML", "give"),
    ],
)
def test_a_wrong_mount_is_refused(content: str | bytes, said: str, hint: str, tmp_path: Path) -> None:
    file = put(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_mount(file)
    assert said in caught.value.reason
    assert hint in caught.value.hint
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_a_wrong_request(tmp_path: Path) -> None:
    for read in (read_ego, read_mount):
        for path in (tmp_path / "none", tmp_path):
            with pytest.raises(UsageError) as caught:
                read(path)
            assert str(path) in str(caught.value)
