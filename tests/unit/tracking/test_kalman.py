"""The filter's equations against filterpy's, its statistics against simulated truth."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter  # type: ignore[import-untyped]
from numpy.random import Generator
from scipy.stats import chi2  # type: ignore[import-untyped]

from landtool.geometry import Array
from landtool.tracking import kalman
from landtool.tracking.kalman import H_PAPER, H_POSITION, KalmanState


def random_covariance(rng: Generator, n: int, size: float) -> Array:
    a = rng.normal(size=(n, n))
    return np.asarray(size**2 * (a @ a.T + 0.1 * np.eye(n)), dtype=np.float64)


@pytest.mark.parametrize("H", [H_POSITION, H_PAPER])
def test_the_same_numbers_as_filterpy(H: Array) -> None:
    rng = np.random.default_rng(1)
    state = KalmanState(rng.normal(size=4), random_covariance(rng, 4, 1.0))
    oracle = KalmanFilter(dim_x=4, dim_z=len(H))
    oracle.x, oracle.P, oracle.H = state.mean.copy(), state.covariance.copy(), H
    for _ in range(200):
        dt_s, accel = rng.uniform(0.0, 0.3), rng.uniform(0.1, 5.0)
        oracle.F = np.array([[1, 0, dt_s, 0], [0, 1, 0, dt_s], [0, 0, 1, 0], [0, 0, 0, 1]])
        G = np.array([[dt_s**2 / 2, 0], [0, dt_s**2 / 2], [dt_s, 0], [0, dt_s]])
        oracle.Q = G @ (accel**2 * np.eye(2)) @ G.T
        state = kalman.predict(state, dt_s, accel)
        oracle.predict()
        np.testing.assert_allclose(state.covariance, oracle.P, rtol=1e-9, atol=1e-12)
        z, R = rng.normal(size=len(H)), random_covariance(rng, len(H), 0.3)
        state, new = kalman.update(state, z, H, R)
        oracle.update(z, R=R)
        np.testing.assert_allclose(state.mean, oracle.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(state.covariance, oracle.P, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(new.y, oracle.y, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(new.S, oracle.S, rtol=1e-9, atol=1e-9)
        assert new.nis == pytest.approx(oracle.mahalanobis**2, rel=1e-9)


def test_prediction_is_exact_for_constant_velocity_in_any_steps() -> None:
    state = kalman.initial(np.array([1.0, -2.0]), 1e-4 * np.eye(2), 3.0)
    state = KalmanState(np.array([1.0, -2.0, 0.5, 3.0]), state.covariance)
    for dt_s in (0.1, 0.0, 0.37, 0.03):
        state = kalman.predict(state, dt_s, 2.0)
    np.testing.assert_allclose(state.mean, [1.25, -0.5, 0.5, 3.0], atol=1e-12)


def test_no_time_and_no_step_change_nothing() -> None:
    state = KalmanState(np.array([1.0, 2.0, 3.0, 4.0]), random_covariance(np.random.default_rng(2), 4, 1.0))
    same = kalman.predict(state, 0.0, 5.0)
    np.testing.assert_array_equal(same.mean, state.mean)
    np.testing.assert_array_equal(same.covariance, state.covariance)


def test_covariance_stays_positive_definite_through_extremes() -> None:
    rng = np.random.default_rng(4)
    state = kalman.initial(np.zeros(2), 1e6 * np.eye(2), 1e3)
    for k in range(2000):
        state = kalman.predict(state, 10.0 if k % 50 == 0 else 1e-3, 1e-3)
        R = np.diag([1e-12, 1e-2]) if k % 2 else random_covariance(rng, 2, 1e-3)
        state, _ = kalman.update(state, rng.normal(size=2) * 1e-3, H_POSITION, R)
        np.testing.assert_array_equal(state.covariance, state.covariance.T)
        assert np.linalg.eigvalsh(state.covariance)[0] > 0


def simulate(rng: Generator, steps: int, accel: float, sigma_m: float) -> tuple[list[float], list[float]]:
    """One run of the model itself, at uneven steps; return NEES and NIS of every step."""
    truth = np.array([*rng.normal(size=2), *rng.normal(size=2) * 2.0])
    R = np.diag([sigma_m**2, 4 * sigma_m**2])
    state = kalman.initial(truth[:2] + rng.normal(size=2) * np.sqrt(np.diag(R)), R, 2.0)
    nees, nis = [], []
    for dt_s in rng.choice([1 / 60, 1 / 30, 0.1, 0.25], size=steps):
        truth = kalman.transition(dt_s) @ truth + kalman.noise_gain(dt_s) @ (accel * rng.normal(size=2))
        z = truth[:2] + rng.normal(size=2) * np.sqrt(np.diag(R))
        state = kalman.predict(state, float(dt_s), accel)
        state, new = kalman.update(state, z, H_POSITION, R)
        error = truth - state.mean
        nees.append(float(error @ np.linalg.solve(state.covariance, error)))
        nis.append(new.nis)
    return nees, nis


def test_errors_are_as_large_as_the_filter_says() -> None:
    runs, steps = 100, 60
    rng = np.random.default_rng(2026)
    results = [simulate(rng, steps, accel=1.5, sigma_m=0.02) for _ in range(runs)]
    # the errors of one run hang together, so NEES counts once a run
    nees_end = sum(nees[-1] for nees, _ in results)
    low, high = chi2.ppf([0.025, 0.975], 4 * runs)
    assert low < nees_end < high
    # innovations of a right filter are white, so NIS counts every step
    nis_all = sum(sum(nis) for _, nis in results)
    low, high = chi2.ppf([0.025, 0.975], 2 * runs * steps)
    assert low < nis_all < high
    # the band is narrow: innovations larger or smaller by a twentieth would be seen
    assert not low < nis_all * 1.05**2 < high
    assert not low < nis_all * 0.95**2 < high


@pytest.mark.parametrize("dof", [2, 4])
@pytest.mark.parametrize("p", [0.5, 0.9, 0.95, 0.99, 0.999, 0.999999])
def test_chi_square_quantiles(dof: int, p: float) -> None:
    assert kalman.chi2_quantile(p, dof) == pytest.approx(chi2.ppf(p, dof), rel=1e-10)


def test_other_degrees_of_freedom_are_refused() -> None:
    with pytest.raises(ValueError, match="3 degrees"):
        kalman.chi2_quantile(0.9, 3)


def test_the_paper_s_noise_is_that_of_a_velocity_from_two_positions() -> None:
    rng = np.random.default_rng(5)
    now, before, dt_s = random_covariance(rng, 2, 0.1), random_covariance(rng, 2, 0.2), 0.1
    z, R = kalman.paper_measurement(np.array([1.0, 2.0]), now, np.array([0.8, 2.1]), before, dt_s)
    np.testing.assert_allclose(z, [1.0, 2.0, 2.0, -1.0])
    n = 200_000
    a, b = rng.multivariate_normal([0, 0], now, n), rng.multivariate_normal([0, 0], before, n)
    sampled = np.cov(np.hstack([a, (a - b) / dt_s]).T)
    np.testing.assert_allclose(R, sampled, rtol=0.03, atol=0.03 * np.sqrt(np.outer(np.diag(R), np.diag(R))).max())
    assert np.linalg.eigvalsh(R)[0] > 0
