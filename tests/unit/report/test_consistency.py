from __future__ import annotations

import numpy as np
import pytest

from landtool.report.consistency import consistency


@pytest.mark.parametrize("dof", [2, 4])
@pytest.mark.parametrize("count", [1, 9, 40, 400])
def test_95_of_100_honest_filters_are_in_the_band(dof: int, count: int) -> None:
    draws = np.random.default_rng(5).chisquare(dof, (600, count))
    verdicts = [consistency(nis, dof) for nis in draws]
    honest = [v is not None and v.confidence == "as_sure_as_it_should_be" for v in verdicts]
    # 600 tries of 0.95: sigma 0.009
    assert np.mean(honest) == pytest.approx(0.95, abs=0.035)


def test_says_who_is_too_sure_and_who_too_careful() -> None:
    nis = np.random.default_rng(6).chisquare(2, 300)
    words = [v.confidence for scale in (2.0, 1.0, 0.5) if (v := consistency(scale * nis, 2)) is not None]
    assert words == ["over_confident", "as_sure_as_it_should_be", "too_careful"]


def test_expects_the_median_of_chi_square() -> None:
    judged = consistency(np.array([1.0]), 2)
    assert judged is not None
    assert judged.expected == pytest.approx(1.386294, abs=1e-6)


def test_nothing_is_judged_without_a_measurement() -> None:
    assert consistency(np.array([]), 2) is None
