from __future__ import annotations

from pathlib import Path

import pytest

from landtool.errors import InputError
from landtool.train.results import ResultRow, parse_results, results_csv

HEADER = "iteration,seconds,loss_box,loss_objectness,loss_classes,learning_rate,precision,recall,mAP50,mAP50-95"
ROWS = [
    ResultRow(250, 741.5, 1.25, 0.5, 0.125, 0.0015, 0.75, 1.0, 0.875, 0.5),
    ResultRow(500, 1480.123456789, 1.0 / 3.0, 1e-7, 0.0, 1.5e-5, None, None, None, None),
]


def test_a_table_with_digits_enough_and_empty_for_unknown() -> None:
    assert results_csv(ROWS).splitlines() == [
        HEADER,
        "250,741.5,1.25,0.5,0.125,0.0015,0.75,1,0.875,0.5",
        "500,1480.12346,0.333333333,1e-07,0,1.5e-05,,,,",
    ]
    assert results_csv([]) == HEADER + "\n"


def test_what_is_read_is_what_was_written() -> None:
    read = parse_results(results_csv(ROWS))
    assert read[0] == ROWS[0]
    assert results_csv(read) == results_csv(ROWS)  # a resumed training writes the earlier rows again
    assert parse_results(results_csv([])) == []


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "line 1: these are no results"),
        ("<html>\n", "line 1: these are no results"),
        (HEADER.replace("seconds", "epoch") + "\n", "line 1: these are no results"),
        (HEADER + "\n250,741.5,1.2", "line 2: 3 fields where the header has 10"),
        (HEADER + "\n\n", "line 2: 0 fields"),
        (HEADER + "\n2.5,1,1,1,1,1,,,,\n", "line 2: invalid literal"),
        (HEADER + "\n2,1,1,1,1,1,,,,\n3,,1,1,1,1,,,,\n", "line 3: could not convert"),
        (HEADER + "\n2,1,nan,1,1,1,,,,\n", "line 2: 'nan' is not a finite number"),
    ],
)
def test_what_is_no_table_of_results_is_refused_with_its_line(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=rf"^results\.csv: {reason}"):
        parse_results(text, Path("results.csv"))
