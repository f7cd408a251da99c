"""`landtool eval`: what it says, its exit codes, its settings, and one line for whatever is wrong."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from landtool.io.calibration import camera_yaml
from landtool.run import detection, evaluation, tracking
from landtool_cli.main import run
from tests.cli.conftest import Told
from tests.cli.landing import CAMERA, Landing, cut, snapshot
from tests.evaluated import COUNT, add_clip, add_stills, write_truth

Eval = Callable[..., Told]
Make = Callable[[Landing, Path], object]
QUICK = ("--stages", "detection", "--every", "7", "--dehaze", "off")
_once = cache(detection.load_detector)


@pytest.fixture(autouse=True)
def _networks_are_loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for user in (evaluation, tracking):
        monkeypatch.setattr(user, "load_detector", _once)


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Eval:
    """Return a function that calls `landtool eval` in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def told(*args: str) -> Told:
        capfd.readouterr()
        code = run(["eval", *args])
        return Told(code, *capfd.readouterr())

    return told


def file(name: str, text: str) -> Make:
    """Return what writes a file beside data/, in which there are two labelled pictures."""

    def make(landing: Landing, here: Path) -> None:
        add_stills(landing, here / "data")
        (here / name).write_text(text)

    return make


def stills(landing: Landing, here: Path) -> None:
    add_stills(landing, here / "data")


def clip(landing: Landing, here: Path) -> None:
    add_clip(landing, here / "data")


def clip_without(end: str) -> Make:
    return lambda landing, here: add_clip(landing, here / "data").with_name(f"a.{end}").unlink()


def clip_with(end: str, text: str) -> Make:
    return lambda landing, here: add_clip(landing, here / "data").with_name(f"a.{end}").write_text(text)


def cut_picture(landing: Landing, here: Path) -> None:
    cut(add_stills(landing, here / "data") / "images/0.png", 0.5)


def label(text: str) -> Make:
    return lambda landing, here: (add_stills(landing, here / "data") / "labels/0.txt").write_text(text)


def old_output(landing: Landing, here: Path) -> None:
    stills(landing, here)
    (here / "out").mkdir()
    (here / "out/metrics.json").write_text("{}")


def settings(text: str) -> Make:
    return file("s.toml", text)


class TestWhatItSays:
    def test_numbers_on_stdout_and_notes_on_stderr(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        write_truth(add_clip(landing, tmp_path / "data").with_name("a.truth.csv"), frames=range(COUNT + 2))
        told = call("--dataset", "data", "--dehaze", "off", "--every", "7")
        assert told.code == 0
        first, *lines = told.out.splitlines()
        assert first == "data: runs/eval"
        assert any(line.startswith("  boxes: targets found") and line.endswith(" 1, 2 of 2") for line in lines)
        assert any(line.startswith("  dehazing") and line.endswith("undefined, 0 of 0") for line in lines)
        assert told.lines == [
            f"landtool: warning: a: frames of the truth that the recording does not have: 2 of {COUNT + 2}"
        ]
        assert {path.name for path in (tmp_path / "runs/eval").iterdir()} == {
            "metrics.json", "metrics.csv", "boxes.csv", "pose_errors.csv", "tag_errors.csv", "track_errors.csv",
            "prediction_errors.csv", "dehaze_errors.csv", "runs",
        }  # fmt: skip
        for path in (tmp_path / "runs").rglob("*.csv"):
            assert "nan" not in path.read_text().lower()

    @pytest.mark.parametrize("make", [lambda _, here: (here / "data").mkdir(), clip_without("truth.csv")])
    def test_nothing_to_evaluate_with(self, make: Make, call: Eval, landing: Landing, tmp_path: Path) -> None:
        make(landing, tmp_path)
        told = call("--dataset", "data", "-o", "out")
        assert told.code == 3
        assert told.lines[-1] == (
            "landtool: warning: data: nothing to evaluate with was found: every number is undefined, 0 of 0"
        )
        rows = told.out.splitlines()[1:]
        assert rows
        assert all(row.endswith("undefined, 0 of 0") for row in rows)

    def test_quiet_says_the_numbers_alone(self, call: Eval, tmp_path: Path) -> None:
        (tmp_path / "data").mkdir()
        told = call("--dataset", "data", "-q")
        assert (told.code, told.err) == (3, "")

    def test_any_name(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        data = tmp_path / 'my landing\'s "7" ü'
        add_clip(landing, data, "flug 1 'ü'")
        (tmp_path / "link").symlink_to(data)
        for given in (data.name, "link"):
            told = call("--dataset", given, "--stages", "track", "--dehaze", "off", "-o", "o ü", "--overwrite")
            assert (told.code, told.err) == (0, "")
            assert (tmp_path / "o ü/runs/flug 1 'ü'/tracks.csv").is_file()

    def test_a_part_that_fails(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        add_clip(landing, tmp_path / "data")
        add_clip(landing, tmp_path / "data", "b").with_name("b.ego.csv").write_text("x,y\n")
        told = call("--dataset", "data", "--stages", "pose", "--junit", "new/j.xml", "--dehaze", "off")
        assert told.code == 3
        (line,) = told.lines
        assert line.startswith("landtool: warning: b was not scored: data/b.ego.csv: line 1: ")
        cases = ElementTree.parse(tmp_path / "new/j.xml").getroot().iter("testcase")
        assert [(case.get("name"), [child.tag for child in case]) for case in cases] == [("a", []), ("b", ["error"])]
        assert call("--dataset", "data", "--stages", "pose", "--no-ego", "--dehaze", "off", "-o", "o").code == 0


class TestGate:
    def test_from_the_first_baseline_to_a_failure(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        stills(landing, tmp_path)
        args = ("--dataset", "data", *QUICK, "--baseline", "kept/b.json", "--overwrite")
        told = call(*args)
        assert told.err.startswith("landtool: error: kept/b.json: does not exist; ")
        assert "--update-baseline" in told.err
        told = call(*args, "--update-baseline")
        assert (told.code, told.err) == (0, "")
        assert told.out.endswith("baseline: kept/b.json\n")
        told = call(*args)
        assert (told.code, told.err) == (0, "")
        assert told.out.splitlines()[-1].startswith("gate: passed, none of ")
        told = call(*args, "--conf", "1", "--junit", "j.xml")
        assert told.code == 1
        assert told.lines == ["landtool: warning: the baseline was made with other settings"]
        assert any(line.startswith("gate: failed, ") for line in told.out.splitlines())
        assert any(line.split()[0] == "detection.recall" for line in told.out.splitlines())
        assert int(ElementTree.parse(tmp_path / "j.xml").getroot().get("failures", "")) > 0
        ignored = ("speed.*", "detection.mean_iou", "detection.precision", "detection.recall")
        (tmp_path / "t.toml").write_text("".join(f'["{pattern}"]\nignore = true\n' for pattern in ignored))
        told = call(*args, "--conf", "1", "--tolerance", "t.toml")
        assert told.code == 0
        assert "gate: passed, none of " in told.out

    def test_a_baseline_of_another_version_is_compared(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        stills(landing, tmp_path)
        args = ("--dataset", "data", *QUICK, "--baseline", "b.json", "--overwrite")
        assert call(*args, "--update-baseline").code == 0
        values = json.loads((tmp_path / "b.json").read_text())
        values |= {"landtool": "0.0.1", "dataset": "0" * 64}
        (tmp_path / "b.json").write_text(json.dumps(values))
        told = call(*args)
        assert told.code == 0
        assert told.lines[0].startswith("landtool: warning: the baseline is of landtool 0.0.1, this is ")
        assert told.lines[1].startswith("landtool: warning: the baseline is of other data: ")

    def test_what_is_missing_is_gone(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        stills(landing, tmp_path)
        args = (*QUICK, "--baseline", "b.json", "--overwrite")
        assert call("--dataset", "data", *args, "--update-baseline").code == 0
        (tmp_path / "empty").mkdir()
        told = call("--dataset", "empty", *args)
        assert told.code == 1
        assert any(line.split() == ["detection.recall", "1", "undefined", "gone"] for line in told.out.splitlines())


class TestSettings:
    TOML = """
        dehaze = "off"
        detector.conf = 0.5
        [eval]
        dataset = "data"
        stages = ["detection"]
        baseline = "b.json"
        """

    def test_a_file_has_a_table_of_its_own(
        self, call: Eval, landing: Landing, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        add_clip(landing, tmp_path / "sub/data")
        (tmp_path / "sub/s.toml").write_text(self.TOML)
        told = call("--config", "sub/s.toml", "--every", "7", "--update-baseline")
        assert (told.code, told.err) == (0, "")
        assert told.out.startswith("sub/data: runs/eval\n")
        assert (tmp_path / "sub/b.json").is_file(), "it lies beside the file that names it"
        config = json.loads((tmp_path / "runs/eval/metrics.json").read_text())["config"]
        assert config["track"]["detector"]["conf"] == 0.5
        assert (config["eval"]["every"], config["eval"]["stages"]) == (7, ["detection"])
        assert call("--config", "sub/s.toml", "--every", "7", "--overwrite").out.splitlines()[-1].startswith("gate: pa")
        camera = ["--camera", "sub/data/a.camera.yaml"]
        assert run(["track", "sub/data/a.mp4", *camera, "--config", "sub/s.toml", "-o", "t"]) == 0, capfd.readouterr()

    def test_a_calibration_of_another_size(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        clip_with("camera.yaml", camera_yaml(CAMERA.scaled(640, 480)))(landing, tmp_path)
        args = ("--dataset", "data", "--stages", "pose", "--dehaze", "off")
        assert "; pass --scale-intrinsics if" in call(*args).err
        assert call(*args, "--scale-intrinsics").code == 0

    def test_a_field_of_view_stands_in_for_a_calibration(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        clip_without("camera.yaml")(landing, tmp_path)
        told = call("--dataset", "data", "--stages", "pose", "--dehaze", "off", "--hfov", "56.1")
        assert told.code == 0
        assert told.err.startswith("landtool: warning: a: camera assumed: ")


class TestOutput:
    def test_it_is_replaced_only_when_asked_for(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        stills(landing, tmp_path)
        args = ("--dataset", "data", *QUICK, "-o", "out")
        assert call(*args).code == 0
        assert call(*args).err == "landtool: error: out: exists already; choose another -o or pass --overwrite\n"
        assert call(*args, "--overwrite").code == 0

    def test_what_it_wrote_is_no_data_later(self, call: Eval, landing: Landing, tmp_path: Path) -> None:
        add_clip(landing, tmp_path / "data")
        args = ("--stages", "track", "--save", "video", "--dehaze", "off", "-o", "data/out")
        assert call("--dataset", "data/a.mp4", *args).code == 0
        assert (tmp_path / "data/out/runs/a/annotated.mp4").is_file()
        told = call("--dataset", "data", *QUICK, "-o", "out")
        assert (told.code, told.err) == (0, "")

    @pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
    def test_ctrl_c_leaves_nothing(self, landing: Landing, tmp_path: Path) -> None:
        landing.video(add_clip(landing, tmp_path / "data"), times=60)
        before = snapshot(tmp_path)
        start = [sys.executable, "-c", "from landtool_cli.main import main; main()", "eval", "--dataset", "data"]
        with subprocess.Popen(
            [*start, "--junit", "j.xml", "--baseline", "b.json", "--update-baseline"],
            cwd=tmp_path,
            stderr=subprocess.PIPE,
        ) as process:
            while not list(tmp_path.glob("runs/.landtool-*/runs/.landtool-*/*")):
                assert process.poll() is None, "it ended before it was told to"
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60)
        assert process.returncode == 130
        assert err == b"landtool: error: interrupted; outputs not finished were removed\n"
        assert snapshot(tmp_path) == before


# what there is, what is typed after `landtool eval`, the exit code, and the line
BAD: dict[str, tuple[Make, str, int, str]] = {
    "no dataset": (stills, "", 2, "no dataset to evaluate with; give it with --dataset DIR"),
    "wrong path": (stills, "--dataset dta", 2, "dta: does not exist; did you mean data?"),
    "URL": (stills, "--dataset https://example.org/x", 2, "https://example.org/x: is no local file; "),
    "device": (stills, "--dataset /dev/null", 2, "/dev/null: is no plain file or folder; "),
    "recording without truth": (
        clip_without("truth.csv"),
        "--dataset data/a.mp4",
        2,
        "data/a.mp4: has no truth beside",
    ),
    "a truth": (clip, "--dataset data/a.truth.csv", 2, "data/a.truth.csv: is a truth; give the recording it is about"),
    "truth in half": (
        lambda landing, here: cut(add_clip(landing, here / "data").with_name("a.truth.csv"), 0.53),
        "--dataset data",
        1,
        "data/a.truth.csv: line ",
    ),
    "recording without frames": (clip_with("mp4", ""), "--dataset data", 1, "data/a.mp4: is empty; "),
    "no camera": (clip_without("camera.yaml"), "--dataset data", 2, "data/a.mp4: no camera calibration; pass --camera"),
    "broken camera": (clip_with("camera.yaml", "fx: 1\n"), "--dataset data", 1, "data/a.camera.yaml: "),
    "camera of another size": (
        clip_with("camera.yaml", camera_yaml(CAMERA.scaled(640, 480))),
        "--dataset data",
        1,
        "data/a.camera.yaml: the calibration is for 640x480, the images are 320x240; pass --scale-intrinsics if",
    ),
    "broken pad": (
        clip_with("pad.toml", "diamter_m = 1\n"),
        "--dataset data",
        1,
        "data/a.pad.toml: unknown key 'diamter",
    ),
    "broken picture": (cut_picture, "--dataset data", 1, "data/images/0.png: cannot be decoded ("),
    "class that is not there": (
        label("3 0.5 0.5 0.1 0.1\n"),
        "--dataset data",
        1,
        "data/labels/0.txt: line 1: class 3 is",
    ),
    "both cameras": (
        clip,
        "--dataset data --camera data/a.camera.yaml --hfov 60",
        2,
        "--camera and --hfov exclude each",
    ),
    "no such camera": (stills, "--dataset data --camera cam.yaml", 2, "cam.yaml: does not exist; "),
    "no such network": (stills, "--dataset data --model net.onnx", 2, "net.onnx: does not exist; "),
    "no network": (file("net.onnx", "hello"), "--dataset data --model net.onnx", 1, "net.onnx: is "),
    "unknown stage": (
        stills,
        "--dataset data --stages detction",
        2,
        "unknown stage 'detction'; known: detection, pose",
    ),
    "unknown output": (stills, "--dataset data --save vidoe", 2, "unknown output 'vidoe'; known: csv, video"),
    "unknown split": (stills, "--dataset data --split tset", 2, "invalid value for '--split': 'tset' is not one of"),
    "every 0": (stills, "--dataset data --every 0", 2, "invalid value for '--every': 0 is not in the range"),
    "conf nan": (stills, "--dataset data --conf nan", 2, "invalid value for '--conf': nan is not in the range"),
    "update of nothing": (stills, "--dataset data --update-baseline", 2, "no baseline to update; say where it is"),
    "no baseline": (stills, "--dataset data --baseline b.json", 2, "b.json: does not exist; "),
    "broken baseline": (file("b.json", "{"), "--dataset data --baseline b.json", 1, "b.json: is no baseline: "),
    "baseline of another format": (
        file("b.json", '{"format_version": 7}'),
        "--dataset data --baseline b.json",
        1,
        "b.json: was written for format 7, this is 1; make it again with --update-baseline",
    ),
    "something else as baseline": (
        file("b.json", "[]"),
        "--dataset data --baseline b.json --update-baseline",
        2,
        "b.json: is no baseline, and would be replaced by one; choose another name, or remove it",
    ),
    "tolerance alone": (
        file("t.toml", ""),
        "--dataset data --tolerance t.toml",
        2,
        "a tolerance, but no numbers to compare with; give them with --baseline FILE",
    ),
    "tolerance with an unknown key": (
        file("t.toml", '["track.*"]\nabsolut = 1\n'),
        "--dataset data --baseline b.json --tolerance t.toml",
        1,
        "t.toml: unknown key 'track.*: absolut'; nearest known key is 'track.*: absolute'",
    ),
    "junit is a folder": (
        stills,
        "--dataset data --junit data",
        2,
        "data: is a folder, a file is to be written; choose another --junit",
    ),
    "junit under a file": (
        file("a.txt", ""),
        "--dataset data --junit a.txt/j.xml",
        1,
        "a.txt/j.xml: cannot be written: File exists; a part of the path is a file; choose another --junit",
    ),
    "output exists": (old_output, "--dataset data", 2, "out: exists already; choose another -o or pass --overwrite"),
    "output is the data": (stills, "--dataset data -o data", 2, "data: is the input itself, which is never changed; "),
    "output in the data": (stills, "--dataset data -o data/out", 2, "data/out: lies in the input data; choose an -o"),
    "output holds the data": (stills, "--dataset data/data.yaml -o data --overwrite", 2, "data: holds the input data/"),
    "settings with an unknown key": (
        settings("[eval]\nstage = 1\n"),
        "--dataset data --config s.toml",
        1,
        "s.toml: unknown key 'eval.stage'; nearest known key is 'eval.stages'",
    ),
    "settings with an unknown table": (
        settings("[evl]\n"),
        "--dataset data --config s.toml",
        1,
        "s.toml: unknown key 'evl'; nearest known key is 'eval'",
    ),
    "settings of another type": (
        settings("[eval]\nevery = '2'\n"),
        "--dataset data --config s.toml",
        1,
        "s.toml: 'eval.every' must be a whole number, not '2'",
    ),
    "settings out of bounds": (
        settings("[eval]\nalarm_conf = 2\n"),
        "--dataset data --config s.toml",
        2,
        "s.toml: alarm_conf = 2 is impossible; give 0 to 1",
    ),
    "settings without a table": (
        settings("eval = 3\n"),
        "--dataset data --config s.toml",
        1,
        "s.toml: 'eval' must be a",
    ),
}


@pytest.mark.parametrize(("make", "typed", "code", "line"), BAD.values(), ids=list(BAD))
def test_one_line_and_nothing_left(
    make: Make, typed: str, code: int, line: str, call: Eval, landing: Landing, tmp_path: Path
) -> None:
    make(landing, tmp_path)
    before = snapshot(tmp_path)
    args = typed.split() + ([] if "-o" in typed.split() else ["-o", "out"])
    told = call(*args)
    assert told.lines == [told.err.strip()]
    assert told.err.startswith(f"landtool: error: {line}")
    assert told.code == code
    assert told.out == ""
    assert snapshot(tmp_path) == before


def test_help_names_every_stage(call: Eval) -> None:
    told = call("--help")
    assert told.code == 0
    assert "detection, pose, track, dehaze" in " ".join(told.out.split())


def test_the_current_folder_as_data(call: Eval, landing: Landing, tmp_path: Path) -> None:
    add_stills(landing, tmp_path)
    told = call("--dataset", ".", *QUICK)
    assert told.err.startswith("landtool: error: runs/eval: lies in the input .; choose an -o outside of it")
    out = tmp_path.parent / f"{tmp_path.name}-out"
    assert call("--dataset", ".", *QUICK, "-o", str(out)).code == 0
    shutil.rmtree(out)
