"""The main numbers as lines, of several networks side by side."""

from __future__ import annotations

from dataclasses import replace

from landtool.evaluate.words import HEADLINES, metric_lines
from tests.unit.evaluate.metrics import made


def test_a_line_a_number_with_its_unit_behind_the_value() -> None:
    lines = metric_lines([made("pose.normal_deg_median", 0.3751, low=0.2, high=0.5), made("pose.flips_per_1000", 0.0)])
    assert lines == [
        "poses: normal off     0.3751 deg (0.2 to 0.5), 10 of 10",
        "poses: flips of 1000  0, 10 of 10",
    ]


def test_what_is_undefined_has_no_unit() -> None:
    lines = metric_lines([made("track.lag_s", None), made("track.longest_gap_s", 0.5)])
    assert lines[0].split("  ")[-1] == "undefined, 0 of 0"


def test_a_stage_of_which_nothing_is_told_has_one_line() -> None:
    lines = metric_lines([made("track.lag_s", None), made("track.longest_gap_s", None)])
    assert lines == ["track and prediction  undefined, 0 of 0"]


def test_networks_stand_side_by_side() -> None:
    one = [
        replace(made("detection.recall", value), model=model) for value, model in ((0.5, "a"), (0.25, "much longer"))
    ]
    also = replace(made("detection.map50", 0.125), model="a")
    head, first, second = metric_lines([*one, also])
    assert head.split() == ["a", "much", "longer"]
    assert first.endswith("0.125, 10 of 10  not scored")
    assert head.index("much longer") == second.index("0.25,") == first.index("not scored")
    assert head.index("a") == second.index("0.5,")


def test_what_no_network_takes_part_in_stands_under_each() -> None:
    lines = metric_lines([
        *(replace(made("detection.recall", 0.5), model=model) for model in "ab"),
        made("dehaze.ssim_gain", 0.25),
    ])  # fmt: skip
    assert lines[-1].count("0.25,") == 2


def test_parts_and_minor_numbers_are_left_out() -> None:
    assert metric_lines([made("detection.recall:size_px=0-14", 1.0), made("detection.ap75", 1.0)]) == [
        "nothing was scored"
    ]
    assert metric_lines([]) == ["nothing was scored"]


def test_headlines_name_each_number_once() -> None:
    assert len({headline.key for headline in HEADLINES}) == len(HEADLINES)
    assert len({headline.text for headline in HEADLINES}) == len(HEADLINES)
