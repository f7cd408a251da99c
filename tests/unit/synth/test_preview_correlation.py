"""Correlations: exact cases, and that chance alone does not look like one."""

from __future__ import annotations

import doctest

import numpy as np
import pytest

from landtool.synth.preview import correlation, sheet
from landtool.synth.preview.correlation import LIMIT, correlation_ratio, correlations, pearson


def test_examples_in_the_documentation() -> None:
    for module in (correlation, sheet):
        done = doctest.testmod(module)
        assert done.attempted > 0
        assert done.failed == 0


def test_pearson_agrees_with_numpy() -> None:
    rng = np.random.default_rng(3)
    a = rng.normal(size=100)
    b = 0.3 * a + rng.normal(size=100)
    assert pearson(a, b) == pytest.approx(np.corrcoef(a, b)[0, 1], abs=1e-12)
    assert pearson(5.0 - 2.0 * a, a) == pytest.approx(-1.0)


def test_ratio_is_not_fooled_by_many_kinds() -> None:
    """Twelve kinds that mean nothing: eta squared is (k - 1) / (n - 1) on average, epsilon squared is 0."""
    rng = np.random.default_rng(5)
    n, k = 300, 12
    plain, corrected = [], []
    for _ in range(300):
        values, kinds = rng.normal(size=n), rng.integers(0, k, n)
        means = np.bincount(kinds, values, k) / np.bincount(kinds, minlength=k)
        plain.append(1.0 - np.square(values - means[kinds]).sum() / np.square(values - values.mean()).sum())
        corrected.append(correlation_ratio(values, kinds))
    assert np.mean(plain) == pytest.approx((k - 1) / (n - 1), rel=0.1)
    assert np.mean(np.array(corrected) == 0.0) > 0.4
    assert np.mean(np.square(corrected)) < 0.4 * np.mean(plain)


def test_ratio_sees_kinds_that_matter() -> None:
    rng = np.random.default_rng(6)
    kinds = rng.integers(0, 6, 2000)
    # deviation of the six means sqrt(35 / 12), of the rest 2: eta^2 = 2.917 / 6.917
    assert correlation_ratio(kinds + rng.normal(0.0, 2.0, 2000), kinds) == pytest.approx(0.649, abs=0.03)


def test_independent_pictures_stay_below_the_limit() -> None:
    rng = np.random.default_rng(7)
    n = 1120
    size = np.exp(rng.uniform(np.log(8), np.log(400), n))
    size[rng.random(n) < 0.15] = np.nan
    kinds = {"ground": [f"g{i}" for i in rng.integers(0, 12, n)]}
    rows = correlations(size, {f"x{i}": rng.normal(size=n) for i in range(10)}, kinds)
    assert len(rows) == 10 + 1 + 12
    assert rows[0].count == int(np.isfinite(size).sum())
    assert max(abs(row.coefficient) for row in rows) < LIMIT
    tied = correlations(size, {"light": np.log(size) + rng.normal(0, 5, n)}, {})
    assert tied[0].coefficient > LIMIT


def test_what_never_changes_has_no_correlation() -> None:
    assert np.isnan(pearson([0.1] * 7, range(7)))
    assert np.isnan(correlation_ratio([1.0, 2.0], ["a", "a"]))
    assert np.isnan(correlation_ratio([1.0, 2.0], ["a", "b"]))
