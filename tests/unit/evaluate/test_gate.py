"""What the gate stops and what it lets pass."""

from __future__ import annotations

import json

import pytest

from landtool.evaluate.baseline import Baseline
from landtool.evaluate.gate import GateRow, Verdict, gate, gate_lines, row_text
from landtool.evaluate.metric import Better, Metric
from landtool.evaluate.tolerance import Allowance, Tolerance
from tests.unit.evaluate.metrics import made

TENTH = Tolerance((("*", Allowance(relative=0.1)),))


def judged(
    before: Metric | None, now: Metric | None, tolerance: Tolerance = TENTH, *, same_data: bool = True
) -> GateRow:
    kept = Baseline("", "", () if before is None else (before,))
    (row,) = gate(kept, [] if now is None else [now], tolerance, same_data=same_data).rows
    return row


@pytest.mark.parametrize(
    ("better", "now", "verdict"),
    [
        ("higher", 0.8, "same"),
        ("higher", 0.72, "same"),  # exactly what is allowed
        ("higher", 0.7199, "worse"),
        ("higher", 0.88, "same"),
        ("higher", 0.8801, "better"),
        ("lower", 0.88, "same"),
        ("lower", 0.8801, "worse"),
        ("lower", 0.7199, "better"),
        ("neither", 100.0, "same"),
    ],
)
def test_a_number_against_its_tolerance(better: Better, now: float, verdict: Verdict) -> None:
    row = judged(made("pose.a", 0.8, better), made("pose.a", now, better))
    assert row.verdict == verdict
    assert row.tolerance == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("old", "now", "verdict"),
    [
        (1.0, 1.05, "same"),
        (1.0, 2.0, "worse"),
        (1.0, 0.5, "worse"),  # half of what it should be is as wrong as twice of it
        (2.0, 0.5, "same"),
        (2.0, 0.4, "worse"),
        (3.0, 1.0, "better"),
        (0.3, 1.1, "better"),
        (1.0, 0.0, "worse"),
        (0.0, 0.0, "same"),
        (-1.0, 0.5, "better"),
    ],
)
def test_what_has_a_right_value_gets_worse_by_moving_away(old: float, now: float, verdict: Verdict) -> None:
    kept, metric = (made("track.nees", v, "expected", expected=1.0) for v in (old, now))
    assert judged(kept, metric).verdict == verdict


def test_about_nothing_a_difference_counts() -> None:
    kept, metric = (made("time.rate_ppm", v, "expected", expected=0.0) for v in (-3.0, 10_000.0))
    tolerance = Tolerance((("time.*", Allowance(absolute=100.0)),))
    assert judged(kept, metric, tolerance).verdict == "worse"
    assert judged(kept, made("time.rate_ppm", 90.0, "expected", expected=0.0), tolerance).verdict == "same"


class TestChance:
    inside = made("pose.a", 1.3, low=0.9, high=1.6)
    outside = made("pose.a", 1.3, low=1.2, high=1.6)
    unknown = made("pose.a", 1.3)
    kept = made("pose.a", 1.0)

    def test_on_the_same_data_there_is_none(self) -> None:
        assert judged(self.kept, self.inside).verdict == "worse"

    def test_on_other_data_the_interval_says(self) -> None:
        assert judged(self.kept, self.inside, same_data=False).verdict == "noise"
        assert judged(self.kept, self.outside, same_data=False).verdict == "worse"
        # nothing speaks for chance
        assert judged(self.kept, self.unknown, same_data=False).verdict == "worse"

    def test_a_gain_by_chance_is_none(self) -> None:
        gained = made("pose.a", 0.7, low=0.5, high=1.1)
        assert judged(self.kept, gained).verdict == "better"
        assert judged(self.kept, gained, same_data=False).verdict == "same"

    def test_noise_is_listed_and_passes(self) -> None:
        result = gate(Baseline("", "", (self.kept,)), [self.inside], TENTH, same_data=False)
        assert result.passed
        assert gate_lines(result) == [
            "gate: passed, none of 1 number got worse",
            "  worse, but by no more than other pictures explain:",
            "    number  baseline  now  interval    allowed  worse by",
            "    pose.a  1         1.3  0.9 to 1.6  0.1      0.3",
        ]


def test_numbers_that_come_and_go() -> None:
    number, nothing = made("pose.a", 1.0), made("pose.a", None)
    assert judged(number, nothing).verdict == judged(number, None).verdict == "gone"
    assert judged(nothing, number).verdict == judged(None, number).verdict == "new"
    assert judged(nothing, nothing).verdict == judged(nothing, None).verdict == "same"
    assert not gate(Baseline("", "", (number,)), [], TENTH, same_data=True).passed
    assert gate(Baseline("", "", (number,)), [number, made("pose.b", 1.0)], TENTH, same_data=True).passed
    assert not gate(Baseline("", "", ()), [number], TENTH, same_data=True).passed
    assert not gate(Baseline("", "", (nothing,)), [nothing], TENTH, same_data=True).passed


def test_parts_of_the_data_and_what_is_ignored_are_left_out() -> None:
    kept = Baseline("", "", (made("speed.ms", 1.0), made("pose.a:size_px=0-14", 1.0), made("pose.a", 1.0)))
    now = [made("speed.ms", 9.0), made("pose.a:size_px=0-14", 9.0), made("pose.a", 1.0)]
    ignoring = Tolerance((*TENTH.patterns, ("speed.*", Allowance(ignore=True))))
    result = gate(kept, now, ignoring, same_data=True)
    assert [row.key for row in result.rows] == ["pose.a"]
    assert result.passed
    parts = Tolerance((*ignoring.patterns, ("pose.*:*", Allowance(relative=0.5))))
    assert [row.key for row in gate(kept, now, parts, same_data=True).of("worse")] == ["pose.a:size_px=0-14"]


def test_the_table_of_what_got_worse() -> None:
    kept = Baseline("", "", tuple(made(f"pose.{name}", 1.0) for name in "abcdef"))
    now = [
        made("pose.a", 1.5, low=1.4, high=1.6), made("pose.b", None), made("pose.c", 1.0), made("pose.new", 1.0),
        *(made(f"pose.{name}", 0.5) for name in "def"), made("pose.g", 0.1),
    ]  # fmt: skip
    result = gate(kept, now, TENTH, same_data=True)
    assert not result.passed
    assert gate_lines(result) == [
        "gate: failed, 2 of 6 numbers got worse or are gone",
        "    number  baseline  now        interval    allowed  worse by",
        "    pose.a  1         1.5        1.4 to 1.6  0.1      0.5",
        "    pose.b  1         undefined                       gone",
        "  3 numbers got better (pose.d, pose.e, pose.f): keep that with --update-baseline",
        "  2 numbers not in the baseline yet: keep them with --update-baseline",
    ]
    values = result.as_values("baseline.json")
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values["passed"] is False
    assert values["rows"][0] == {
        "key": "pose.a", "baseline": 1.0, "value": 1.5, "low": 1.4, "high": 1.6, "tolerance": 0.1, "by": 0.5,
        "verdict": "worse",
    }  # fmt: skip


def test_nothing_to_compare_is_said() -> None:
    assert gate_lines(gate(Baseline("", "", ()), [], TENTH, same_data=True)) == [
        "gate: failed, nothing was compared: the baseline has none of the numbers"
    ]


def test_several_networks_are_refused() -> None:
    with pytest.raises(ValueError, match="two metrics of one key"):
        gate(Baseline("", "", ()), [made("pose.a", 1.0), made("pose.a", 2.0)], TENTH, same_data=True)


@pytest.mark.parametrize(
    ("before", "now", "said"),
    [
        (1.0, 1.5, "was 1, is 1.5, worse by 0.5, allowed are 0.1"),
        (1.0, 0.5, "was 1, is 0.5, better by 0.5, allowed are 0.1"),
        (1.0, 1.0, "is 1, was 1"),
        (1.0, None, "was 1, is undefined"),
        (None, 1.0, "is 1, new"),
        (None, None, "undefined"),
    ],
)
def test_a_row_in_words(before: float | None, now: float | None, said: str) -> None:
    assert row_text(judged(made("pose.a", before), made("pose.a", now))) == said
