"""The files in datasets/fixtures are what their manifests and tools/make_fixtures.py say."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from landtool.calibrate.board import Board
from landtool.io.calibration import read_camera
from landtool.io.tables import read_rows
from landtool.synth.clips import SCENARIOS
from landtool.synth.dataset import TRUTH_COLUMNS
from tests.golden.clip import FIXTURES
from tools import make_fixtures

MOST_BYTES = 10_000_000
CLIPS = {"approach": make_fixtures.APPROACH, **make_fixtures.CLIPS}

BOARD_FILES = {
    "board.camera.yaml": "275f05a0b105695f93d563335f6832b27aeed890df24c3334485b4c068c002d5",
    "board.mp4": "5066a4e0f0a41b69e5213d29c6995947cc8c57b0165875e1e0de4170a6e6a301",
    "board.toml": "31c74811d52a4c5e24d10eeb9eb9805d6bb17e2232430096da76d15808267377",
}


def manifest(path: Path) -> dict[str, object]:
    read = json.loads(path.read_text(encoding="utf-8"))
    assert isinstance(read, dict)
    return read


def digests(folder: Path) -> dict[str, str]:
    """The SHA-256 of every file below a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_they_are_small_and_of_every_scenario() -> None:
    assert sum(path.stat().st_size for path in FIXTURES.rglob("*") if path.is_file()) < MOST_BYTES
    assert {config.scenario for config in CLIPS.values()} == set(SCENARIOS)


@pytest.mark.parametrize("name", CLIPS)
def test_a_clip_is_of_its_request_and_as_it_was_written(name: str) -> None:
    said = manifest(FIXTURES / f"{name}.manifest.json")
    assert said["config"] == json.loads(json.dumps(CLIPS[name].as_values()))
    found = digests(FIXTURES)
    files = said["sha256"]
    assert isinstance(files, dict)
    assert f"{name}.mp4" in files
    assert files == {file: found[file] for file in files}


def test_the_stills_are_as_they_were_written() -> None:
    said, found = manifest(FIXTURES / "stills" / "manifest.json"), digests(FIXTURES / "stills")
    assert said["n"] == make_fixtures.STILLS.n == len([file for file in found if file.startswith("images/")])
    rows = read_rows(FIXTURES / "stills" / "truth.csv", TRUTH_COLUMNS)
    foggy = {str(row["file"]).replace("images", "clear") for row in rows if row["beta_per_m"]}
    assert {file for file in found if file.startswith("clear/")} == foggy
    del found["manifest.json"]
    assert said["files"] == found


def test_the_film_of_a_board_is_as_it_was_written() -> None:
    found = digests(FIXTURES)
    assert {name: found[name] for name in BOARD_FILES} == BOARD_FILES
    assert Board.read(FIXTURES / "board.toml") == make_fixtures.BOARD.board
    truth = make_fixtures.BOARD.camera
    # the file has the numbers' shortest texts, which read back equal
    assert read_camera(FIXTURES / "board.camera.yaml") == truth


def test_the_datasheet_names_every_recording() -> None:
    text = (FIXTURES.parent / "README.md").read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(): line for line in text.splitlines() if line.startswith("| ")}
    assert {path.name for path in FIXTURES.iterdir() if path.suffix in (".mp4", ".mcap")} <= set(rows)
    for name, config in CLIPS.items():
        cells = [cell.strip() for cell in rows[f"{name}.mp4"].split("|")][2:6]
        rate = f"{config.duration_s:g}, {config.fps}{' on the mean' if config.vfr else ''}"
        size = "x".join(map(str, config.size))
        assert cells == [str(config.seed), rate, size, f"{config.height_start_m:g} m"]


@pytest.mark.full
def test_they_are_made_again_byte_for_byte(tmp_path: Path) -> None:
    make_fixtures.make(tmp_path)
    assert digests(tmp_path) == digests(FIXTURES)
