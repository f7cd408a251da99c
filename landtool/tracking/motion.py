"""How a platform may move, seen from the world or from a drone that keeps itself above it.

A state is x = (x, y, vx, vy, ...) in the reference frame, m and m/s, and what else must be known to predict it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from landtool.geometry import Array
from landtool.tracking import kalman
from landtool.tracking.config import TrackerConfig
from landtool.tracking.linear import over
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.mixture import Belief, Step, begun
from landtool.tracking.vertical import Vertical
from landtool.types import Reference

_STEPS_KEPT = 64  # of different lengths: a steady recording has few, one horizon each
_BOTH = np.eye(2)  # an axis is like the other: matrices of one, for both

# World: a platform that drives steadily changes its velocity by so much over the root of a second ...
_STEADY_DENSITY = 0.5**2 / 30.0  # m^2/s^3
# ... and one in a manoeuvre keeps its acceleration for about this long
_MANOEUVRE_S = 2.0
_FORGET_S, _FORGOTTEN_MPS2 = 0.1, 0.01  # the acceleration of a platform that drives steadily
_CHANGES_PER_S = 0.3  # from one way of moving to the other

# Body: speed of a drone that keeps itself above the platform, and how long it keeps it
_HOLD_MPS, _HOLD_S = 0.5, 1.5
# attitude of a multirotor in the wind and at work: rate of its swing, damping, and sigma of its turning
_SWING_RADPS, _SWING_DAMPING, _SWING_SIGMA_RADPS = 2.0, 0.7, 0.045


class Motion(ABC):
    """Ways of moving: M of them, with n states each."""

    weights: Array
    """(M,) the probability of each at first."""
    learnt: Array | None = None
    """(n,) 1 for a state that is estimated, 0 for one whose uncertainty is only considered; None: all are."""

    def __init__(self) -> None:
        self.step = lru_cache(maxsize=_STEPS_KEPT)(self._step)

    @abstractmethod
    def _step(self, dt_s: float) -> Step:
        """Return how the state changes over a time."""

    @abstractmethod
    def begin(self, seen: PlanarMeasurement, age_s: float) -> Belief:
        """Return what is known after a first measurement, `age_s` after the first of the drone's own poses."""

    @abstractmethod
    def sight(self, seen: PlanarMeasurement) -> Array:
        """Return H (2, n) of a measurement like this one."""

    @abstractmethod
    def output(self, height: Vertical) -> Array:
        """Return (4, n): place and velocity in the reference frame, from the state."""


class ConstantVelocity(Motion):
    """The paper's: over each step the acceleration is a new random constant. n = 4, M = 1."""

    weights = np.ones(1)

    def __init__(self, config: TrackerConfig) -> None:
        super().__init__()
        self._config = config

    def _step(self, dt_s: float) -> Step:
        G = kalman.noise_gain(dt_s)
        # Q = sigma^2 G G^T
        Q = self._config.accel_sigma_mps2**2 * (G @ G.T)
        return Step(kalman.transition(dt_s)[None], Q[None], np.eye(1))

    def begin(self, seen: PlanarMeasurement, _: float) -> Belief:
        """Return a platform at rest, give or take."""
        rest = self._config.init_velocity_sigma_mps**2 * np.eye(2)
        return begun(seen.xy_m, seen.covariance, kalman.H_POSITION, rest, self.weights)

    def sight(self, _: PlanarMeasurement) -> Array:
        """Return H of a position."""
        return kalman.H_POSITION

    def output(self, _: Vertical) -> Array:
        """Return the whole state."""
        return kalman.H_PAPER


class WorldMotion(Motion):
    """A platform in the world that drives steadily or manoeuvres, seen from a drone that knows its own pose nearly.

    n = 11: place, velocity, acceleration (two each), the constant error of the drone's attitude about its own axes
    (three, rad), the drift of its place (two). M = 2.
    """

    weights = np.array([0.5, 0.5])
    # the bias looks like a velocity of the platform while the drone comes down: estimates of it are worse than none
    learnt = np.array([1.0] * 6 + [0.0] * 3 + [1.0] * 2)

    def __init__(self, config: TrackerConfig) -> None:
        super().__init__()
        self._config = config
        self._bias_rad = math.radians(config.ego_attitude_bias_deg)
        steady = _axis(_FORGET_S, velocity_density=_STEADY_DENSITY, sigma_mps2=_FORGOTTEN_MPS2)
        # Singer's model: a' = -a / T + w, of variance sigma^2
        manoeuvre = _axis(_MANOEUVRE_S, velocity_density=0.0, sigma_mps2=config.accel_sigma_mps2, carried=True)
        self._ways = [self._with_errors(*way) for way in (steady, manoeuvre)]

    def _with_errors(self, A: Array, W: Array) -> tuple[Array, Array]:
        """Return A and W (11, 11) of two axes and the errors of the drone's poses."""
        drift = self._config.ego_drift_m**2
        return _diagonal(_for_both(A), np.zeros((5, 5))), _diagonal(
            _for_both(W), np.diag([0.0, 0.0, 0.0, drift, drift])
        )

    def _step(self, dt_s: float) -> Step:
        return _step_of(self._ways, dt_s)

    def begin(self, seen: PlanarMeasurement, age_s: float) -> Belief:
        """Return a platform at rest, give or take."""
        config = self._config
        variances = [config.init_velocity_sigma_mps**2] * 2 + [config.accel_sigma_mps2**2] * 2
        variances += [self._bias_rad**2] * 3 + [config.ego_drift_m**2 * age_s] * 2
        return begun(seen.xy_m, seen.covariance, self.sight(seen), np.diag(variances), self.weights)

    def sight(self, seen: PlanarMeasurement) -> Array:
        """Return H: z = p + L b + d."""
        return np.hstack([_BOTH, np.zeros((2, 4)), seen.lever_m, _BOTH])

    def output(self, _: Vertical) -> Array:
        """Return place and velocity, without the errors."""
        return np.eye(4, 11)


class BodyMotion(Motion):
    """A platform below a drone of unknown motion, which follows it and swings: z = r + h q in the body's axes.

    n = 8: place r, velocity, where the drone's attitude q points to (two, rad; h is the height) and its rate. M = 1.
    """

    weights = np.ones(1)

    def __init__(self, config: TrackerConfig) -> None:
        super().__init__()
        self._config = config
        A = np.zeros((4, 4))
        A[0, 1] = A[2, 3] = 1.0
        # v' = -v / T + w: velocities of variance sigma^2
        A[1, 1] = -1.0 / _HOLD_S
        # q'' = -o^2 q - 2 d o q' + w: turning of variance sigma^2
        A[3, 2:] = -(_SWING_RADPS**2), -2.0 * _SWING_DAMPING * _SWING_RADPS
        swung = 4.0 * _SWING_DAMPING * _SWING_RADPS * _SWING_SIGMA_RADPS**2
        W = np.diag([0.0, 2.0 * _HOLD_MPS**2 / _HOLD_S, 0.0, swung])
        self._ways = [(_for_both(A), _for_both(W))]

    def _step(self, dt_s: float) -> Step:
        return _step_of(self._ways, dt_s)

    def begin(self, seen: PlanarMeasurement, _: float) -> Belief:
        """Return a platform at rest below a level drone, give or take."""
        # sigma_q = sigma_q' / o, of a swing in balance with what drives it
        angle = _SWING_SIGMA_RADPS / _SWING_RADPS
        variances = [self._config.init_velocity_sigma_mps**2] * 2 + [angle**2] * 2 + [_SWING_SIGMA_RADPS**2] * 2
        return begun(seen.xy_m, seen.covariance, self.sight(seen), np.diag(variances), self.weights)

    def sight(self, seen: PlanarMeasurement) -> Array:
        """Return H: z = r + h q."""
        return np.hstack([_BOTH, np.zeros((2, 2)), -seen.z_m * _BOTH, np.zeros((2, 2))])

    def output(self, height: Vertical) -> Array:
        """Return r + h q and its rate v + h q' + h' q."""
        h, rate = -height.z_m * _BOTH, -height.rate_mps * _BOTH
        none = np.zeros((2, 2))
        return np.block([[_BOTH, none, h, none], [none, _BOTH, rate, h]])


def motion_of(config: TrackerConfig, reference: Reference) -> Motion:
    """Return how the platform moves in a reference frame."""
    if config.motion == "constant-velocity" or config.measurement == "paper":
        return ConstantVelocity(config)
    return WorldMotion(config) if reference == "world" else BodyMotion(config)


def _axis(
    acceleration_s: float, *, velocity_density: float, sigma_mps2: float, carried: bool = False
) -> tuple[Array, Array]:
    """Return A and W (3, 3) of place, velocity and an acceleration that lasts; `carried`: that moves the platform."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, float(carried)], [0.0, 0.0, -1.0 / acceleration_s]])
    return A, np.diag([0.0, velocity_density, 2.0 * sigma_mps2**2 / acceleration_s])


def _for_both(axis: Array) -> Array:
    return np.asarray(np.kron(axis, _BOTH), dtype=np.float64)


def _diagonal(a: Array, b: Array) -> Array:
    return np.block([[a, np.zeros((len(a), len(b)))], [np.zeros((len(b), len(a))), b]])


def _step_of(ways: Sequence[tuple[Array, Array]], dt_s: float) -> Step:
    F, Q = zip(*(over(A, W, dt_s) for A, W in ways), strict=True)
    if len(ways) == 1:
        return Step(np.stack(F), np.stack(Q), np.eye(1))
    # two that change into each other at one rate: pi = (1 + exp(-2 r dt)) / 2 to stay
    change = 0.5 * (1.0 - math.exp(-2.0 * _CHANGES_PER_S * dt_s))
    return Step(np.stack(F), np.stack(Q), np.array([[1.0 - change, change], [change, 1.0 - change]]))
