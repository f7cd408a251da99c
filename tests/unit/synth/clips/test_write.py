"""Clips as files: whole or not at all, true to each other, the same bytes for the same request."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.errors import OutputExistsError, UsageError
from landtool.geometry import Pose
from landtool.io.calibration import read_camera
from landtool.io.mcap import McapSource
from landtool.io.mcap_build import McapSchema
from landtool.io.mcap_poses import read_poses
from landtool.io.poses import CSV_COLUMNS, read_ego
from landtool.io.tables import ReadTable, read_table
from landtool.io.video import VideoSource
from landtool.pad import PadSpec, Ring
from landtool.synth.clips import SCENARIOS, ClipConfig, side_files, write_clip
from landtool.synth.clips.tables import TRUTH_COLUMNS
from landtool.synth.clips.take import draw_take
from landtool.types import Frame, Image

SMALL = ClipConfig(duration_s=1.5, fps=Fraction(4), size=(96, 64), height_start_m=1.5, seed=4)
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


def pose(table: ReadTable, pair: str, row: int) -> Pose:
    values = [table.floats(f"{pair}_{name}")[row] for name in POSE]
    return Pose.from_quaternion(values[:3], values[3:])


def smooth(image: Image) -> np.ndarray:
    """Return a picture without the noise that JPEG and H.264, with half the colours' resolution, do not keep."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 2.0), dtype=np.float64)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clip") / "landing.one.mp4"
    calls: list[tuple[int, int]] = []
    report = write_clip(replace(SMALL, fog_beta=0.05), path, report=lambda *now: calls.append(now))
    assert calls == [(n, 6) for n in range(1, 7)]
    assert (report.path, report.frames, report.occluded) == (path, 6, 0)
    assert report.visible == 6
    assert set(report.files) == {path, *side_files(path).values()}
    return path


def test_all_files_lie_beside_each_other_and_nothing_else(clip: Path) -> None:
    names = ("camera.yaml", "ego.csv", "manifest.json", "mp4", "pad.toml", "truth.csv")
    assert sorted(p.name for p in clip.parent.iterdir()) == [f"landing.one.{name}" for name in names]


def test_truth_has_a_row_for_every_picture_at_its_very_time(clip: Path) -> None:
    frames = [frame for frame in VideoSource(clip) if isinstance(frame, Frame)]
    truth = read_table(side_files(clip)["truth.csv"], TRUTH_COLUMNS)
    assert truth.ints("frame") == list(range(6))
    assert truth.ints("t_ns") == [frame.t_ns for frame in frames] == [n * 250_000_000 for n in range(6)]
    assert set(truth.floats("beta_per_m")) == {0.05}
    assert {frame.image.shape for frame in frames} == {(64, 96, 3)}


def test_the_poses_of_the_truth_agree_with_each_other(clip: Path) -> None:
    truth = read_table(side_files(clip)["truth.csv"], TRUTH_COLUMNS)
    for row in range(len(truth)):
        camera_T_pad, world_T_pad, world_T_body, world_T_camera = (
            pose(truth, pair, row) for pair in ("camera_T_pad", "world_T_pad", "world_T_body", "world_T_camera")
        )
        composed = world_T_camera.inverse() @ world_T_pad
        assert camera_T_pad.translation == pytest.approx(composed.translation, abs=1e-7)
        assert camera_T_pad.angle_to(composed) < 1e-7
        mounted = world_T_body @ SMALL.body_T_camera
        assert world_T_camera.translation == pytest.approx(mounted.translation, abs=1e-7)
        assert world_T_camera.angle_to(mounted) < 1e-7


def test_the_corners_of_the_truth_are_those_its_poses_give(clip: Path) -> None:
    """But for the rolling shutter, which moves them by a few pixels at most."""
    truth, beside = read_table(side_files(clip)["truth.csv"], TRUTH_COLUMNS), side_files(clip)
    camera, pad = read_camera(beside["camera.yaml"]), PadSpec.read(beside["pad.toml"])
    assert pad == SMALL.pad
    for row in range(len(truth)):
        corners = np.array([truth.floats(f"{axis}{i}_px")[row] for i in range(4) for axis in "xy"]).reshape(4, 2)
        still = camera.project(pose(truth, "camera_T_pad", row).apply(pad.tag_corners_m(pad.tags[0])))
        assert np.abs(corners - still).max() < 3.0
        box = [truth.floats(name)[row] for name in ("x_min_px", "y_min_px", "x_max_px", "y_max_px")]
        assert -0.5 <= box[0] < box[2] <= 95.5
        assert -0.5 <= box[1] < box[3] <= 63.5


def test_the_drones_own_odometry_is_near_the_truth_and_around_the_clip(clip: Path) -> None:
    ego, truth = read_ego(side_files(clip)["ego.csv"]), read_table(side_files(clip)["truth.csv"], TRUTH_COLUMNS)
    assert side_files(clip)["ego.csv"].read_text().splitlines()[0] == ",".join(CSV_COLUMNS)
    assert ego.t_ns[0] < 0 < 1_250_000_000 < ego.t_ns[-1]
    for row, t_ns in enumerate(truth.ints("t_ns")):
        i = int(np.argmin(np.abs(ego.t_ns - (t_ns or 0))))
        off = ego.positions_m[i] - pose(truth, "world_T_body", row).translation
        assert 0.0 < np.linalg.norm(off) < 0.35


def test_the_manifest_has_the_request_the_versions_and_every_digest(clip: Path) -> None:
    manifest = json.loads(side_files(clip)["manifest.json"].read_text())
    assert manifest["config"]["scenario"] == "straight"
    assert manifest["config"]["fps"] == "4"
    assert manifest["seed"] == 4
    assert manifest["versions"]["numpy"]
    assert len(manifest["sha256"]) == 5
    for name, digest in manifest["sha256"].items():
        assert hashlib.sha256((clip.parent / name).read_bytes()).hexdigest() == digest
    assert str(clip.parent) not in side_files(clip)["manifest.json"].read_text()


def test_the_same_request_gives_the_same_bytes_and_another_seed_others(clip: Path, tmp_path: Path) -> None:
    config = replace(SMALL, fog_beta=0.05)
    write_clip(config, tmp_path / clip.name)
    for path in clip.parent.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name
    other = draw_take(replace(config, seed=5))
    assert not np.array_equal(other.flight.positions_m, draw_take(config).flight.positions_m)


def test_a_switch_changes_only_its_part() -> None:
    plain = draw_take(SMALL)
    for change in ({"vfr": True}, {"fog_beta": 0.2}, {"mcap_schema": "foxglove"}):
        other = draw_take(replace(SMALL, **change))  # type: ignore[arg-type]
        assert np.array_equal(other.flight.positions_m, plain.flight.positions_m)
        assert other.camera == plain.camera
        assert other.scene.still.sun == plain.scene.still.sun
    assert draw_take(replace(SMALL, vfr=True)).times_ns != plain.times_ns


@pytest.mark.parametrize("taken", ["mp4", "truth.csv", "ego.csv", "camera.yaml", "pad.toml", "manifest.json"])
def test_no_file_is_overwritten_unasked_and_nothing_is_drawn_then(
    tmp_path: Path, taken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"a.{taken}").write_text("mine")
    monkeypatch.setattr("landtool.synth.clips.write.draw_take", lambda _: pytest.fail("drawn all the same"))
    with pytest.raises(OutputExistsError, match="exists already"):
        write_clip(SMALL, tmp_path / "a.mp4")
    assert [p.name for p in tmp_path.iterdir()] == [f"a.{taken}"]
    assert (tmp_path / f"a.{taken}").read_text() == "mine"


def test_an_interrupted_clip_leaves_nothing(tmp_path: Path) -> None:
    def stop(done: int, _: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_clip(SMALL, tmp_path / "new" / "a.mp4", report=stop)
    assert not list(tmp_path.iterdir())


def test_overwriting_replaces_every_file(tmp_path: Path) -> None:
    for path in side_files(tmp_path / "a.mcap").values():
        path.write_text("old")
    write_clip(replace(SMALL, duration_s=1.0, height_start_m=1.0), tmp_path / "a.mcap", overwrite=True)
    assert all(path.read_text() != "old" for path in side_files(tmp_path / "a.mcap").values())


def test_a_variable_rate_is_kept_by_the_video(tmp_path: Path) -> None:
    config = replace(SMALL, vfr=True, fps=Fraction(8))
    write_clip(config, tmp_path / "a.mp4")
    stamps = [frame.t_ns for frame in VideoSource(tmp_path / "a.mp4")]
    assert stamps == read_table(tmp_path / "a.truth.csv", TRUTH_COLUMNS).ints("t_ns")
    assert len(set(np.diff([t or 0 for t in stamps]).tolist())) > 3


@pytest.mark.parametrize("schema", ["ros2", "foxglove"])
def test_a_log_reads_back_pictures_calibration_odometry_and_truth(tmp_path: Path, schema: McapSchema) -> None:
    config = replace(SMALL, mcap_schema=schema)
    path = tmp_path / "a.mcap"
    write_clip(config, path)
    truth = read_table(side_files(path)["truth.csv"], TRUTH_COLUMNS)
    stamps = truth.ints("t_ns")
    source = McapSource(path)
    frames = [frame for frame in source if isinstance(frame, Frame)]
    assert [frame.t_ns for frame in frames] == stamps
    assert source.info.camera == read_camera(side_files(path)["camera.yaml"])
    take = draw_take(config)
    drawn = [smooth(image) for image, _ in take.frames()]
    read = [smooth(frame.image) for frame in frames]
    # measured: 0.6 to 3.3 grey levels for a picture's own, 27 and more for another's; a shift of 0.6 by the conversions
    apart = np.array([[np.abs(one - other).mean() for other in read] for one in drawn])
    assert np.diag(apart).max() < 5.0
    assert apart[~np.eye(6, dtype=bool)].min() > 20.0
    assert abs(np.mean(drawn) - np.mean(read)) < 1.0
    own = {t_ns: take.odometry(t_ns).world_T_body for t_ns in take.times_ns}
    exact = {
        name: [pose(truth, name, row) for row in range(6)] for name in ("world_T_body", "world_T_pad", "camera_T_pad")
    }
    expected: dict[str, list[Pose]] = {
        "/drone/pose": list(own.values()),
        "/tf:map->base_link": exact["world_T_body"],
        "/tf:map->pad": exact["world_T_pad"],
        "/tf:base_link->camera_optical": [config.body_T_camera] * 6,
        "/truth/drone": exact["world_T_body"],
        "/truth/pad": exact["world_T_pad"],
        "/truth/pad_in_camera": exact["camera_T_pad"],
    }
    if schema == "ros2":
        expected["/drone/odometry"] = list(own.values())
    for topic, poses in expected.items():
        found = read_poses(path, topic)
        assert [t_ns for t_ns, _ in found] == stamps, topic
        for (_, ours), theirs in zip(found, poses, strict=True):
            assert ours.translation == pytest.approx(theirs.translation, abs=1e-7)
            assert ours.angle_to(theirs) < 1e-7


def test_something_hides_the_pad_when_it_should(tmp_path: Path) -> None:
    config = ClipConfig("occlusion", duration_s=5.0, fps=Fraction(8), size=(128, 96), height_start_m=5.0, seed=2)
    write_clip(config, tmp_path / "a.mp4")
    truth = read_table(tmp_path / "a.truth.csv", TRUTH_COLUMNS)
    hidden_s = json.loads((tmp_path / "a.manifest.json").read_text())["drawn"]["hidden_s"]
    t_s = np.array([(t or 0) / 1e9 for t in truth.ints("t_ns")])
    inside = (t_s > hidden_s[0]) & (t_s < hidden_s[1])
    outside = (t_s < hidden_s[0] - 0.6) | (t_s > hidden_s[1] + 0.6)
    assert inside.sum() >= 4
    assert truth.floats("visible_fraction")[inside].max() < 0.02
    assert all(
        truth.ints("occluded")[i] == 1 for i in np.flatnonzero(inside) if truth.columns["x_min_px"][i] is not None
    )
    assert truth.floats("hidden")[outside].max() < 0.2
    assert not any(truth.ints("occluded")[i] for i in np.flatnonzero(outside))


@pytest.mark.parametrize("scenario", list(SCENARIOS))
def test_every_scenario_can_be_photographed(scenario: Any) -> None:
    config = ClipConfig(scenario, duration_s=5.5, fps=Fraction(1), size=(96, 64), height_start_m=5.0, seed=1)
    seen = 0
    for image, truth in draw_take(config).frames():
        assert image.shape == (64, 96, 3)
        assert image.std() > 2.0
        seen += truth.visible_fraction > 0.2
    assert seen >= 3


def test_a_mounted_camera_swings_with_the_body() -> None:
    lever = Pose(SMALL.body_T_camera.rotation, np.array([0.3, -0.1, -0.2]))
    take = draw_take(replace(SMALL, scenario="turn", body_T_camera=lever, wind_mps=8.0))
    for t in (0.3, 0.8, 1.3):
        before, now, after = (take.view(t + s * 2e-4) for s in (-1.0, 0.0, 1.0))
        moved = (after.world_T_camera.translation - before.world_T_camera.translation) / 4e-4
        assert now.velocity_mps == pytest.approx(moved, abs=0.01)
        turned = (before.world_T_camera.inverse() @ after.world_T_camera).rotvec / 4e-4
        assert now.rate_radps == pytest.approx(turned, abs=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scenario": "loop"}, "unknown scenario 'loop'; known: straight, turn"),
        ({"duration_s": 0.0}, "duration_s = 0 is impossible; give 0.5 to 600"),
        ({"duration_s": float("nan")}, "duration_s = nan is impossible"),
        ({"fps": Fraction(0)}, "0 pictures a second are impossible"),
        ({"size": (95, 64)}, "a clip of 95x64 cannot be made; give even numbers"),
        ({"size": (8, 8)}, "a clip of 8x8 cannot be made"),
        ({"height_start_m": 0.5}, "height_start_m = 0.5 is impossible"),
        ({"fog_beta": -0.1}, "fog_beta = -0.1 is impossible"),
        ({"wind_mps": 30.0}, "wind_mps = 30 is impossible"),
        ({"hfov_deg": 170.0}, "hfov_deg = 170 is impossible"),
        ({"seed": -1}, "seed = -1 is negative"),
        ({"height_start_m": 20.0}, "1.5 s are too short to come down from 20 m; give at least"),
        ({"mcap_schema": "ros1"}, "unknown schema 'ros1'"),
        ({"pad": PadSpec(ring=None)}, "the pad has no ring"),
        ({"camera": Camera.from_hfov(64, 48, 70.0)}, "the camera is of 64x48 pictures, the clip of 96x64"),
        ({"scenario": "occlusion"}, "no room for an occlusion"),
    ],
)
def test_impossible_requests_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as refused:
        replace(SMALL, **change)
    assert message in str(refused.value)


def test_other_kinds_of_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"end its name in \.mp4 or \.mcap"):
        write_clip(SMALL, tmp_path / "a.avi")
    assert not list(tmp_path.iterdir())


def test_a_given_camera_and_pad_are_the_clips(tmp_path: Path) -> None:
    camera = Camera(96, 64, 80.0, 81.0, 47.0, 31.0)
    pad = PadSpec(name="other", diameter_m=0.8, ring=Ring(color=(20, 60, 200)))
    write_clip(replace(SMALL, camera=camera, pad=pad, height_start_m=1.4), tmp_path / "a.mp4")
    assert read_camera(tmp_path / "a.camera.yaml") == camera
    assert PadSpec.read(tmp_path / "a.pad.toml") == pad
