"""`landtool info` from the outside: text, JSON, exit codes."""

from __future__ import annotations

import importlib
import json
import shlex
from pathlib import Path

import pytest

from landtool.pad import PadSpec
from landtool_cli.main import run
from tests.conftest import ClipMaker
from tests.unit.io.mcap_logs import PLAIN, even_stamps, write_images

Said = pytest.CaptureFixture[str]


@pytest.fixture
def pad(tmp_path: Path) -> Path:
    path = tmp_path / "pad.toml"
    path.write_text(PadSpec().to_toml())
    return path


def test_says_what_it_is_and_what_is_missing(make_clip: ClipMaker, capsys: Said) -> None:
    path = make_clip("clip.mp4", [0, 512, 1024])
    assert run(["info", str(path)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith(f"{path}: video (QuickTime / MOV), ")
    assert "\n  pictures  96 x 64, h264" in out
    assert f"\n  to track  landtool track {path} --camera CAM.yaml\n" in out


def test_the_advice_is_a_command_track_understands(make_clip: ClipMaker, capsys: Said) -> None:
    path = make_clip("a clip.mp4", [0, 512, 1024])
    target = path.parent / "my pad.toml"
    target.write_text(PadSpec(diameter_m=0.18).to_toml())
    assert run(["info", str(path), "--hfov", "60", "--pad", str(target)]) == 0
    advice = next(line for line in capsys.readouterr().out.splitlines() if "to track" in line)
    words = shlex.split(advice.partition("landtool track ")[2])
    track_command = importlib.import_module("landtool_cli.commands.track").command
    context = track_command.make_context("track", words)
    assert context.params["inputs"] == (path,)
    assert context.params["hfov"] == 60.0
    assert context.params["pad"] == target


def test_a_block_for_each_input(make_clip: ClipMaker, pad: Path, capsys: Said) -> None:
    path = make_clip("clip.mp4", [0, 512, 1024])
    assert run(["info", str(path), str(pad)]) == 0
    blocks = capsys.readouterr().out.split("\n\n")
    assert [block.partition(":")[0] for block in blocks] == [str(path), str(pad)]


def test_one_input_that_fails_gives_its_own_code(tmp_path: Path, capsys: Said) -> None:
    text = tmp_path / "text.mp4"
    text.write_text("hello\n")
    assert run(["info", str(text)]) == 1
    assert run(["info", str(tmp_path / "none.mp4")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[0].startswith(f"landtool: error: {text}: is text, and none of the files landtool reads; ")
    assert err.count("\n") == 2


def test_one_of_several_that_fails_gives_3(make_clip: ClipMaker, tmp_path: Path, capsys: Said) -> None:
    path = make_clip("clip.mp4", [0, 512, 1024])
    assert run(["info", str(tmp_path / "none.mp4"), str(path)]) == 3
    out, err = capsys.readouterr()
    assert out.startswith(f"{path}: video")
    assert err.startswith(f"landtool: error: {tmp_path / 'none.mp4'}: does not exist; ")
    assert err.count("\n") == 1


def test_a_cut_log_gives_3(tmp_path: Path, capsys: Said) -> None:
    path = write_images(tmp_path / "log.mcap", even_stamps(10), chunk_size=4000, **PLAIN)
    assert run(["info", str(path)]) == 0
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert run(["info", str(path)]) == 3
    assert "MCAP log, DAMAGED" in capsys.readouterr().out


def test_json_is_one_document_with_errors_in_it(make_clip: ClipMaker, pad: Path, tmp_path: Path, capsys: Said) -> None:
    path = make_clip("clip.mp4", [0, 512, 1024])
    inputs = [str(path), str(pad), str(tmp_path / "none")]
    assert run(["info", *inputs, "--json", "--scan"]) == 3
    out, err = capsys.readouterr()
    assert err.count("\n") == 1
    document = json.loads(out)
    assert [entry["path"] for entry in document["inputs"]] == inputs
    video, target, none = document["inputs"]
    assert (video["kind"], video["damaged"], video["facts"]["width_px"]) == ("video", False, 96)
    assert video["facts"]["clock"]["mean_hz"] == pytest.approx(30.0, abs=1e-3)
    assert video["facts"]["scan"]["decoded"] == 3
    assert video["track"]["needs"][0]["option"] == "--camera CAM.yaml"
    assert target["facts"]["tags"][0]["size_mm"] == 160.0
    assert (none["error"]["exit_code"], none["error"]["reason"]) == (2, "does not exist")


def test_json_of_one_input_that_fails(tmp_path: Path, capsys: Said) -> None:
    assert run(["info", str(tmp_path / "none"), "--json"]) == 2
    out, err = capsys.readouterr()
    assert "error" in json.loads(out)["inputs"][0]
    assert err.count("\n") == 1


def test_ranges_of_a_pad(make_clip: ClipMaker, pad: Path, tmp_path: Path, capsys: Said) -> None:
    assert run(["info", str(pad), "--hfov", "60", "--size", "640x480"]) == 0
    assert "tag36h11 id 5 readable from 0.231 to 6.82 m (13 px a side)" in capsys.readouterr().out
    small = tmp_path / "small.toml"
    small.write_text(PadSpec(name="small", diameter_m=0.5).to_toml())
    path = make_clip("clip.mp4", [0, 512, 1024])
    assert run(["info", str(path), "--hfov", "60", "--pad", str(small)]) == 0
    assert "range     small: tag36h11 id 5 readable from 0.13 to 0.512 m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--hfov", "60", "--camera", "x.yaml"], "--camera and --hfov exclude each other; keep the calibration file"),
        (["--hfov", "60", "--size", "640"], "--size '640' is no picture size; give it as 640x480"),
        (["--hfov", "60"], "pad.toml: a field of view gives no range without a picture size; pass --size WxH too"),
        (["--camera", "none.yaml"], "none.yaml: No such file or directory"),
        (["--topic", "/a"], "pad.toml: is no recording; leave out --topic and --fps"),
    ],
)
def test_requests_that_must_change(
    args: list[str], said: str, pad: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(pad.parent)
    assert run(["info", "pad.toml", *args]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"landtool: error: {said}")
    assert err.count("\n") == 1
