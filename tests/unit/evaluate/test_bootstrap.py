"""Intervals hold what they promise, units stay together, and nothing is told where nothing is there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from landtool.evaluate.bootstrap import FEWEST_UNITS, UNDEFINED, Estimate, Resamples
from landtool.geometry import Array

SETS, UNITS = 400, 60
# three deviations of a binomial share of SETS, and what percentile intervals of 60 units and 300 draws lack
ALLOWED = 3.0 * np.sqrt(0.95 * 0.05 / SETS) + 0.015

Numbers = Callable[[Resamples, Array], Estimate]


def covered(estimates: list[Estimate], true: float) -> float:
    return float(np.mean([e.low is not None and e.high is not None and e.low <= true <= e.high for e in estimates]))


@pytest.mark.parametrize(
    ("number", "true"),
    [
        (lambda resamples, values: resamples.mean(values), 1.0),
        (lambda resamples, values: resamples.rms(values), np.sqrt(1.25)),
        (lambda resamples, values: resamples.quantile(values, 0.5), 1.0),
        (lambda resamples, values: resamples.mean(values > 1.0), 0.5),
        (lambda resamples, values: resamples.ratio(values, np.ones(len(values))), 1.0),
    ],
    ids=["mean", "rms", "median", "share", "ratio"],
)
def test_an_interval_holds_the_truth_as_often_as_it_says(number: Numbers, true: float) -> None:
    rng, resamples = np.random.default_rng(7), Resamples(list(range(UNITS)))
    estimates = [number(resamples, rng.normal(1.0, 0.5, UNITS)) for _ in range(SETS)]
    assert covered(estimates, true) == pytest.approx(0.95, abs=ALLOWED)


def test_values_of_one_unit_stay_together() -> None:
    rng, each = np.random.default_rng(3), 20
    unit = np.repeat(np.arange(UNITS), each)
    together, apart = Resamples(unit.tolist()), Resamples(list(range(len(unit))))
    sets = [np.repeat(rng.normal(0.0, 1.0, UNITS), each) + rng.normal(0.0, 0.1, len(unit)) for _ in range(100)]
    assert covered([together.mean(values) for values in sets], 0.0) > 0.88
    assert covered([apart.mean(values) for values in sets], 0.0) < 0.6


@pytest.mark.parametrize(
    "values", [np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), np.array([2.0, 5.0, 5.0, 1.0, 9.0, 3.0, 4.0, 8.0])]
)
def test_the_value_is_that_of_all_and_lies_in_its_interval(values: Array) -> None:
    resamples = Resamples(list("abcdefgh"))
    wanted = {
        "mean": (resamples.mean(values), values.mean()),
        "rms": (resamples.rms(values), np.sqrt((values**2).mean())),
        "p95": (resamples.quantile(values, 0.95), np.quantile(values, 0.95)),
    }
    for found, value in wanted.values():
        assert found.value == pytest.approx(value)
        assert found.low is not None
        assert found.high is not None
        assert found.low <= value <= found.high
        assert found.count == 8


def test_quantiles_of_weights_are_those_of_values_repeated() -> None:
    values = np.array([3.0, 1.0, 4.0, 1.5, 9.0, 2.6])
    resamples = Resamples(list(range(6)))
    resamples.draws = np.array([[2.0, 0.0, 1.0, 3.0, 0.0, 1.0]])
    repeated = np.repeat(values, [2, 0, 1, 3, 0, 1])
    for share in (0.1, 0.5, 0.6, 0.95):
        found = resamples.quantile(values, share)
        assert found.low == found.high == np.quantile(repeated, share, method="inverted_cdf")


def test_means_of_weights_are_those_of_values_repeated() -> None:
    values, wholes = np.array([3.0, 1.0, 4.0, 1.5, 9.0]), np.array([1.0, 2.0, 5.0, 0.5, 3.0])
    resamples = Resamples(list(range(5)))
    resamples.draws = np.array([[0.0, 2.0, 1.0, 0.0, 2.0]])
    times = [0, 2, 1, 0, 2]
    assert resamples.mean(values).low == pytest.approx(np.repeat(values, times).mean())
    ratio = np.repeat(values, times).sum() / np.repeat(wholes, times).sum()
    assert resamples.ratio(values, wholes).high == pytest.approx(ratio)


def test_the_same_data_have_the_same_interval() -> None:
    values = np.random.default_rng(1).normal(size=30)
    assert Resamples(list(range(30))).mean(values) == Resamples(list(range(30))).mean(values)


class TestShares:
    @pytest.mark.parametrize(("hit", "low", "high"), [(True, 0.025**0.1, 1.0), (False, 0.0, 1.0 - 0.025**0.1)])
    def test_all_and_none_have_the_binomials_own_end(self, hit: bool, low: float, high: float) -> None:
        found = Resamples(list(range(10))).mean(np.full(10, hit))
        assert found == Estimate(float(hit), pytest.approx(low), pytest.approx(high), 10)

    def test_units_count_and_not_values(self) -> None:
        units = [i // 10 for i in range(60)]
        found = Resamples(units).mean(np.full(60, True))
        assert found.low == pytest.approx(0.025 ** (1 / 6))

    def test_a_mean_of_ones_is_no_share_and_no_resample_tells_its_interval(self) -> None:
        assert Resamples(list(range(10))).mean(np.ones(10)) == Estimate(1.0, None, None, 10)

    def test_units_without_a_whole_tell_nothing(self) -> None:
        resamples = Resamples(list(range(1000)))
        wholes = np.zeros(1000)
        wholes[:6] = 1.0
        found = resamples.ratio(wholes, wholes)
        assert found.low == pytest.approx(0.025 ** (1 / 6))
        wholes[4:] = 0.0
        assert resamples.ratio(wholes, wholes) == Estimate(1.0, None, None, 1000)


class TestNothing:
    @pytest.mark.parametrize("units", [[], list(range(9))])
    def test_no_values_are_undefined(self, units: list[int]) -> None:
        resamples, none = Resamples(units), np.zeros(len(units), bool)
        values = np.zeros(0)
        for found in (
            resamples.mean(values, none),
            resamples.rms(values, none),
            resamples.quantile(values, 0.5, none),
            resamples.ratio(values, values, none),
        ):
            assert found == UNDEFINED

    def test_a_whole_of_nothing_is_undefined(self) -> None:
        assert Resamples(list(range(9))).ratio(np.zeros(9), np.zeros(9)) == UNDEFINED

    def test_few_units_have_a_value_and_no_interval(self) -> None:
        values, units = np.arange(12.0), [i % (FEWEST_UNITS - 1) for i in range(12)]
        assert Resamples(units).mean(values) == Estimate(5.5, None, None, 12)
        assert Resamples([*units[:11], "another"]).mean(values).low is not None

    def test_draws_without_any_of_the_chosen_do_not_count(self) -> None:
        resamples = Resamples(list(range(2000)))
        chosen = np.zeros(2000, bool)
        chosen[:FEWEST_UNITS] = True
        found = resamples.mean(np.arange(5.0), chosen)
        assert found.low is not None
        assert found.high is not None
        assert np.isfinite([found.low, found.high]).all()


def test_chosen_are_a_mask_or_indices_that_repeat() -> None:
    resamples = Resamples(list(range(8)))
    mask = np.array([True, False, True, True, False, True, True, True])
    values = np.arange(6.0)
    assert resamples.mean(values, mask) == resamples.mean(values, np.flatnonzero(mask))
    twice = np.repeat(np.flatnonzero(mask), 2)
    assert resamples.mean(np.repeat(values, 2), twice).low == pytest.approx(resamples.mean(values, mask).low)
