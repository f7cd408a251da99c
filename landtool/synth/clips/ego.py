"""The drone's own odometry: its true motion with the errors of a good estimator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.synth.clips.flight import Flight

PERIOD_NS = 20_000_000
MARGIN_NS = 200_000_000  # before the first picture and after the last
# drift of the place in m over a root of a second, its noise in m, noise and bias of the attitude in rad
DRIFT_M, NOISE_M, NOISE_RAD, BIAS_RAD = 0.02, 0.01, math.radians(0.1), math.radians(0.28)
NOISE_MPS, NOISE_RADPS = 0.04, 0.01


@dataclass(frozen=True, eq=False)
class Odometry:
    """One message of a drone's odometry.

    velocity_mps, rate_radps: (3,) along and about the body's axes. pose_variances: (6,) x y z in m2, turns about the
    world's axes in rad2. twist_variances: (6,) of the two velocities.
    """

    t_ns: int
    world_T_body: Pose
    velocity_mps: Array
    rate_radps: Array
    pose_variances: Array
    twist_variances: Array


@dataclass(frozen=True, eq=False)
class EgoErrors:
    """What is wrong with an odometry over time.

    t_ns: (N,) every PERIOD_NS. values: (N, 12) of the place in m, of the attitude in rad about the body's axes, of the
    velocity in m/s in the world, of the turning in rad/s.
    """

    t_ns: NDArray[np.int64]
    values: Array

    @classmethod
    def drawn(cls, last_ns: int, rng: np.random.Generator) -> EgoErrors:
        """Return errors from MARGIN_NS before time 0 to MARGIN_NS after the last picture."""
        count = 1 + math.ceil((last_ns + 2 * MARGIN_NS) / PERIOD_NS)
        t_ns = np.arange(count, dtype=np.int64) * PERIOD_NS - MARGIN_NS
        drift = np.cumsum(rng.normal(0.0, DRIFT_M * math.sqrt(PERIOD_NS / 1e9), (count, 3)), axis=0)
        place = drift + rng.normal(0.0, NOISE_M, (count, 3))
        attitude = rng.normal(0.0, BIAS_RAD, 3) + rng.normal(0.0, NOISE_RAD, (count, 3))
        speed, turning = rng.normal(0.0, NOISE_MPS, (count, 3)), rng.normal(0.0, NOISE_RADPS, (count, 3))
        return cls(t_ns, np.hstack([place, attitude, speed, turning]))

    def odometry(self, flight: Flight, t_ns: int) -> Odometry:
        """Return what the drone says of itself at a time within the errors' own; between two of them their mean."""
        error = np.array([np.interp(t_ns, self.t_ns, column) for column in self.values.T])
        t_s = t_ns / 1e9
        true = flight.world_T_body(t_s)
        rotation = true.rotation @ rotation_from_rotvec(error[3:6])
        age_s = (t_ns - int(self.t_ns[0])) / 1e9
        place, turn = NOISE_M**2 + DRIFT_M**2 * age_s, NOISE_RAD**2 + BIAS_RAD**2
        return Odometry(
            t_ns,
            Pose(rotation, true.translation + error[:3]),
            rotation.T @ (flight.velocity_mps(t_s) + error[6:9]),
            flight.rate_radps(t_s) + error[9:],
            np.repeat([place, turn], 3),
            np.repeat([NOISE_MPS**2, NOISE_RADPS**2], 3),
        )
