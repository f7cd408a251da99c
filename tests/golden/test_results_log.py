"""`landtool track --save mcap,tum` on a shipped landing: as others read it, as its tables say, tracked once more."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from landtool.geometry import Array
from landtool.io.tables import ReadTable, read_table
from landtool_cli.main import run
from tests.golden.clip import FIXTURES, POSE, columns

NAME = "straight"
CORNERS = [f"{axis}{i}_px" for i in range(4) for axis in "xy"]
# a frame has one of each
EVERY_FRAME = (
    "/camera/image",
    "/camera/calibration",
    "/camera/annotations",
    "/landing/annotated",
    "/landing/scene",
    "/tf",
)


@dataclass(frozen=True, eq=False)
class Run:
    """A run's folder, and its log's messages by topic with their times."""

    folder: Path
    topics: dict[str, list[tuple[int, Any]]]

    def table(self, name: str) -> ReadTable:
        return read_table(self.folder / f"{name}.csv")


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("run")
    files = [f"--{kind}={FIXTURES / NAME}.{end}" for kind, end in (
        ("camera", "camera.yaml"), ("pad", "pad.toml"), ("ego", "ego.csv"))]  # fmt: skip
    save = ["--save", "csv,mcap,tum"]
    assert run(["track", str(FIXTURES / f"{NAME}.mp4"), *files, "-o", str(folder), *save]) == 0
    topics: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with (folder / NAME / "track.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages(log_time_order=False):
            topics[channel.topic].append((record.log_time, message))
    return Run(folder / NAME, topics)


def test_every_frame_has_its_messages_at_its_time(tracked: Run) -> None:
    times = tracked.table("frames").ints("t_ns")
    for topic in EVERY_FRAME:
        assert [time for time, _ in tracked.topics[topic]] == times, topic
    counts = {
        "/landing/pose": len(tracked.table("poses")),
        "/landing/track": len(set(tracked.table("tracks").ints("frame"))),
    }
    assert {topic: len(tracked.topics[topic]) for topic in counts} == counts
    assert len(times) == 60
    assert set(tracked.topics) == {*EVERY_FRAME, *counts, "/landing/status"}


def test_poses_are_the_tables(tracked: Run) -> None:
    logged = [
        (time, *(getattr(m.pose.position, c) for c in "xyz"), *(getattr(m.pose.orientation, c) for c in "wxyz"))
        for time, m in tracked.topics["/landing/pose"]
    ]
    poses = tracked.table("poses")
    assert [row[0] for row in logged] == poses.ints("t_ns")
    np.testing.assert_allclose([row[1:] for row in logged], columns(poses, list(POSE)), rtol=1e-8, atol=1e-12)


def test_marked_corners_are_the_tables_half_a_pixel_on(tracked: Run) -> None:
    tags = tracked.table("tags")
    corners = columns(tags, CORNERS).reshape(-1, 4, 2)
    marked = dict(tracked.topics["/camera/annotations"])
    for t_ns, wanted in zip(tags.ints("t_ns"), corners, strict=True):
        assert t_ns is not None
        loops = [np.array([(p.x, p.y) for p in line.points]) for line in marked[t_ns].points]
        assert any(len(loop) == 4 and np.abs(loop - wanted - 0.5).max() < 1e-5 for loop in loops), t_ns


def test_tracks_are_the_tables(tracked: Run) -> None:
    tracks = tracked.table("tracks")
    values = columns(tracks, ["x_m", "y_m", "vx_mps", "vy_mps"])
    times = np.array(tracks.ints("t_ns"), dtype=np.int64)
    for t_ns, odometry in tracked.topics["/landing/track"]:
        place, speed = odometry.pose.position, odometry.linear_velocity
        off = np.abs(values[times == t_ns] - [place.x, place.y, speed.x, speed.y]).max(axis=1)
        assert off.min() < 1e-6
        assert odometry.frame_id == "map"


def tum(path: Path) -> Array:
    """Read a TUM file as strictly as evo does: eight columns, single spaces, comments only by #."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    rows = [line.split(" ") for line in lines]
    assert {len(row) for row in rows} == {8}
    values = np.array(rows, dtype=np.float64)
    assert (np.diff(values[:, 0]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(values[:, 4:], axis=1), 1.0, atol=1e-8)
    return values


def test_trajectories_are_the_tables(tracked: Run) -> None:
    def rows(table: ReadTable, kept: list[int]) -> Array:
        times = np.array(table.ints("t_ns"), dtype=np.float64)[:, None] * 1e-9
        place, w, xyz = (columns(table, names) for names in (list(POSE[:3]), ["qw"], list(POSE[4:])))
        return np.hstack([times, place, xyz, w])[kept]

    poses, platform = tracked.table("poses"), tracked.table("platform")
    world = [i for i, name in enumerate(platform.texts("reference")) if name == "world"]
    np.testing.assert_allclose(
        tum(tracked.folder / "pad_in_camera.tum"), rows(poses, list(range(len(poses)))), rtol=1e-8, atol=1e-9
    )
    np.testing.assert_allclose(tum(tracked.folder / "pad_in_world.tum"), rows(platform, world), rtol=1e-8, atol=1e-9)
    drone = tum(tracked.folder / "drone_in_world.tum")
    exact = read_table(FIXTURES / f"{NAME}.ego.csv", {"t_ns": int, **dict.fromkeys(POSE, float)})
    own = np.array([np.interp(drone[:, 0], exact.floats("t_ns") * 1e-9, exact.floats(c)) for c in POSE[:3]]).T
    assert np.abs(drone[:, 1:4] - own).max() < 1e-6
    assert len(drone) == len(tracked.table("frames"))


def test_the_log_can_be_tracked_in_turn(tracked: Run, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    log = str(tracked.folder / "track.mcap")
    assert run(["info", log]) == 0
    told = capfd.readouterr().out
    assert "calibration /camera/calibration" in told
    pad, ego = f"--pad={FIXTURES / NAME}.pad.toml", "--ego=/tf:map->base_link"
    assert run(["track", log, "--topic", "/camera/image", pad, ego, "-o", str(tmp_path), "--save", "csv"]) == 0
    first, again = tracked.table("poses"), read_table(tmp_path / "track" / "poses.csv")
    places = (dict(zip(t.ints("t_ns"), columns(t, list(POSE[:3])), strict=True)) for t in (first, again))
    before, after = places
    both = sorted(set(before) & set(after), key=str)
    assert len(both) > 0.97 * len(before)
    off = [np.linalg.norm(before[t] - after[t]) / np.linalg.norm(before[t]) for t in both]
    assert np.median(off) < 0.0005
    assert set(read_table(tmp_path / "track" / "tracks.csv").texts("reference")) == {"world"}
