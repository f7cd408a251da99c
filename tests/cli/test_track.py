"""`landtool track` on recordings that are good: what it writes, says and returns."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.io.calibration import write_camera
from landtool.io.source import open_source
from landtool.io.tables import TABLES, read_table
from landtool.pad import PadSpec, PadTag
from tests.cli.conftest import Track
from tests.cli.landing import APPROACH, CAMERA, EPOCH_NS, TIMES_NS, Landing, snapshot

COUNT = len(TIMES_NS)
# design.md, section 3
COLUMNS = {
    "detections.csv": "frame,t_ns,label,score,x_min_px,y_min_px,x_max_px,y_max_px",
    "tags.csv": "frame,t_ns,family,tag_id,hamming,margin,x0_px,y0_px,x1_px,y1_px,x2_px,y2_px,x3_px,y3_px",
    "poses.csv": "frame,t_ns,method,x_m,y_m,z_m,qw,qx,qy,qz,var_x_m2,var_y_m2,var_z_m2,var_rot_rad2,"
    "ambiguity,reproj_px",
    "tracks.csv": "frame,t_ns,track_id,state,reference,x_m,y_m,vx_mps,vy_mps,var_x_m2,var_y_m2,var_vx,var_vy,nis,"
    "horizon_s,x_pred_m,y_pred_m",
    "frames.csv": "frame,t_ns,file,status,haze,dehazed,stage,search,reason",
}
CAM = ("--camera", "camera.yaml")


def times_of(path: Path) -> list[int | None]:
    return [frame.t_ns for frame in open_source(path)]


def places(folder: Path | str) -> np.ndarray:
    poses = read_table(Path(folder) / "poses.csv")
    return np.column_stack([poses.floats(name) for name in ("x_m", "y_m", "z_m")])


def record_of(folder: str) -> dict[str, object]:
    record: dict[str, object] = json.loads((Path(folder) / "run.json").read_text())
    return record


@pytest.fixture
def truth() -> np.ndarray:
    return np.array([APPROACH.camera_T_pad(t_ns * 1e-9).translation for t_ns in TIMES_NS])


def test_a_run_writes_every_file(track: Track, here: Path, truth: np.ndarray) -> None:
    before = snapshot(here)
    told = track("clip.mp4", *CAM)
    assert (told.code, told.err) == (0, "")
    folder = here / "runs" / "track" / "clip"
    assert {path.name for path in folder.iterdir()} == {*TABLES, "annotated.mp4", "track.png", "run.json"}
    for name, columns in COLUMNS.items():
        assert (folder / name).read_text().split("\n", 1)[0] == columns
    frames = read_table(folder / "frames.csv")
    assert frames.ints("frame") == list(range(COUNT))
    assert frames.ints("t_ns") == list(TIMES_NS) == times_of(folder / "annotated.mp4")
    assert frames.texts("status") == ["ok"] * COUNT
    assert frames.texts("stage") == ["near"] * COUNT
    assert np.abs(places(folder) - truth).max() < 0.02
    assert set(read_table(folder / "tracks.csv").texts("reference")) == {"body"}
    assert snapshot(here, without=["runs"]) == before


def test_a_run_says_what_it_found(track: Track) -> None:
    lines = track("clip.mp4", *CAM, "-o", "out").out.splitlines()
    assert lines[0] == "clip.mp4: out/clip"
    assert re.fullmatch(
        r"  landing: tracked from 2\.5 m to 2\.\d m without a gap over 0\.2 s, 0\.\d\d m off at the end", lines[1]
    )
    assert lines[2] == f"  frames {COUNT}: tag 100.0%"
    assert any(line.startswith("  track, frames by state: ") for line in lines)
    verdict = record_of("out/clip")["verdict"]
    assert isinstance(verdict, dict)
    assert (verdict["judgement"], verdict["frames_measured"]) == ("tracked", COUNT)
    assert verdict["first_lock_distance_m"] == pytest.approx(2.5, abs=0.02)


def test_the_record_tells_the_run_again(track: Track, here: Path) -> None:
    assert track("clip.mp4", *CAM, "-o", "out", "--horizon", "0.25").code == 0
    record = record_of("out/clip")
    assert record["command"] == "track"
    assert record["exit_code"] == 0
    declared = {"declared": COUNT, "decoded": COUNT, "damaged": 0, "lost": 0, "skipped": 0, "written": COUNT}
    assert record["counts"] == declared
    inputs = record["inputs"]
    assert isinstance(inputs, list)
    sums = snapshot(here)
    assert [(i["path"], i["sha256"]) for i in inputs] == [(name, sums[name]) for name in ("clip.mp4", "camera.yaml")]
    config, timings, versions = record["config"], record["timings"], record["versions"]
    assert isinstance(config, dict)
    assert (config["camera"], config["tracker"]["horizon_s"]) == ("camera.yaml", 0.25)
    assert isinstance(timings, dict)
    assert {"tags", "track", "write"} <= set(timings)
    assert isinstance(versions, dict)
    assert versions["landtool"]


def test_images_without_a_clock_have_poses_but_no_track(track: Track, landing: Landing, here: Path) -> None:
    landing.images(here / "shots")
    told = track("shots", *CAM, "-o", "out")
    assert (told.code, told.err) == (0, "")
    annotated = sorted((here / "out/shots/annotated").iterdir())
    assert [path.name for path in annotated] == [f"img{i}.png" for i in range(4)]
    drawn = cv2.imread(str(annotated[0]))
    assert drawn is not None
    assert drawn.shape == (CAMERA.height, CAMERA.width, 3)
    assert (drawn != landing.pictures[0]).any()
    frames = read_table(here / "out/shots/frames.csv")
    assert frames.ints("t_ns") == [None] * 4
    assert frames.texts("file") == [f"img{i}.png" for i in range(4)]
    assert len(places("out/shots")) == 4
    assert len(read_table(here / "out/shots/tracks.csv")) == 0


def test_images_get_a_clock(track: Track, landing: Landing, here: Path) -> None:
    landing.images(here / "shots")
    told = track("shots", *CAM, "-o", "out", "--fps", "29.97")
    assert (told.code, told.err) == (0, "")
    times_ns = [round(index * 100e9 / 2997) for index in range(4)]
    assert (
        read_table(here / "out/shots/frames.csv").ints("t_ns") == times_ns == times_of(here / "out/shots/annotated.mp4")
    )
    assert len(read_table(here / "out/shots/tracks.csv")) == 4


@pytest.mark.parametrize("schema", ["ros2", "foxglove"])
def test_a_log_brings_its_camera(schema: str, track: Track, landing: Landing, here: Path, truth: np.ndarray) -> None:
    landing.log(here / "flight.mcap", schema=schema)  # type: ignore[arg-type]
    told = track("flight.mcap", "-o", "out")
    assert told.code == 0
    assert len(told.lines) == 1
    assert "time 0 of the written video is 1700000000.000000000 s on the source's clock" in told.err
    assert read_table(here / "out/flight/frames.csv").ints("t_ns") == [EPOCH_NS + t_ns for t_ns in TIMES_NS]
    assert np.abs(places("out/flight") - truth).max() < 0.02


def ego_csv(path: Path, shift_ns: int = 0) -> None:
    rows = ["t_ns,x_m,y_m,z_m,qw,qx,qy,qz"]
    for t_ns in range(-(10**8), 10**9, 2 * 10**7):
        pose, _ = APPROACH.pose_at(t_ns * 1e-9)
        values = (*pose.translation, *pose.quaternion_wxyz)
        rows.append(",".join([str(t_ns + shift_ns), *(f"{value:.12g}" for value in values)]))
    path.write_text("\n".join(rows) + "\n")


def test_the_drone_s_own_poses_put_the_track_into_the_world(track: Track, here: Path) -> None:
    ego_csv(here / "ego.csv")
    told = track("clip.mp4", *CAM, "-o", "out", "--ego", "ego.csv")
    assert (told.code, told.err) == (0, "")
    tracks = read_table(here / "out/clip/tracks.csv")
    assert set(tracks.texts("reference")) == {"world"}
    t_s = np.array(TIMES_NS) * 1e-9
    assert np.abs(tracks.floats("x_m") - APPROACH.speed_mps * t_s)[4:].max() < 0.05
    assert abs(tracks.floats("vx_mps")[-1] - APPROACH.speed_mps) < 0.2


def test_own_poses_of_another_time_are_said(track: Track, here: Path) -> None:
    ego_csv(here / "ego.csv", shift_ns=EPOCH_NS)
    told = track("clip.mp4", *CAM, "-o", "out", "--ego", "ego.csv")
    assert told.code == 0
    assert f"not known at {COUNT} of the {COUNT} poses of the pad; check that --ego covers" in told.err


def test_all_tags_are_read_when_asked(track: Track, here: Path) -> None:
    # of a pad without a print only its tag tells where it is
    (here / "pad.toml").write_text(PadSpec(ring=None, letter=None, tags=(PadTag(id=7),)).to_toml())
    nowhere, without_pad = "(tag36h11 7) were read nowhere; --pad names another", "none gave a pose of the pad"
    for which, family, count, said in (
        ("pad", [], 0, nowhere),
        ("all", ["--family", "36h11"], COUNT, without_pad),
    ):
        told = track("clip.mp4", *CAM, "--pad", "pad.toml", "--tags", which, *family, "-o", which)
        assert told.code == 0
        assert said in told.err
        assert "the pad has no ring" in told.err
        assert told.err.count("\n") == 2
        assert read_table(here / which / "clip/tags.csv").ints("tag_id") == [5] * count
        assert len(places(here / which / "clip")) == 0


def test_the_print_is_measured_where_its_tag_is_another(track: Track, here: Path, truth: np.ndarray) -> None:
    (here / "pad.toml").write_text(PadSpec(tags=(PadTag(id=7),)).to_toml())
    assert track("clip.mp4", *CAM, "--pad", "pad.toml", "-o", "out").code == 0
    assert read_table(here / "out/clip/tags.csv").ints("tag_id") == []
    assert set(read_table(here / "out/clip/poses.csv").texts("method")) == {"target"}
    assert np.abs(places(here / "out/clip") - truth).max() < 0.02


def test_save_chooses_the_outputs(track: Track, here: Path) -> None:
    assert track("clip.mp4", *CAM, "-o", "out", "--save", "csv").code == 0
    assert {path.name for path in (here / "out/clip").iterdir()} == {*TABLES, "run.json"}
    assert track("clip.mp4", *CAM, "-o", "out", "--save", "video", "--overwrite").code == 0
    assert {path.name for path in (here / "out/clip").iterdir()} == {"annotated.mp4", "run.json"}


def test_options_win_over_the_settings_file(track: Track, here: Path) -> None:
    (here / "set").mkdir()
    write_camera(CAMERA.scaled(640, 480), here / "set/cam.yaml")
    text = 'camera = "cam.yaml"\nscale_intrinsics = true\nsave = ["csv"]\n[tracker]\nhorizon_s = 1.0\ncoast_s = 1.5\n'
    (here / "set/run.toml").write_text(text)
    assert track("clip.mp4", "--config", "set/run.toml", "--horizon", "0.25", "-o", "out").code == 0
    config = record_of("out/clip")["config"]
    assert isinstance(config, dict)
    assert (config["camera"], config["save"]) == ("set/cam.yaml", ["csv"])
    assert (config["tracker"]["horizon_s"], config["tracker"]["coast_s"]) == (0.25, 1.5)
    # a field of view stands in for the camera, so it takes the place of the file's
    told = track("clip.mp4", "--config", "set/run.toml", "--hfov", "60", "-o", "out2")
    assert told.code == 0
    assert told.err == "landtool: warning: clip.mp4: camera assumed: pinhole of 60 degrees horizontal field of view\n"
    assert "camera assumed: pinhole of 60 degrees" in told.out
    assert record_of("out2/clip")["notes"] == ["camera assumed: pinhole of 60 degrees horizontal field of view"]


def test_a_calibration_of_twice_the_size_is_scaled_when_asked(track: Track, here: Path, truth: np.ndarray) -> None:
    write_camera(CAMERA.scaled(640, 480), here / "large.yaml")
    told = track("clip.mp4", "--camera", "large.yaml", "--scale-intrinsics", "-o", "out")
    assert (told.code, told.err) == (0, "")
    assert np.abs(places("out/clip") - truth).max() < 0.02


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_turned_pictures_turn_the_intrinsics(degrees: int, track: Track, landing: Landing, here: Path) -> None:
    """Stored pictures and camera are turned; the display's turn makes both upright again."""
    landing.remuxed(here / "turned.mp4", rotation_deg=degrees)
    write_camera(CAMERA.rotated(degrees // 90), here / "turned.yaml")
    told = track("turned.mp4", "--camera", "turned.yaml", "-o", "out")
    assert told.code == 0
    assert "the intrinsics with them" in told.err
    assert track("clip.mp4", *CAM, "-o", "out").code == 0
    assert np.abs(places("out/turned") - places("out/clip")).max() < 0.01


def test_a_calibration_of_turned_pictures_is_taken_as_theirs(track: Track, landing: Landing, here: Path) -> None:
    landing.remuxed(here / "turned.mp4", rotation_deg=90)
    told = track("turned.mp4", *CAM, "-o", "out")
    assert (told.code, len(told.lines)) == (0, 1)
    assert "has the size of the turned pictures and is taken as theirs" in told.err
    assert track("clip.mp4", *CAM, "-o", "out").code == 0
    assert np.abs(places("out/turned") - places("out/clip")).max() < 0.01


def test_several_inputs_and_one_that_fails(track: Track, landing: Landing, here: Path) -> None:
    landing.images(here / "shots")
    (here / "text.mp4").write_text("no video")
    told = track("clip.mp4", "text.mp4", "shots", *CAM, "-o", "out", "--save", "csv")
    assert told.code == 3
    assert len(told.lines) == 1
    assert told.err.startswith("landtool: error: text.mp4: is no video that can be read")
    assert sorted(path.name for path in (here / "out").iterdir()) == ["clip", "shots"]
    assert "clip.mp4: out/clip\n" in told.out
    assert "shots: out/shots\n" in told.out


def test_a_bug_in_one_input_does_not_cost_the_others(
    track: Track, landing: Landing, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    landing.images(here / "shots", 2)

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("landtool.io.images.read_picture", broken)
    told = track("shots", "clip.mp4", *CAM, "-o", "out", "--save", "csv")
    assert told.code == 3
    bug = "internal error: ZeroDivisionError; run again with --debug to see where"
    assert told.lines == [f"landtool: error: shots: {bug}"]
    assert told.out.startswith("clip.mp4: out/clip\n")


def program(*args: str | bytes) -> subprocess.CompletedProcess[bytes]:
    start = [sys.executable, "-c", "from landtool_cli.main import main; main()", "track", *args]
    strict = os.environ | {"PYTHONIOENCODING": "utf-8:strict"}
    return subprocess.run(start, capture_output=True, env=strict, check=False)


def test_the_program_writes_the_same_tables_as_the_call(track: Track, here: Path) -> None:
    done = program("clip.mp4", *CAM, "-o", "out")
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(b"clip.mp4: out/clip\n")
    assert track("clip.mp4", *CAM, "-o", "again").code == 0
    for name in COLUMNS:  # the video shows how fast it was made
        assert (here / "out/clip" / name).read_bytes() == (here / "again/clip" / name).read_bytes()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux takes any bytes for a name")
def test_a_name_that_is_no_text_is_read(landing: Landing, here: Path) -> None:
    name = b"cl\xff p.mp4"
    (here / os.fsdecode(name)).write_bytes((here / "clip.mp4").read_bytes())
    folder = landing.images(here / "shots", 2)
    (folder / "img0.png").rename(folder / os.fsdecode(b"img\xff.png"))
    done = program(name, "shots", *CAM, "-o", "out")
    assert (done.returncode, done.stderr) == (0, b"")
    assert (here / "out" / os.fsdecode(b"cl\xff p") / "annotated.mp4").is_file()
    assert (here / "out/shots/annotated" / os.fsdecode(b"img\xff.png")).is_file()
