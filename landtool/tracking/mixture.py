"""What is known about a platform that moves in one of several ways: the interacting multiple model filter.

Blom, Bar-Shalom: The interacting multiple model algorithm, IEEE Trans. Automatic Control 33 (1988). With one way of
moving it is the Kalman filter. All functions are pure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array
from landtool.tracking.kalman import Innovation

# No way of moving is ever ruled out, or it could not come back before the sum of its evidence does
_LEAST_WEIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class Belief:
    """A state for each way of moving.

    weights: (M,) the probability of each, their sum is 1. means: (M, n). covariances: (M, n, n).
    """

    weights: Array
    means: Array
    covariances: Array


@dataclass(frozen=True, eq=False)
class Step:
    """How states change over a time: F (M, n, n), the noise Q (M, n, n), and the probabilities of a change (M, M)."""

    F: Array
    Q: Array
    switching: Array


def begun(z: Array, R: Array, H: Array, rest: Array, weights: Array) -> Belief:
    """Return the belief after a first position z (2,) of covariance R (2, 2), seen through H (2, n) = (I, L).

    rest: (n - 2, n - 2), the covariance of all that is no position, its mean 0.
    """
    # p = z - L r - v: C_pp = R + L C_r L^T, C_pr = -L C_r
    L = H[:, 2:]
    P = np.block([[R + L @ rest @ L.T, -L @ rest], [-rest @ L.T, rest]])
    mean = np.concatenate([z, np.zeros(len(rest))])
    return Belief(weights, np.tile(mean, (len(weights), 1)), np.tile(P, (len(weights), 1, 1)))


def advanced(belief: Belief, step: Step) -> Belief:
    """Return the belief a time later."""
    mixed = belief if len(belief.weights) == 1 else _mixed(belief, step.switching)
    # x' = F x,  P' = F P F^T + Q
    means = (step.F @ mixed.means[..., None])[..., 0]
    return Belief(mixed.weights, means, step.F @ mixed.covariances @ step.F.swapaxes(-1, -2) + step.Q)


def _mixed(belief: Belief, switching: Array) -> Belief:
    """Return what each way of moving begins with, when the platform may have changed to it from any."""
    # c_j = sum_i pi_ij mu_i,  w_ij = pi_ij mu_i / c_j
    joint = switching * belief.weights[:, None]
    weights = joint.sum(axis=0)
    shares = (joint / weights).T
    # x_j = sum_i w_ij x_i,  P_j = sum_i w_ij (P_i + (x_i - x_j)(x_i - x_j)^T)
    means = shares @ belief.means
    off = belief.means[None] - means[:, None]
    spread = belief.covariances[None] + off[..., :, None] * off[..., None, :]
    return Belief(weights, means, np.einsum("ji,jiab->jab", shares, spread))


def compared(belief: Belief, z: Array, H: Array, R: Array) -> Innovation:
    """Compare a measurement z (m,) of covariance R (m, m), seen through H (m, n), with what is expected of it."""
    return _merged(belief.weights, *_differences(belief, z, H, R))


def updated(belief: Belief, z: Array, H: Array, R: Array, learnt: Array | None = None) -> tuple[Belief, Innovation]:
    """Return the belief that knows the measurement too, and how the measurement differed.

    learnt: (n,) 1 for states that are estimated, 0 for those whose uncertainty is only considered, as by Schmidt:
    Application of state-space methods to navigation problems, Advances in Control Systems 3 (1966).
    """
    y, S = _differences(belief, z, H, R)
    # K = P H^T S^-1, by a solve: S and P are symmetric
    K = np.linalg.solve(S, H @ belief.covariances).swapaxes(-1, -2)
    if learnt is not None:
        K = K * learnt[:, None]
    means = belief.means + (K @ y[..., None])[..., 0]
    # P = (I - K H) P (I - K H)^T + K R K^T: Joseph's form, true of any K, which rounding cannot make indefinite
    left = np.eye(H.shape[1]) - K @ H
    P = left @ belief.covariances @ left.swapaxes(-1, -2) + K @ R @ K.swapaxes(-1, -2)
    P = 0.5 * (P + P.swapaxes(-1, -2))
    return Belief(_reweighted(belief.weights, y, S), means, P), _merged(belief.weights, y, S)


def doubted(belief: Belief, factor: float) -> Belief:
    """Return the belief with its covariances times a factor, as after a move that none of the ways explains."""
    return Belief(belief.weights, belief.means, factor * belief.covariances)


def collapsed(belief: Belief) -> tuple[Array, Array]:
    """Return the mean (n,) and the covariance (n, n) over all ways of moving."""
    if len(belief.weights) == 1:
        return belief.means[0], belief.covariances[0]
    return _moments(belief.weights, belief.means, belief.covariances)


def _differences(belief: Belief, z: Array, H: Array, R: Array) -> tuple[Array, Array]:
    # y_j = z - H x_j,  S_j = H P_j H^T + R
    return z - belief.means @ H.T, H @ belief.covariances @ H.T + R


def _reweighted(weights: Array, y: Array, S: Array) -> Array:
    """Return the probabilities of the ways of moving after a measurement."""
    if len(weights) == 1:
        return weights
    # mu_j ~ c_j N(y_j; 0, S_j)
    nis = np.einsum("ja,ja->j", y, np.linalg.solve(S, y[..., None])[..., 0])
    log = np.log(weights) - 0.5 * (nis + np.linalg.slogdet(S)[1])
    likely = np.maximum(np.exp(log - log.max()), _LEAST_WEIGHT)
    return np.asarray(likely / likely.sum())


def _merged(weights: Array, y: Array, S: Array) -> Innovation:
    mean, cov = (y[0], S[0]) if len(weights) == 1 else _moments(weights, y, S)
    return Innovation(mean, cov, float(mean @ np.linalg.solve(cov, mean)))


def _moments(weights: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    # x = sum mu_j x_j,  P = sum mu_j (P_j + (x_j - x)(x_j - x)^T)
    mean = weights @ means
    off = means - mean
    return mean, np.einsum("j,jab->ab", weights, covariances + off[:, :, None] * off[:, None, :])
