"""The clock of a run against the truth's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landtool.evaluate.clock import check_clock, clock_metrics
from landtool.types import FrameResult
from tests.unit.evaluate.clips import STEP_NS, result, truth_of


def run(frames: int, rate: float = 1.0, offset_ns: int = 0) -> list[FrameResult]:
    return [result(k, t_ns=round(k * STEP_NS * rate) + offset_ns) for k in range(frames)]


@pytest.mark.parametrize("rate", [1.01, 0.99])
def test_a_frame_rate_wrong_by_one_percent_is_ten_thousand_ppm(rate: float) -> None:
    check = check_clock("clip", run(120, rate, 40_000_000), truth_of(120))
    assert check.rate_ppm == pytest.approx(1e6 * (rate - 1.0), abs=0.1)
    assert check.offset_s == pytest.approx(0.04)
    assert check.jitter_ms == pytest.approx(0.0, abs=1e-3)
    metrics = {metric.key: metric for metric in clock_metrics([check])}
    assert metrics["time.rate_ppm"].value == pytest.approx(10_000.0, abs=0.1)
    assert metrics["time.rate_ppm:clip=clip"].value == metrics["time.rate_ppm"].value
    assert metrics["time.rate_ppm"].better == "lower"


def test_a_few_wrong_times_move_the_rate_little_and_show_as_jitter() -> None:
    rng = np.random.default_rng(2)
    times = [k * STEP_NS + round(rng.normal(0.0, 1e6)) for k in range(200)]
    times[50] += 800_000_000
    check = check_clock("clip", [result(k, t_ns=t) for k, t in enumerate(times)], truth_of(200))
    assert abs(check.rate_ppm or 0.0) < 100.0
    assert check.jitter_ms == pytest.approx(800.0 / np.sqrt(200), rel=0.05)


def test_times_since_1970_are_compared_exactly() -> None:
    start = 1_790_000_000_000_000_000
    truth = truth_of(50)
    truth = replace(truth, frames=tuple(replace(f, t_ns=start + (f.t_ns or 0)) for f in truth.frames))
    check = check_clock("clip", run(50, 1.0, start + 7), truth)
    assert check.offset_s == pytest.approx(7e-9, abs=1e-9)
    assert check.rate_ppm == pytest.approx(0.0, abs=1e-6)


def test_frames_and_truth_of_other_numbers_are_counted() -> None:
    longer, shorter = check_clock("a", run(70), truth_of(60)), check_clock("b", run(45), truth_of(60))
    assert (longer.frames_without_truth, longer.truth_without_frames) == (10, 0)
    assert (shorter.frames_without_truth, shorter.truth_without_frames) == (0, 15)
    metrics = {metric.key: metric for metric in clock_metrics([longer, shorter])}
    assert metrics["time.frames_without_truth"].value == 10.0
    assert metrics["time.truth_without_frames"].value == 15.0
    assert metrics["time.truth_without_frames:clip=b"].value == 15.0


def test_without_clocks_or_numbers_nothing_is_known_of_time() -> None:
    unclocked = check_clock("a", [result(k, t_ns=None) for k in range(20)], truth_of(20))
    assert (unclocked.rate_ppm, unclocked.matched, unclocked.frames_without_truth) == (None, 0, 0)
    truth = truth_of(20)
    unnumbered = replace(truth, frames=tuple(replace(f, index=None) for f in truth.frames))
    assert check_clock("a", run(20), unnumbered).rate_ppm is None
    assert check_clock("a", run(20), unnumbered).frames_without_truth == 0
    metrics = {metric.key: metric for metric in clock_metrics([unclocked])}
    assert metrics["time.rate_ppm"].said == "undefined, 0 of 20"
    assert {metric.said for metric in clock_metrics([])} == {"undefined, 0 of 0"}
