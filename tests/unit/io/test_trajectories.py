"""TUM files: exact times, eight columns, rising."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from landtool.errors import OutputExistsError
from landtool.geometry import Pose
from landtool.io.poses import read_ego
from landtool.io.trajectories import TumWriter

EPOCH_NS = 1_700_000_000_123_456_789


def pose_at(n: int) -> Pose:
    return Pose.from_rotvec((1.0 + n, -2.0, 3.5e-7), (0.1, 0.05 * n, -0.4))


def test_lines_have_eight_columns_and_exact_times(tmp_path: Path) -> None:
    with TumWriter(tmp_path / "a.tum", ("the pad",)) as writer:
        for n in range(3):
            writer.write(EPOCH_NS + n, pose_at(n))
    text = (tmp_path / "a.tum").read_bytes().decode("ascii")
    assert text.endswith("\n")
    first, second, *rows = text.splitlines()
    assert (first, second) == ("# the pad", "# t_s tx_m ty_m tz_m qx qy qz qw")
    for n, row in enumerate(rows):
        cells = row.split(" ")
        assert len(cells) == 8
        assert cells[0] == f"1700000000.{123_456_789 + n:09d}"
        place, quaternion = np.array(cells[1:4], float), np.array(cells[4:], float)
        np.testing.assert_allclose(place, pose_at(n).translation, rtol=1e-8)
        np.testing.assert_allclose(quaternion, np.roll(pose_at(n).quaternion_wxyz, -1), rtol=1e-8)
    assert len(rows) == 3


def test_read_back_as_the_drones_own_poses(tmp_path: Path) -> None:
    with TumWriter(tmp_path / "a.tum") as writer:
        for n in range(4):
            writer.write(EPOCH_NS + n * 33_333_333, pose_at(n))
    ego = read_ego(tmp_path / "a.tum")
    assert ego.t_ns.tolist() == [EPOCH_NS + n * 33_333_333 for n in range(4)]
    np.testing.assert_allclose(ego.positions_m, [pose_at(n).translation for n in range(4)], rtol=1e-8)


def test_the_first_of_one_time_counts_and_times_rise(tmp_path: Path) -> None:
    with TumWriter(tmp_path / "a.tum") as writer:
        for n, t_ns in enumerate((5, 5, 4, 7)):
            writer.write(t_ns, pose_at(n))
    ego = read_ego(tmp_path / "a.tum")
    assert ego.t_ns.tolist() == [5, 7]
    assert ego.positions_m[:, 0].tolist() == [1.0, 4.0]
    assert writer.left_out == 2


@pytest.mark.parametrize(
    ("t_ns", "text"),
    [(0, "0.000000000"), (-1, "-0.000000001"), (-1_500_000_000, "-1.500000000"), (999_999_999, "0.999999999")],
)
def test_times_to_the_nanosecond(tmp_path: Path, t_ns: int, text: str) -> None:
    with TumWriter(tmp_path / "a.tum") as writer:
        writer.write(t_ns, Pose.identity())
    assert (tmp_path / "a.tum").read_text().splitlines()[-1] == f"{text} 0 0 0 0 0 0 1"


def test_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(AttributeError), TumWriter(tmp_path / "a.tum") as writer:
        writer.write(1, None)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "a.tum").write_text("mine")
    with pytest.raises(OutputExistsError), TumWriter(tmp_path / "a.tum"):
        pytest.fail("the block must not run")
    assert (tmp_path / "a.tum").read_text() == "mine"
