"""The shipped landing, as video and as log, against its exact truth."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.geometry import Array, Pose
from landtool.landing.memory import LOOK_ROUND_EVERY
from tests.golden.clip import POSE, TrackedClip, columns, poses_of, share_off, tracked

AHEAD = 15  # frames: the prediction's half second
# what a log needs is in it
ALONE = {"camera": None, "pad": None}


@pytest.fixture(scope="module", params=["mp4", "mcap"])
def clip(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> TrackedClip:
    return tracked("approach", tmp_path_factory.mktemp("run"), **(ALONE if request.param == "mcap" else {}))


def placed(clip: TrackedClip, reference: str) -> list[Pose]:
    """The poses of platform.csv in one of its frames of reference."""
    table = clip.table("platform")
    kept = [i for i, name in enumerate(table.texts("reference")) if name == reference]
    return [poses_of(table)[i] for i in kept]


def track_xy(clip: TrackedClip, *names: str) -> Array:
    return columns(clip.table("tracks"), list(names))


def as_the_drone_sees_itself(clip: TrackedClip) -> Array:
    """The pad's place (N, 3) in the world for one who measures without error and believes the drone's odometry."""
    body_T_pad = [
        body.inverse() @ pad
        for body, pad in zip(clip.true_poses("world_T_body"), clip.true_poses("world_T_pad"), strict=True)
    ]
    believed = [clip.ego.at(t_ns) for t_ns in clip.truth.ints("t_ns") if t_ns is not None]
    assert all(believed)
    return np.array([b.apply(p.translation) for b, p in zip(believed, body_T_pad, strict=True) if b is not None])


def test_every_frame_is_measured(clip: TrackedClip) -> None:
    assert clip.outcome.exit_code == 0
    assert (clip.outcome.summary.frames, clip.outcome.summary.posed) == (120, 120)


def test_poses_agree_with_the_truth(clip: TrackedClip) -> None:
    methods = clip.table("poses").texts("method")
    assert set(methods) <= {"tag", "target"}
    assert methods.count("tag") >= 0.95 * len(methods)
    errors = clip.position_errors()
    assert np.median(errors) < 0.001
    assert errors.max() < 0.008
    turns = [pose.angle_to(truth) for pose, truth in zip(
        clip.measured_poses.values(), clip.true_poses("camera_T_pad"), strict=True)]  # fmt: skip
    assert np.degrees(np.median(turns)) < 0.7
    assert np.degrees(np.max(turns)) < 3.0


def test_places_in_the_body_frame_owe_nothing_to_the_odometry(clip: TrackedClip) -> None:
    truth = zip(clip.true_poses("world_T_body"), clip.true_poses("world_T_pad"), strict=True)
    errors = [share_off(m, b.inverse() @ p) for m, (b, p) in zip(placed(clip, "body"), truth, strict=True)]
    assert np.median(errors) < 0.001
    assert np.max(errors) < 0.008


def test_places_in_the_world_are_off_as_the_odometry_is(clip: TrackedClip) -> None:
    measured = np.array([pose.translation for pose in placed(clip, "world")])
    distance = np.linalg.norm(columns(clip.truth, [f"camera_T_pad_{c}" for c in POSE[:3]]), axis=1)
    off = np.linalg.norm(measured - as_the_drone_sees_itself(clip), axis=1)
    assert np.median(off / distance) < 0.001
    assert (off / distance).max() < 0.008


def test_the_track_and_its_prediction_agree_with_the_truth(clip: TrackedClip) -> None:
    tracks = clip.table("tracks")
    assert set(tracks.ints("track_id")) == {1}
    assert set(tracks.texts("reference")) == {"world"}
    exact = columns(clip.truth, ["world_T_pad_x_m", "world_T_pad_y_m"])
    # the odometry's drift is no error of the tracker, its noise from frame to frame is what the tracker smooths
    drift = as_the_drone_sees_itself(clip)[:, :2] - exact
    off = np.linalg.norm(track_xy(clip, "x_m", "y_m") - exact - drift, axis=1)
    assert np.sqrt(np.mean(off[30:] ** 2)) < 0.02
    assert np.linalg.norm(track_xy(clip, "x_m", "y_m") - exact, axis=1)[30:].max() < 0.1
    ahead = track_xy(clip, "x_pred_m", "y_pred_m")[30:-AHEAD] - exact[30 + AHEAD :]
    assert np.sqrt(np.mean(np.sum(ahead**2, axis=1))) < 0.2


def test_times_are_the_recordings_own(clip: TrackedClip) -> None:
    assert clip.table("frames").ints("t_ns") == clip.truth.ints("t_ns")


def test_the_region_is_searched_once_the_tag_is_held(clip: TrackedClip) -> None:
    frames = clip.table("frames")
    searches, stages = frames.texts("search"), frames.texts("stage")
    assert searches[0] == "frame"
    near = [search for search, stage in zip(searches, stages, strict=True) if stage == "near"]
    # besides, a look around every so many frames for a pad nobody expects
    assert near.count("frame") <= 1 + len(near) // LOOK_ROUND_EVERY
    assert len(near) > 90
