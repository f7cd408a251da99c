"""The mixture filter against filterpy's, and its laws."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter

from landtool.geometry import Array
from landtool.tracking import kalman, mixture
from landtool.tracking.kalman import H_POSITION, KalmanState
from landtool.tracking.linear import over
from landtool.tracking.mixture import Belief, Step

R = np.diag([0.01, 0.02])


def steps(dt_s: float) -> Step:
    F = kalman.transition(dt_s)
    G = kalman.noise_gain(dt_s)
    return Step(np.stack([F, F]), np.stack([0.01 * G @ G.T, 4.0 * G @ G.T]), np.array([[0.95, 0.05], [0.1, 0.9]]))


def begun(rng: np.random.Generator) -> Belief:
    covariances = np.stack([np.diag([0.1, 0.1, 4.0, 4.0]), np.diag([0.2, 0.1, 1.0, 2.0])])
    return Belief(np.array([0.6, 0.4]), rng.normal(size=(2, 4)), covariances)


def oracle(belief: Belief, step: Step) -> IMMEstimator:
    filters = []
    for mean, covariance, F, Q in zip(belief.means, belief.covariances, step.F, step.Q, strict=True):
        one = KalmanFilter(dim_x=4, dim_z=2)
        one.x, one.P, one.F, one.Q, one.H, one.R = mean.copy(), covariance.copy(), F, Q, H_POSITION, R
        filters.append(one)
    return IMMEstimator(filters, belief.weights.copy(), step.switching)


def test_the_same_numbers_as_filterpy() -> None:
    rng = np.random.default_rng(1)
    belief, step = begun(rng), steps(0.1)
    other = oracle(belief, step)
    for _ in range(50):
        z = rng.normal(size=2) * 0.3
        other.predict()
        other.update(z)
        belief, _ = mixture.updated(mixture.advanced(belief, step), z, H_POSITION, R)
        np.testing.assert_allclose(belief.weights, other.mu, rtol=1e-6)
        mean, covariance = mixture.collapsed(belief)
        np.testing.assert_allclose(mean, other.x, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(covariance, other.P, rtol=1e-7, atol=1e-9)


def test_with_one_way_of_moving_it_is_the_kalman_filter() -> None:
    rng = np.random.default_rng(2)
    state = KalmanState(rng.normal(size=4), np.diag([0.1, 0.2, 1.0, 2.0]))
    belief = Belief(np.ones(1), state.mean[None], state.covariance[None])
    for dt_s in rng.uniform(0.01, 0.3, 50):
        G = kalman.noise_gain(dt_s)
        step = Step(kalman.transition(dt_s)[None], 4.0 * (G @ G.T)[None], np.eye(1))
        z = rng.normal(size=2)
        expected = mixture.compared(mixture.advanced(belief, step), z, H_POSITION, R)
        belief, new = mixture.updated(mixture.advanced(belief, step), z, H_POSITION, R)
        state, other = kalman.update(kalman.predict(state, dt_s, 2.0), z, H_POSITION, R)
        np.testing.assert_allclose(belief.means[0], state.mean, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(belief.covariances[0], state.covariance, rtol=1e-10, atol=1e-12)
        assert new.nis == pytest.approx(other.nis) == expected.nis


def test_a_way_of_moving_that_was_wrong_for_long_comes_back() -> None:
    belief, step = begun(np.random.default_rng(3)), steps(0.1)
    for k in range(300):
        z = np.array([0.01 * k, 0.0]) if k < 200 else np.array([2.0 + 2.0 * (0.1 * (k - 200)) ** 2, 0.0])
        belief, _ = mixture.updated(mixture.advanced(belief, step), z, H_POSITION, R)
        if k == 199:
            assert belief.weights[0] > 0.7
        if k == 215:
            assert belief.weights[1] > 0.75
    assert belief.weights.sum() == pytest.approx(1.0)


def test_beginning_counts_what_the_sight_is_not_sure_of() -> None:
    rng = np.random.default_rng(4)
    L: Array = rng.normal(size=(2, 3))
    rest = np.diag([1.0, 4.0, 9.0])
    H = np.hstack([np.eye(2), L])
    belief = mixture.begun(np.array([1.0, 2.0]), R, H, rest, np.ones(1))
    # what is measured again must be as sure as the measurement was
    np.testing.assert_allclose(H @ belief.covariances[0] @ H.T, R, atol=1e-12)
    np.testing.assert_allclose(belief.covariances[0][2:, 2:], rest)


@pytest.mark.parametrize("dt_s", [1e-6, 1 / 30, 0.7, 60.0])
def test_linear_motion_over_any_time_is_that_over_its_halves(dt_s: float) -> None:
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -10.0]])
    W = np.diag([0.0, 0.1, 3.0])
    F, Q = over(A, W, dt_s)
    half_F, half_Q = over(A, W, dt_s / 2)
    np.testing.assert_allclose(F, half_F @ half_F, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(Q, half_F @ half_Q @ half_F.T + half_Q, rtol=1e-9, atol=1e-15)
    # Singer's acceleration: decays, and its variance is in balance
    assert F[2, 2] == pytest.approx(np.exp(-10.0 * dt_s))
    assert Q[2, 2] == pytest.approx(3.0 / 20.0 * -np.expm1(-20.0 * dt_s))


def test_white_acceleration_is_known_in_closed_form() -> None:
    F, Q = over(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, 2.0]), 0.3)
    np.testing.assert_allclose(F, [[1.0, 0.3], [0.0, 1.0]])
    np.testing.assert_allclose(Q, 2.0 * np.array([[0.3**3 / 3, 0.3**2 / 2], [0.3**2 / 2, 0.3]]))


def test_what_is_only_considered_is_not_learnt_but_counted() -> None:
    rng = np.random.default_rng(5)
    H = np.hstack([np.eye(2), 5.0 * np.eye(2)])
    learnt = np.array([1.0, 1.0, 0.0, 0.0])
    begun_at = mixture.begun(np.zeros(2), R, H, 0.01 * np.eye(2), np.ones(1))
    belief = begun_at
    for _ in range(200):
        belief, _ = mixture.updated(belief, rng.normal(size=2) * 0.1, H, R, learnt)
    np.testing.assert_array_equal(belief.means[0, 2:], np.zeros(2))
    np.testing.assert_array_equal(belief.covariances[0, 2:, 2:], 0.01 * np.eye(2))
    # the place is never surer than what the error moves it by
    assert np.diag(belief.covariances[0])[:2] == pytest.approx(np.full(2, 25.0 * 0.01), rel=0.02)
