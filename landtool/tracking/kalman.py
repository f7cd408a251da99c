"""The paper's Kalman filter: a platform's planar position and velocity, with its acceleration as noise.

State x = (x, y, vx, vy), metres and metres per second. All functions are pure and take the step dt they are asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array

# H of a measured position: z = (x, y)
H_POSITION: Array = np.eye(2, 4)
# H of the paper: z = (x, y, vx, vy)
H_PAPER: Array = np.eye(4)


@dataclass(frozen=True, eq=False)
class KalmanState:
    """What is known about the platform at one moment.

    mean: (4,) x, y in m and vx, vy in m/s. covariance: (4, 4), symmetric.
    """

    mean: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Innovation:
    """How a measurement differs from what was predicted.

    y: (m,) z - H x'. S: (m, m) its covariance. nis: y^T S^-1 y, chi-square distributed with m degrees of freedom.
    """

    y: Array
    S: Array
    nis: float


def initial(xy_m: Array, covariance: Array, velocity_sigma_mps: float) -> KalmanState:
    """Return the state after a first position (2,), covariance (2, 2): at rest, give or take `velocity_sigma_mps`."""
    P = np.zeros((4, 4))
    P[:2, :2] = covariance
    P[2:, 2:] = velocity_sigma_mps**2 * np.eye(2)
    return KalmanState(np.array([*xy_m, 0.0, 0.0]), P)


def predict(state: KalmanState, dt_s: float, accel_sigma_mps2: float) -> KalmanState:
    """Return the state `dt_s` later; over each step the acceleration is a new random constant of that sigma."""
    A, G = transition(dt_s), noise_gain(dt_s)
    # x' = A x,  P' = A P A^T + G Q G^T,  Q = sigma^2 I
    P = A @ state.covariance @ A.T + accel_sigma_mps2**2 * (G @ G.T)
    return KalmanState(A @ state.mean, P)


def transition(dt_s: float) -> Array:
    """Return A (4, 4): constant velocity over `dt_s`."""
    # A = [[1,0,dt,0],[0,1,0,dt],[0,0,1,0],[0,0,0,1]]
    A = np.eye(4)
    A[0, 2] = A[1, 3] = dt_s
    return A


def noise_gain(dt_s: float) -> Array:
    """Return G (4, 2): what a constant acceleration does to the state over `dt_s`."""
    # G = [[dt^2/2,0],[0,dt^2/2],[dt,0],[0,dt]]
    return np.vstack([0.5 * dt_s**2 * np.eye(2), dt_s * np.eye(2)])


def innovation(state: KalmanState, z: Array, H: Array, R: Array) -> Innovation:
    """Compare a measurement z (m,) of covariance R (m, m), seen through H (m, 4), with the predicted state."""
    # y = z - H x',  S = H P' H^T + R
    y = z - H @ state.mean
    S = H @ state.covariance @ H.T + R
    return Innovation(y, S, float(y @ np.linalg.solve(S, y)))


def update(state: KalmanState, z: Array, H: Array, R: Array) -> tuple[KalmanState, Innovation]:
    """Return the state that knows the measurement too, and how the measurement differed."""
    new = innovation(state, z, H, R)
    # K = P' H^T S^-1, by a solve: S and P' are symmetric
    K = np.linalg.solve(new.S, H @ state.covariance).T
    # x = x' + K (z - H x'); the paper's eq. 12 drops the prediction from the first term
    x = state.mean + K @ new.y
    # P = (I - K H) P' (I - K H)^T + K R K^T: Joseph's form of (I - K H) P', which rounding cannot make indefinite
    left = np.eye(4) - K @ H
    P = left @ state.covariance @ left.T + K @ R @ K.T
    return KalmanState(x, 0.5 * (P + P.T)), new


def paper_measurement(
    xy_m: Array, covariance: Array, last_xy_m: Array, last_covariance: Array, dt_s: float
) -> tuple[Array, Array]:
    """Return the paper's z (4,) and its R (4, 4): a position, and the velocity made of it and the one `dt_s` before.

    The velocity's noise is that of both positions, and shares this position's: R is no diagonal. It also shares the
    last position's noise, which the state holds already and no Kalman filter accounts for; hence the position alone
    is landtool's default.
    """
    # v = (z_k - z_k-1) / dt: var v = (R_k + R_k-1) / dt^2, cov(z_k, v) = R_k / dt
    shared = covariance / dt_s
    R = np.block([[covariance, shared], [shared, (covariance + last_covariance) / dt_s**2]])
    return np.concatenate([xy_m, (xy_m - last_xy_m) / dt_s]), R


def chi2_quantile(probability: float, dof: int) -> float:
    """Return the value a chi-square variable of 2 or 4 degrees of freedom stays below with this probability."""
    # 2: p = 1 - exp(-q/2)
    q = -2.0 * math.log1p(-probability)
    if dof == 2:
        return q
    if dof != 4:
        raise ValueError(f"{dof} degrees of freedom: the quantile is known for 2 and 4")
    # 4: 1 - p = exp(-q/2) (1 + q/2), by the fixed point q = -2 ln(1 - p) + 2 ln(1 + q/2), a contraction for q > 0
    for _ in range(200):
        q = -2.0 * math.log1p(-probability) + 2.0 * math.log1p(0.5 * q)
    return q
