"""A metric's name and how it is said."""

from __future__ import annotations

import pytest

from landtool.evaluate.bootstrap import UNDEFINED, Estimate
from landtool.evaluate.metric import Metric, metric


def test_a_key_names_stage_number_and_part() -> None:
    whole = metric("detection", "recall", UNDEFINED, "higher")
    assert whole.key == "detection.recall"
    assert metric("detection", "recall", UNDEFINED, "higher", slice="size_px=14-20").key == (
        "detection.recall:size_px=14-20"
    )


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (metric("track", "lag_s", Estimate(0.12345, 0.1, 0.15, 12), "lower", of=13), "0.1235 (0.1 to 0.15), 12 of 13"),
        (metric("track", "lag_s", Estimate(0.5, None, None, 3), "lower"), "0.5, 3 of 3"),
        (metric("track", "lag_s", UNDEFINED, "lower"), "undefined, 0 of 0"),
        (metric("track", "lag_s", UNDEFINED, "lower", of=9), "undefined, 0 of 9"),
        (Metric("track", "lag_s", 1e-9, 1, 1, "lower", 0.0, None), "1e-09, 1 of 1"),
    ],
)  # fmt: skip
def test_what_is_said(made: Metric, said: str) -> None:
    assert made.said == said


def test_what_an_estimate_knows_is_kept() -> None:
    made = metric("pose", "nees_place", Estimate(1.1, 0.9, 1.3, 7), "expected", of=8, expected=1.0, slice="stage=far")
    assert made == Metric("pose", "nees_place", 1.1, 7, 8, "expected", 0.9, 1.3, 1.0, "stage=far", "")
