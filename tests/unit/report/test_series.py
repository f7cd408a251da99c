from __future__ import annotations

import numpy as np
import pytest

from landtool.report.series import Series


def test_keeps_all_rows_as_long_as_they_fit() -> None:
    series = Series(("a", "b"), most=4)
    for i in range(4):
        series.add(float(i), None if i == 2 else 10.0 * i)
    assert series.column("a").tolist() == [0.0, 1.0, 2.0, 3.0]
    assert np.isnan(series.column("b")[2])
    assert series.every == 1


@pytest.mark.parametrize("count", [5, 8, 9, 1000, 1001])
def test_rows_stay_evenly_spaced_and_few(count: int) -> None:
    series = Series(("a",), most=8)
    for i in range(count):
        series.add(float(i))
    assert len(series) <= 8
    assert series.column("a").tolist() == list(range(0, count, series.every))


def test_the_worst_is_never_lost() -> None:
    series = Series(("at", "trouble"), worst=("trouble",), most=8)
    for i in range(1000):
        series.add(float(i), 2.0 if i == 777 else 0.0)
    at, trouble = series.column("at"), series.column("trouble")
    (place,) = np.flatnonzero(trouble == 2.0)
    assert at[place] <= 777 < at[place] + series.every


def test_an_odd_length_cannot_be_halved() -> None:
    with pytest.raises(ValueError, match="7 rows"):
        Series(("a",), most=7)
