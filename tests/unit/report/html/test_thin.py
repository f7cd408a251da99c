"""A thinned curve keeps what the eye would see."""

from __future__ import annotations

import numpy as np

from landtool.report.html.thin import MOST_POINTS, thinned


def test_a_short_curve_stays_whole() -> None:
    assert thinned(np.arange(MOST_POINTS, dtype=float)).tolist() == list(range(MOST_POINTS))


def test_a_lone_peak_and_a_lone_gap_of_a_long_curve_stay() -> None:
    y = np.sin(np.arange(50_000) / 900.0)
    y[12_345], y[33_333], y[40_000] = 9.0, -9.0, np.nan
    kept = thinned(y)
    assert len(kept) <= MOST_POINTS
    assert {12_345, 33_333, 40_000, 0, 49_999} <= set(kept.tolist())
    assert (np.diff(kept) > 0).all()


def test_a_curve_of_which_nothing_is_known_is_thinned_too() -> None:
    assert len(thinned(np.full(10_000, np.nan))) <= MOST_POINTS
