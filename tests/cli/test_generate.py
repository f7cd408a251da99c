"""`landtool generate` from the outside: what it makes, says, refuses, and how it takes an interruption."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.config import GenerateConfig, configured
from landtool.errors import InputError, UsageError
from landtool.io.labels import read_yolo
from landtool.pad import PadSpec, PadTag
from landtool.synth.dataset import write as write_module
from landtool_cli.main import run
from tests.unit.synth.dataset import plain

Said = pytest.CaptureFixture[str]
SMALL = ["--size", "96x64", "--no-preview", "--jobs", "1"]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, in which pictures cost nothing to draw."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(write_module, "_draw", lambda: plain.draw)
    return tmp_path


@pytest.mark.usefixtures("here")
def test_says_what_it_made_and_where(capsys: Said) -> None:
    assert run(["generate", "images", "-o", "data", "-n", "20", *SMALL]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.splitlines() == [
        "data: 20 images of 96x64, 13 with the pad, 7 without",
        "  train 16, val 2, test 2",
        "  labels: data/data.yaml (YOLO), data/annotations (COCO)",
        "  truth: data/truth.csv",
    ]
    assert sum(1 for split in ("train", "val", "test") for _ in read_yolo(Path("data/data.yaml")).read(split)) == 20


@pytest.mark.usefixtures("here")
def test_twins_in_clear_air(capsys: Said) -> None:
    assert run(["generate", "images", "-o", "data", "-n", "6", "--clear", *SMALL]) == 0
    assert "  in clear air, too: data/clear, 4 images in fog" in capsys.readouterr().out.splitlines()
    names = {path.relative_to("data/clear") for path in Path("data/clear").rglob("*.jpg")}
    assert len(names) == 4
    assert all((Path("data/images") / name).exists() for name in names)


@pytest.mark.usefixtures("here")
def test_speed_goes_to_stderr(capsys: Said) -> None:
    assert run(["generate", "images", "-o", "data", "-n", "3", *SMALL, "-v"]) == 0
    assert "3 images in " in capsys.readouterr().err


def test_a_picture_sheet_of_real_pictures(tmp_path: Path, capsys: Said) -> None:
    folder = tmp_path / "data"
    assert run(["generate", "images", "-o", str(folder), "-n", "2", "--size", "160x120", "--jobs", "1"]) == 0
    assert f"  to look at: {folder / 'preview.png'}, {folder / 'statistics.png'}" in capsys.readouterr().out
    manifest = json.loads((folder / "manifest.json").read_text())
    assert {"preview.png", "statistics.png", "truth.csv"} < set(manifest["files"])
    assert run(["generate", "preview", str(folder), "-o", str(tmp_path / "seen")]) == 0
    assert capsys.readouterr().out.splitlines() == [str(tmp_path / f"seen/{n}.png") for n in ("preview", "statistics")]


@pytest.mark.usefixtures("here")
def test_a_settings_file_and_options_that_win_over_it() -> None:
    Path("pads").mkdir()
    Path("pads/mine.toml").write_text(PadSpec(diameter_m=0.5).to_toml())
    Path("pads/set.toml").write_text(
        'n = 4\nseed = 7\nsize = [96, 64]\nsplit = [0.5, 0.5]\npad = "mine.toml"\njobs = 1\npreview = false\n'
        "[domain]\nheight_m = [1, 2.5]\nfog = 0\n"
    )
    assert run(["generate", "images", "-o", "data", "--config", "pads/set.toml", "--seed", "8"]) == 0
    manifest = json.loads(Path("data/manifest.json").read_text())
    assert (manifest["n"], manifest["seed"], manifest["split"]) == (4, 8, {"train": 0.5, "val": 0.5})
    assert (manifest["domain"]["height_m"], manifest["domain"]["fog"]) == ([1.0, 2.5], 0.0)
    assert PadSpec.read(Path("data/pad.toml")).diameter_m == 0.5


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["-n", "0"], 2, "invalid value for '-n': 0 is not in the range x>=1"),
        (["-n", "-5"], 2, "invalid value for '-n'"),
        ([], 2, "how many images?; give -n, or n in --config"),
        (["-n", "5", "--jobs", "0"], 2, "invalid value for '--jobs'"),
        (["-n", "5", "--seed", "-1"], 2, "invalid value for '--seed'"),
        (["-n", "5", "--size", "big"], 2, "invalid value for '--size': 'big' is no picture size such as 640x480"),
        (["-n", "5", "--size", "1x1"], 2, "a picture of 1x1 cannot be made; give 64 to 4096 pixels a side"),
        (["-n", "5", "--size", "99999x480"], 2, "a picture of 99999x480 cannot be made"),
        (["-n", "5", "--split", "0.8,0.1"], 2, "split 0.8,0.1 adds up to 0.9; the shares of train, val and test"),
        (["-n", "5", "--split", "a,b"], 2, "invalid value for '--split': 'a,b' is no list of shares"),
        (["-n", "5", "--backgrounds", "none"], 2, "none: does not exist"),
        (["-n", "5", "--backgrounds", "empty"], 1, "empty: holds no photographs"),
        (["-n", "5", "--backgrounds", "broken"], 1, "broken/a.jpg: is no image that can be read; remove it"),
        (["-n", "5", "--backgrounds", ".."], 2, "lies in the input"),
        (["-n", "5", "--pad", "unfit.toml"], 1, "unfit.toml: tag 5 with its white border lies on the ring"),
        (
            ["-n", "5", "--config", "reversed.toml"],
            2,
            "reversed.toml: height_m = 30 to 0.3 is reversed; write [0.3, 30]",
        ),
        (
            ["-n", "5", "--config", "unknown.toml"],
            1,
            "unknown.toml: unknown key 'domain.hight_m'; nearest known key is",
        ),
        (["-n", "5", "--config", "kind.toml"], 1, "kind.toml: 'domain.tilt_deg' must be a list of 2 numbers, not 5"),
        (["-n", "5", "-o", "full"], 2, "full: exists already; choose another -o or pass --overwrite"),
        (["-n", "5", "-o", "full", "--overwrite"], 2, "full: holds files landtool did not write"),
    ],
)
def test_what_it_refuses(args: list[str], code: int, said: str, here: Path, capsys: Said) -> None:
    for name in ("empty", "broken", "full"):
        Path(name).mkdir()
    Path("broken/a.jpg").write_text("no picture")
    Path("full/mine.txt").write_text("mine")
    Path("unfit.toml").write_text(PadSpec(tags=(PadTag(size=0.68),)).to_toml())
    Path("reversed.toml").write_text("[domain]\nheight_m = [30, 0.3]\n")
    Path("unknown.toml").write_text("[domain]\nhight_m = [1, 2]\n")
    Path("kind.toml").write_text("[domain]\ntilt_deg = 5\n")
    before = sorted(map(str, here.rglob("*")))
    assert run(["generate", "images", *SMALL, *(["-o", "data"] if "-o" not in args else []), *args]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert sorted(map(str, here.rglob("*"))) == before


@pytest.mark.usefixtures("here")
def test_photographs_reach_the_manifest_by_name() -> None:
    Path("photos").mkdir()
    cv2.imwrite("photos/lawn.png", np.zeros((100, 100, 3), np.uint8))
    assert run(["generate", "images", "-o", "data", "-n", "2", *SMALL, "--backgrounds", "photos"]) == 0
    (photo,) = json.loads(Path("data/manifest.json").read_text())["backgrounds"]
    assert photo["file"] == "lawn.png"


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["generate", "imges"], "no such command 'imges'; did you mean 'images'?"),
        (["generate", "images", "--sed", "1"], "no such option '--sed'; did you mean --seed"),
        (["generate", "preview", "none"], "none: is no generated dataset: it has no truth.csv; name a folder that"),
    ],
)
def test_a_wrong_call_is_one_line(args: list[str], said: str, capsys: Said) -> None:
    assert run(args) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("args", [["generate"], ["generate", "--help"]])
def test_help_of_the_group(args: list[str], capsys: Said) -> None:
    assert run(args) == 0
    assert "images" in capsys.readouterr().out


def test_common_options_stand_behind_the_inner_command_too(capsys: Said) -> None:
    assert run(["generate", "images", "--help"]) == 0
    assert capsys.readouterr().out.count("--debug") == 1


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"domain": {"height_m": [1, 2, 3]}}, "must be a list of 2 numbers"),
        ({"domain": {"height_m": ["1", "2"]}}, "must be a list of 2 numbers"),
        ({"domain": {"height_m": [True, False]}}, "must be a list of 2 numbers"),
        ({"size": [640.5, 480]}, "must be a list of 2 whole numbers"),
        ({"split": "0.8,0.2"}, "'split' must be a list of numbers"),
        ({"backgrounds": [1]}, "'backgrounds' must be a list of names"),
    ],
)
def test_lists_of_numbers_are_checked(values: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        configured(GenerateConfig(), values)


def test_settings_out_of_bounds() -> None:
    for values in ({"jobs": 0}, {"diameter_m": 0.0}, {"domain": {"fog": 2.0}}):
        with pytest.raises(UsageError):
            configured(GenerateConfig(), values)


# --- told to stop ----------------------------------------------------------------------------------------------------

SLOW = """
    import sys
    from landtool.synth.dataset import write
    from landtool_cli.main import main
    from tests.unit.synth.dataset import plain

    if __name__ == "__main__":
        write._draw = lambda: plain.draw_slowly
        main()
    """


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.parametrize(
    ("number", "code", "jobs"),
    [(signal.SIGINT, 130, "1"), (signal.SIGINT, 130, "2"), (signal.SIGTERM, 143, "2"), (signal.SIGKILL, -9, "2")],
)
def test_a_run_that_is_stopped_goes_on(number: signal.Signals, code: int, jobs: str, here: Path, capsys: Said) -> None:
    n = 100
    same = ["generate", "images", "-o", "data", "-n", str(n), *SMALL]
    start = [sys.executable, "-c", textwrap.dedent(SLOW), *same, "--jobs", jobs]
    root = Path(write_module.__file__).parents[3]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(start, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment) as process:
        while len(list(here.glob(".landtool-*/notes/*.json"))) < 5:
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert out == b""
    if number != signal.SIGKILL:
        assert err.endswith(b"; the same command goes on where this one stopped\n")
        assert err.count(b"\n") == 1
    assert not Path("data").exists()
    assert run([*same, "-v"]) == 0
    kept = capsys.readouterr().err.splitlines()[0]
    assert kept.startswith("goes on where an earlier run stopped: ")
    assert 5 <= int(kept.split()[-6]) < n
    assert run(["generate", "images", "-o", "again", "-n", str(n), *SMALL]) == 0
    files = [
        {p.relative_to(top): p.read_bytes() for p in Path(top).rglob("*") if p.is_file()} for top in ("data", "again")
    ]
    assert files[0] == files[1]
    assert sorted(path.name for path in here.iterdir()) == ["again", "data"]
