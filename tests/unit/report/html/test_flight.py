"""A run's tables become the flight they were written of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from landtool.io.tables import TABLES
from landtool.report.html.flight import read_flight
from landtool.report.html.folders import read_folder
from landtool.report.html.timeline import timeline
from landtool.report.verdict import VerdictLog
from tests.unit.report.html.runs import SPEED_MPS, landing, write_landing
from tests.unit.report.landings import FPS


def test_it_says_what_the_verdict_says(tmp_path: Path) -> None:
    rows = landing(gap=range(30, 40))
    log = VerdictLog(0.5)
    for row in rows:
        log.add(row)
    flight = read_flight(read_folder(write_landing(tmp_path, rows, video=False)))
    assert flight is not None
    verdict = log.verdict()
    assert verdict.foresight is not None
    known = flight.residual_m[np.isfinite(flight.residual_m)]
    assert len(known) == verdict.foresight.checked
    assert np.sqrt(np.mean(known**2)) == pytest.approx(verdict.foresight.rms_m, rel=1e-6)
    assert flight.method.count("tag") == verdict.methods["tag"]
    assert flight.state.count("coasting") == 10
    assert flight.lateral_m[-1] == pytest.approx(np.hypot(0.3, 0.1))
    assert flight.drone_m[0] == pytest.approx([0.3, 0.1])
    assert np.isnan(flight.drone_m[35]).all()


def test_predictions_are_compared_with_holding_the_place(tmp_path: Path) -> None:
    flight = read_flight(read_folder(write_landing(tmp_path, landing(), video=False)))
    assert flight is not None
    ((horizon, (error_m, held_m)),) = flight.foresight.items()
    assert horizon == 0.5
    assert held_m == pytest.approx(SPEED_MPS * 0.5)
    # frame i foretells 0.01 i m too far; frames 0 and 1 are tentative, the last half second has no later measurement
    assert error_m == pytest.approx(0.01 * np.arange(2, 60 - FPS // 2))


def test_a_folder_without_a_clock_counts_frames(tmp_path: Path) -> None:
    flight = read_flight(read_folder(write_landing(tmp_path, landing(clock=False), video=False)))
    assert flight is not None
    assert not flight.has_clock
    assert flight.at.tolist() == list(range(60))
    assert timeline(flight).unit == "frame"


def test_without_its_other_tables_a_flight_still_has_frames(tmp_path: Path) -> None:
    folder = read_folder(write_landing(tmp_path, landing(), tables=["frames.csv"], video=False))
    assert len(folder.missing) == len(TABLES) - 1
    flight = read_flight(folder)
    assert flight is not None
    assert set(flight.method) == {""}
    assert flight.foresight == {}


def test_the_timeline_shows_a_rare_trouble_of_a_long_flight(tmp_path: Path) -> None:
    rows = landing(2000, gap=range(1000, 1001))
    flight = read_flight(read_folder(write_landing(tmp_path, rows, video=False)))
    assert flight is not None
    line = timeline(flight)
    measured_by = next(row for row in line.rows if row.name == "measured by")
    (gap,) = [bar for bar in measured_by.bars if bar.value == "nothing"]
    assert gap.start == pytest.approx(500.0, abs=1.3)
    assert all(sum(bar.width for bar in row.bars) == pytest.approx(1000.0, abs=0.01) for row in line.rows)
    assert line.end_s == pytest.approx(2000 / FPS)
