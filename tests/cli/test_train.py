"""`landtool train`, as it is typed."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from landtool_cli.main import run
from tests.unit.train.small_training import CFG, dataset

needs_torch = pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="torch is not installed")
SETTINGS = """cfg = "small.cfg"
batch = 4
sides = [64]
warm_up = 2
validate_every = 2
validate_on = 3
bf16 = "off"
pyramid = false
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with data/data.yaml and settings in it."""
    monkeypatch.chdir(tmp_path)
    dataset(tmp_path / "data")
    (tmp_path / "small.cfg").write_text(CFG, encoding="utf-8")
    (tmp_path / "small.toml").write_text(SETTINGS, encoding="utf-8")
    return tmp_path


def call(*words: str) -> int:
    return run(["train", "--data", "data/data.yaml", "-o", "run", "--config", "small.toml", "--size", "64x64", *words])


@needs_torch
def test_trains_and_says_what_to_do_next(here: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert call("--iterations", "3", "-v") == 0
    told = capfd.readouterr()
    lines = told.out.splitlines()
    assert lines[0].startswith("run: 2 validations, ")
    assert lines[1].startswith("  best at iteration ")
    assert lines[2] == "  landtool export run/weights/best.landtool -o run/model.onnx"
    assert "iteration 2: loss " in told.err
    assert run(["export", "run/weights/best.landtool", "-o", "run/model.onnx"]) == 0
    assert (here / "run" / "model.onnx").exists()


@needs_torch
def test_a_finished_training_is_not_replaced(here: Path, capfd: pytest.CaptureFixture[str]) -> None:  # noqa: ARG001
    assert call("--iterations", "1") == 0
    assert call("--iterations", "1") == 2
    assert "run: exists already" in capfd.readouterr().err
    assert call("--iterations", "1", "--overwrite") == 0


@needs_torch
@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--data", "nosuch.yaml"], 2, "nosuch.yaml: No such file or directory"),
        (["--data", "generate:x"], 2, "'generate:x' names no seed"),
        (["--cfg", "data/data.yaml"], 1, "data.yaml: line 1"),
        (["--weights", "nosuch.weights"], 2, "nosuch.weights"),
        (["--weights", "pickled.landtool"], 1, "is pickled"),
        (["--size", "60x64"], 1, "width = 60 is no multiple of 8"),
    ],
)
def test_what_is_wrong_is_one_line(
    here: Path, capfd: pytest.CaptureFixture[str], words: list[str], code: int, said: str
) -> None:
    (here / "pickled.landtool").write_bytes(b"\x80\x04\x95code")
    assert call("--iterations", "1", *words) == code
    told = capfd.readouterr()
    assert told.out == ""
    assert said in told.err
    assert len(told.err.splitlines()) == 1


def test_without_torch_it_says_how_to_get_it(
    here: Path,  # noqa: ARG001
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "torch" else find_spec(name))
    assert call() == 2
    assert "training needs torch" in capfd.readouterr().err


def test_data_are_asked_for(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["train"]) == 2
    assert "no data" in capfd.readouterr().err
