"""A platform that moves smoothly: where the pad is at any time, how fast it goes, and how it turns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landtool.geometry import Array, Pose
from landtool.synth.clips.curve import Curve

Level = NDArray[np.complex128]
"""Two level coordinates as x + iy."""

_CELL_S = 0.05
_NONE = Curve()
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True, eq=False)
class PlatformMotion:
    """The pad's motion in a level world, z up; at t = 0 the pad is above the origin.

    speed: m/s along the heading, on the level. heading: of the pad's x axis about z, rad. height: of the pad, m. roll,
    pitch: of the pad about its x and y axes, rad, after the heading. hidden_s: times between which something is to
    hide the pad, None where nothing is. Defined at any time, with two continuous derivatives.
    """

    speed: Curve
    heading: Curve
    height: Curve
    roll: Curve = _NONE
    pitch: Curve = _NONE
    hidden_s: tuple[float, float] | None = None

    def positions_m(self, t_s: ArrayLike) -> Array:
        """Return the pad's places (N, 3) in the world at times (N,)."""
        t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        cell = np.trunc(t / _CELL_S)
        # the nearest whole cell towards 0 is summed up already; the rest is integrated as exactly
        level = self._at_cells(cell.astype(np.intp)) + self._travel(cell * _CELL_S, t)
        return np.column_stack([level.real, level.imag, self.height.at(t)])

    def velocities_mps(self, t_s: ArrayLike) -> Array:
        """Return the pad's velocities (N, 3) in the world at times (N,)."""
        t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        level = self._level_velocity(t)
        return np.column_stack([level.real, level.imag, self.height.rate(t)])

    def world_T_pad(self, t_s: float) -> Pose:
        """Return the pad's pose at a time."""
        return Pose(self._rotation(t_s), self.positions_m(t_s)[0])

    def rate_radps(self, t_s: float) -> Array:
        """Return how the pad turns (3,), rad/s about its own axes, at a time."""
        roll, pitch = float(self.roll.at(t_s)), float(self.pitch.at(t_s))
        yaw_rate, pitch_rate, roll_rate = (float(c.rate(t_s)) for c in (self.heading, self.pitch, self.roll))
        # of R = Rz(yaw) Ry(pitch) Rx(roll)
        return np.array(
            [
                roll_rate - yaw_rate * np.sin(pitch),
                pitch_rate * np.cos(roll) + yaw_rate * np.cos(pitch) * np.sin(roll),
                yaw_rate * np.cos(pitch) * np.cos(roll) - pitch_rate * np.sin(roll),
            ]
        )

    def _rotation(self, t_s: float) -> Array:
        c, s = (
            np.array([f(float(a.at(t_s))) for a in (self.roll, self.pitch, self.heading)]) for f in (np.cos, np.sin)
        )
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, c[0], -s[0]], [0.0, s[0], c[0]]])
        about_y = np.array([[c[1], 0.0, s[1]], [0.0, 1.0, 0.0], [-s[1], 0.0, c[1]]])
        about_z = np.array([[c[2], -s[2], 0.0], [s[2], c[2], 0.0], [0.0, 0.0, 1.0]])
        rotation: Array = about_z @ about_y @ about_x
        return rotation

    def _level_velocity(self, t: Array) -> Level:
        """Return the velocities on the level as complex numbers x + iy, any shape."""
        return np.asarray(self.speed.at(t) * np.exp(1j * self.heading.at(t)))

    def _travel(self, start: Array, end: Array) -> Level:
        """Return the way x + iy (N,) between times (N,) less than a cell apart, by Gauss and Legendre's rule."""
        half = (end - start) / 2.0
        t = (start + end)[:, None] / 2.0 + half[:, None] * _NODES
        return np.asarray(half * (self._level_velocity(t) @ _WEIGHTS))

    def _at_cells(self, cells: NDArray[np.intp]) -> Level:
        """Return the places x + iy at whole cells, negative ones too."""
        reach = int(np.abs(cells).max(initial=0)) + 1
        if len(self._sums[0]) <= reach:
            grid: Array = np.arange(2 * reach, dtype=np.float64) * _CELL_S
            self._sums[:] = [
                np.concatenate([[0.0], np.cumsum(self._travel(sign * grid, sign * (grid + _CELL_S)))])
                for sign in (1.0, -1.0)
            ]
        forward, backward = self._sums
        return np.asarray(np.where(cells >= 0, forward[np.maximum(cells, 0)], backward[np.maximum(-cells, 0)]))

    @cached_property
    def _sums(self) -> list[Level]:
        """The places at whole cells from 0 on, and from 0 back; made longer as they are asked for."""
        return [np.zeros(1, complex), np.zeros(1, complex)]
