"""`landtool report` as it is called."""

from __future__ import annotations

from pathlib import Path

import pytest

from landtool.report.html.film import VIDEO_MODES
from landtool_cli.commands.report import VIDEO_MODES as CLI_MODES
from landtool_cli.main import run
from tests.unit.report.html.runs import GATE, landing, write_evaluation, write_landing


def test_a_run_becomes_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_landing(Path("run"), landing())
    assert run(["report", "run", "-o", "out/report.html"]) == 0
    told = capsys.readouterr()
    assert told.out == "out/report.html: tracked, 0.1 MB\n  video of flight.mp4: embedded, 0.0 MB\n"
    assert told.err == ""
    assert "<video" in Path("out/report.html").read_text(encoding="utf-8")
    assert run(["report", "run", "-o", "out/report.html"]) == 2
    assert capsys.readouterr().err.startswith("landtool: error: out/report.html: exists already")
    assert run(["report", "run", "-o", "out/report.html", "--overwrite", "--video", "none"]) == 0
    assert "<video" not in Path("out/report.html").read_text(encoding="utf-8")


def test_a_gate_that_is_not_met_is_a_good_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_evaluation(tmp_path / "eval", gate=GATE)
    assert run(["report", str(folder), "-o", str(tmp_path / "e.html")]) == 0
    assert "e.html: gate not met" in capsys.readouterr().out


def test_a_folder_that_is_neither_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["report", str(tmp_path), "-o", str(tmp_path / "e.html")]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == (
        f"landtool: error: {tmp_path}: is neither a run nor an evaluation; "
        "give a folder that `landtool track` or `landtool eval` wrote, such as runs/track/flight\n"
    )


def test_the_ways_to_show_a_video_are_the_librarys() -> None:
    assert CLI_MODES == VIDEO_MODES
