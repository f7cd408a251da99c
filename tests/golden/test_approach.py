"""The shipped landing, as video and as log, against its exact truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from landtool.config import TrackConfig, configured
from landtool.geometry import rotation_angle, rotation_from_quaternion
from landtool.io.tables import ReadTable, read_table
from landtool.run import RunOutcome, track

FIXTURES = Path(__file__).resolve().parents[2] / "datasets" / "fixtures"
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
TRUTH = {"frame": int, "t_ns": int} | {f"{p}_{c}": float for p in ("camera_T_pad", "world_T_pad") for c in POSE}
VIDEO = {
    "camera": FIXTURES / "approach.camera.yaml",
    "ego": str(FIXTURES / "approach.ego.csv"),
}


@pytest.fixture(scope="module")
def truth() -> ReadTable:
    return read_table(FIXTURES / "approach.truth.csv", TRUTH)


@pytest.fixture(scope="module", params=["approach.mp4", "approach.mcap"])
def outcome(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    config = configured(TrackConfig(), {"ego": VIDEO["ego"]} | (VIDEO if request.param.endswith("mp4") else {}))
    return track(FIXTURES / request.param, tmp_path_factory.mktemp("run") / "approach", config)


def columns(table: ReadTable, names: list[str]) -> np.ndarray:
    return np.column_stack([table.floats(name) for name in names])


def test_every_frame_is_measured(outcome: RunOutcome) -> None:
    assert outcome.exit_code == 0
    assert (outcome.summary.frames, outcome.summary.posed) == (120, 120)


def test_poses_agree_with_the_truth(outcome: RunOutcome, truth: ReadTable) -> None:
    poses = read_table(outcome.folder / "poses.csv")
    assert set(poses.texts("method")) == {"tag"}
    measured = columns(poses, list(POSE))
    exact = columns(truth, [f"camera_T_pad_{c}" for c in POSE])
    distance = np.linalg.norm(exact[:, :3], axis=1)
    error = np.linalg.norm(measured[:, :3] - exact[:, :3], axis=1) / distance
    assert np.median(error) < 0.002
    assert error.max() < 0.02
    turns = [
        rotation_angle(rotation_from_quaternion(a).T @ rotation_from_quaternion(b))
        for a, b in zip(measured[:, 3:], exact[:, 3:], strict=True)
    ]
    assert np.degrees(np.median(turns)) < 3.0
    assert np.degrees(np.max(turns)) < 6.0  # a mirrored pose is off by twice the tilt, up to 16 degrees here


def test_the_track_and_its_prediction_agree_with_the_truth(outcome: RunOutcome, truth: ReadTable) -> None:
    tracks = read_table(outcome.folder / "tracks.csv")
    assert set(tracks.ints("track_id")) == {1}
    assert set(tracks.texts("reference")) == {"world"}
    exact = columns(truth, ["world_T_pad_x_m", "world_T_pad_y_m"])
    off = np.linalg.norm(columns(tracks, ["x_m", "y_m"]) - exact, axis=1)
    assert off[30:].max() < 0.02
    ahead = columns(tracks, ["x_pred_m", "y_pred_m"])[30:-15] - exact[45:]
    assert np.sqrt(np.mean(np.sum(ahead**2, axis=1))) < 0.08


def test_times_are_the_recordings_own(outcome: RunOutcome, truth: ReadTable) -> None:
    assert read_table(outcome.folder / "frames.csv").ints("t_ns") == truth.ints("t_ns")


def test_the_region_is_searched_once_the_tag_is_held(outcome: RunOutcome) -> None:
    searches = read_table(outcome.folder / "frames.csv").texts("search")
    assert searches[0] == "frame"
    assert searches.count("frame") <= 2
