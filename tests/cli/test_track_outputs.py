"""`landtool track --save mcap,tum`: what is written, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from landtool.io.run_record import sha256_of
from landtool_cli.main import run
from tests.cli.conftest import Track
from tests.cli.landing import TICKS, Landing

CAM = ("--camera", "camera.yaml")


def test_only_what_is_asked_for_is_written(track: Track, here: Path) -> None:
    assert track("clip.mp4", *CAM, "-o", "out", "--save", "mcap,tum").code == 0
    names = {path.name for path in (here / "out/clip").iterdir()}
    assert names == {"track.mcap", "pad_in_camera.tum", "run.json"}  # no world without --ego


def test_the_log_says_what_it_was_made_of(track: Track, here: Path) -> None:
    assert track("clip.mp4", "--hfov", "60", "-o", "out", "--save", "mcap").code == 0
    with (here / "out/clip/track.mcap").open("rb") as file:
        reader = make_reader(file)
        [record] = reader.iter_metadata()
        statistics = reader.get_summary().statistics  # type: ignore[union-attr]
        attached = [attachment.name for attachment in reader.iter_attachments()]
    facts = record.metadata
    assert facts["command"] == "track"
    assert json.loads(facts["inputs"]) == [{"path": "clip.mp4", "sha256": sha256_of(here / "clip.mp4")}]
    assert json.loads(facts["config"])["hfov_deg"] == 60.0
    assert "60 degrees" in facts["camera_assumed"]
    assert attached == ["camera.yaml", "pad.toml"]
    assert statistics is not None
    assert statistics.message_count >= 6 * len(TICKS)


@pytest.mark.parametrize(
    ("save", "reason"),
    [
        ("mcap", "frames without times cannot be written to an MCAP log"),
        ("tum", "frames without times make no trajectory"),
    ],
)
def test_a_folder_without_a_clock_is_refused(
    save: str, reason: str, track: Track, landing: Landing, here: Path
) -> None:
    landing.images(here / "shots")
    told = track("shots", *CAM, "-o", "out", "--save", save)
    assert told.code == 2
    assert told.lines == [f"landtool: error: shots: {reason}; give the clock with --fps"]
    assert not (here / "out").exists()
    assert track("shots", *CAM, "-o", "out", "--save", save, "--fps", "10").code == 0


def test_a_log_of_results_is_replaced_only_with_overwrite(track: Track, here: Path) -> None:
    assert track("clip.mp4", *CAM, "-o", "out", "--save", "mcap").code == 0
    before = (here / "out/clip/track.mcap").read_bytes()
    assert track("clip.mp4", *CAM, "-o", "out", "--save", "mcap").code == 2
    assert (here / "out/clip/track.mcap").read_bytes() == before
    assert track("clip.mp4", *CAM, "-o", "out", "--save", "mcap", "--overwrite").code == 0


@pytest.mark.parametrize("save", ["mcap", "tum"])
def test_detect_has_no_such_outputs(save: str, here: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["detect", str(here / "clip.mp4"), "--save", save]) == 2
    assert capfd.readouterr().err == f"landtool: error: unknown output '{save}'; known: video, csv\n"
