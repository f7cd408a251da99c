"""Tests of what is said of a run's folder that is not whole, or is the folder above."""

from __future__ import annotations

from pathlib import Path

import pytest

from landtool.errors import UsageError
from landtool.report.html.film import Budget
from landtool.report.html.folders import read_folder
from landtool.report.html.run_page import run_page, run_section
from tests.unit.report.html.runs import landing, write_landing


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        (None, "frames.csv was not saved"),
        (-8, "frames.csv cannot be used: line 61: "),
        ("header", "frames.csv has no row"),
    ],
)
def test_why_frames_csv_tells_of_no_frame(kept: int | str | None, said: str, tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing())
    table = run / "frames.csv"
    text = table.read_text(encoding="utf-8")
    if kept is None:
        table.unlink()
    else:
        table.write_text(text.splitlines(keepends=True)[0] if isinstance(kept, str) else text[:kept], encoding="utf-8")
    folder, output = read_folder(run), tmp_path / "r.html"
    made = run_page(folder, output, "auto")
    assert made.worst_note.startswith(f"No frame can be shown: {said}")
    section, _ = run_section(folder, None, "run", "run", output, "auto", Budget(), has_truth=False)
    assert section.missing[0].startswith(f"No timeline: {said}")


@pytest.mark.parametrize(("count", "said"), [(1, "a run"), (2, "2 runs")])
def test_the_folder_of_runs_is_none(count: int, said: str, tmp_path: Path) -> None:
    for i in range(count):
        write_landing(tmp_path / f"flight{i}", landing(4), video=False)
    with pytest.raises(UsageError, match=f"holds {said} and is none itself; give .*flight0"):
        read_folder(tmp_path)
