"""A drone's flight as it was flown: its pose, velocity and turning at any time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array, Pose, rotation_from_rotvec, rotvec_from_rotation
from landtool.synth.clips.curve import Curve
from landtool.synth.clips.platform import Level

STEP_S = 1.0 / 200.0
_TURN_S = 2e-4  # over which the turning is measured; vibration lasts a hundred times as long


@dataclass(frozen=True, eq=False)
class Flight:
    """The states of a flight every STEP_S from start_s on, in a level world with z up.

    positions_m, velocities_mps, accelerations_mps2: (N, 3); the acceleration is that of the step that follows. tilts,
    tilt_rates: (N,) the body's z axis leans by |tilt| rad towards the direction x + iy of it. yaws_rad, yaw_rates: (N,)
    of the body before it leans. thrusts_mps2: (N,) along the body's z axis. shake: small turns about the body's axes,
    rad.
    """

    start_s: float
    positions_m: Array
    velocities_mps: Array
    accelerations_mps2: Array
    thrusts_mps2: Array
    tilts: Level
    tilt_rates: Level
    yaws_rad: Array
    yaw_rates: Array
    shake: tuple[Curve, Curve, Curve]

    @property
    def end_s(self) -> float:
        """Until when it is known."""
        return self.start_s + (len(self.yaws_rad) - 1) * STEP_S

    def world_T_body(self, t_s: float) -> Pose:
        """Return the body's pose at a time. Raises ValueError for times outside the flight."""
        i, u = self._place(t_s)
        place = _hermite(self.positions_m[i : i + 2], self.velocities_mps[i : i + 2], u)
        return Pose(self._rotation(t_s), np.asarray(place))

    def velocity_mps(self, t_s: float) -> Array:
        """Return the body's velocity (3,) in the world at a time. Raises as `world_T_body`."""
        i, u = self._place(t_s)
        # accelerations are constant over a step
        velocity: Array = (1.0 - u) * self.velocities_mps[i] + u * self.velocities_mps[i + 1]
        return velocity

    def rate_radps(self, t_s: float) -> Array:
        """Return how the body turns (3,), rad/s about its own axes. Raises as `world_T_body`."""
        before, after = (self._rotation(t_s + d) for d in (-_TURN_S, _TURN_S))
        return rotvec_from_rotation(before.T @ after) / (2.0 * _TURN_S)

    def _rotation(self, t_s: float) -> Array:
        i, u = self._place(t_s)
        lean = complex(_hermite(self.tilts[i : i + 2], self.tilt_rates[i : i + 2], u))
        yaw = float(_hermite(self.yaws_rad[i : i + 2], self.yaw_rates[i : i + 2], u))
        trembling = np.array([float(axis.at(t_s)) for axis in self.shake])
        rotation: Array = leaning(lean, yaw) @ rotation_from_rotvec(trembling)
        return rotation

    def _place(self, t_s: float) -> tuple[int, float]:
        """Return the step in which a time lies, and its share of the step."""
        steps, last = (t_s - self.start_s) / STEP_S, len(self.yaws_rad) - 1
        if not -1e-6 <= steps <= last + 1e-6:
            raise ValueError(f"{t_s} s is outside the flight of {self.start_s} to {self.end_s} s")
        i = min(max(int(steps), 0), last - 1)
        return i, steps - i


def leaning(tilt: complex, yaw_rad: float) -> Array:
    """Return the rotation world_R_body (3, 3) of a body turned by its yaw, then leaning towards the direction tilt."""
    # a turn about the level axis to the left of the direction: z goes towards it
    lean = rotation_from_rotvec([-tilt.imag, tilt.real, 0.0])
    rotation: Array = lean @ rotation_from_rotvec([0.0, 0.0, yaw_rad])
    return rotation


def _hermite(values: NDArray[np.inexact], rates: NDArray[np.inexact], u: float) -> NDArray[np.inexact]:
    """Return the cubic between two values (2, ...) with their rates, at a share u of the step."""
    v, w = u * u * (3.0 - 2.0 * u), u * (1.0 - u) * STEP_S
    cubic: NDArray[np.inexact] = np.asarray(
        (1.0 - v) * values[0] + v * values[1] + w * ((1.0 - u) * rates[0] - u * rates[1])
    )
    return cubic
