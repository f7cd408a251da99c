"""A landing of every scenario against its exact truth."""

from __future__ import annotations

import json

import numpy as np
import pytest

from landtool.geometry import Array
from landtool.synth.clips import SCENARIOS, SIDE_FILES
from tests.golden.clip import FIXTURES, TrackedClip, columns, share_off, tracked
from tests.scenes import mirrored

CLIPS = ("straight", "stop-and-go", "figure-eight", "heave", "hover-fog", "occlusion")
READABLE_PX = 20.0


@pytest.fixture(scope="module", params=CLIPS)
def clip(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> TrackedClip:
    return tracked(request.param, tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="module")
def hidden_clip(tmp_path_factory: pytest.TempPathFactory) -> TrackedClip:
    return tracked("occlusion", tmp_path_factory.mktemp("clip"))


def readable(clip: TrackedClip) -> Array:
    """Which frames (N,) show the tag and the white around it wholly and large enough."""
    corners = clip.true_corners_px()
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    # a module of white on every side, and a pixel of the picture beyond it
    margin = sides.max(axis=1)[:, None, None] / 8.0 + 1.0
    last = np.array([clip.camera.width - 1, clip.camera.height - 1])
    inside = ((corners >= margin) & (corners <= last - margin)).all(axis=(1, 2))
    return inside & (sides.min(axis=1) >= READABLE_PX) & (clip.truth.floats("hidden") == 0.0)


def test_every_scenario_is_there() -> None:
    manifests = [json.loads((FIXTURES / f"{name}.manifest.json").read_text()) for name in ("approach", *CLIPS)]
    assert {manifest["config"]["scenario"] for manifest in manifests} == set(SCENARIOS)
    assert all((FIXTURES / f"{name}.{ending}").exists() for name in CLIPS for ending in SIDE_FILES)


def test_every_readable_frame_is_measured(clip: TrackedClip) -> None:
    assert clip.outcome.exit_code == 0
    wanted = set(np.flatnonzero(readable(clip)).tolist())
    assert len(wanted) > 20
    assert wanted <= set(clip.measured_poses)


def test_poses_agree_with_the_truth(clip: TrackedClip) -> None:
    errors = clip.position_errors()
    assert np.median(errors) < 0.003
    # most of that is the rolling shutter, which the truth's single moment does not have
    same_shutter = [share_off(clip.measured_poses[frame], pose) for frame, pose in clip.poses_of_true_corners().items()]
    assert np.median(same_shutter) < 0.0015


def test_no_pose_is_the_mirror_image(clip: TrackedClip) -> None:
    truth = clip.true_poses("camera_T_pad")
    assert not [frame for frame, pose in clip.measured_poses.items() if mirrored(pose, truth[frame])]


def test_times_are_the_recordings_own(clip: TrackedClip) -> None:
    times = clip.truth.ints("t_ns")
    assert clip.table("frames").ints("t_ns") == times
    steps = np.diff(np.array(times, dtype=np.int64))
    # to the rounding of a nanosecond; the variable rate is that of one clip
    assert (np.ptp(steps) > 1e6) == (clip.name == "stop-and-go")


def test_the_track_coasts_behind_what_hides_the_pad_and_comes_back(hidden_clip: TrackedClip) -> None:
    hidden = np.flatnonzero(hidden_clip.truth.floats("occluded"))
    assert len(hidden) >= 10
    poses, tracks = hidden_clip.table("poses"), hidden_clip.table("tracks")
    by = dict(zip(poses.ints("frame"), poses.texts("method"), strict=True))
    state = dict(zip(tracks.ints("frame"), tracks.texts("state"), strict=True))
    # of what shows hardly a seventh of itself there is a box at the most, and with nothing in view no pose
    hid = hidden_clip.truth.floats("hidden")
    assert {by.get(frame, "box") for frame in np.flatnonzero(hid > 0.85).tolist()} == {"box"}
    blind = np.flatnonzero(hid > 0.9).tolist()
    assert len(blind) >= 10
    assert not set(blind) & set(by)
    assert {state[frame] for frame in blind} == {"coasting"}
    assert state[int(hidden[0]) - 3] == "confirmed"
    assert {state[f] for f in by if f is not None and f > blind[-1]} == {"confirmed"}
    # half covered the print is measured, or nothing is claimed of it but its box
    truth = hidden_clip.true_poses("camera_T_pad")
    by_print = {f: share_off(pose, truth[f]) for f, pose in hidden_clip.measured_poses.items() if by[f] != "box"}
    assert max(by_print.values()) < 0.03
    # one track from the first to the last, and it had drifted away by less than the pad's radius
    assert set(tracks.ints("track_id")) == {1}
    exact = columns(hidden_clip.truth, ["world_T_pad_x_m", "world_T_pad_y_m"])
    frames = [frame or 0 for frame in tracks.ints("frame")]
    off = np.linalg.norm(columns(tracks, ["x_m", "y_m"]) - exact[frames], axis=1)
    assert off[[state[f] == "coasting" for f in frames]].max() < 0.5 * hidden_clip.pad.diameter_m
