"""Which of a plane's two poses is the true one, decided over time.

The two are mirror images about the line of sight, and far away nothing in one picture tells them apart. Over time
something does: the true one turns as the drone and the platform can turn, fits the corners a little better on
average, and does not tip the platform over. This is the forward pass of a hidden Markov model with two states, in
negative log likelihoods (Viterbi, 1967):

    cost_t(i) = fit_t(i) + prior_t(i) + min_j [ cost_t-1(j) + turn(i, j) ]
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose, rotvec_from_rotation
from landtool.tags.pose import Solution

# Corner errors repeat from frame to frame, so a frame is worth less than its chi-square says, and never everything.
_FIT_WORTH = 0.5
_MOST_FIT = 12.0
_MOST_COST = 40.0
# Where the drone's own attitude is not known its rotation counts as the pad's: rad/s, one sigma.
_TURN_RATE_BODY_RADPS = 1.0
_TURN_RATE_WORLD_RADPS = 0.3
_TILT_BODY_RAD = math.radians(15.0)
_TILT_WORLD_RAD = math.radians(8.0)
# How long one look at the horizon stays valid: the prior counts once in this time, not once a frame.
_TILT_TIME_S = 1.0
_FORGET_S = 10.0
_NEW_START_S = 2.0


@dataclass(frozen=True, eq=False)
class _Hypothesis:
    cost: float
    reference_R_pad: Array
    spread: Array  # (3, 3) covariance of the rotation, reference frame, rad^2


class SolutionChooser:
    """Keeps what is known of the pad's orientation from frame to frame.

    body_T_camera: the camera's mount; a pad that lies flat under a level drone is the prior.
    """

    def __init__(self, body_T_camera: Pose) -> None:
        self._body_T_camera = body_T_camera
        self._last: tuple[_Hypothesis, ...] = ()
        self._last_ns: int | None = None
        self._in_world = False

    @property
    def costs(self) -> tuple[float, ...]:
        """Of the last solutions, in their order: negative log likelihoods, the least is 0."""
        return tuple(hypothesis.cost for hypothesis in self._last)

    def choose(self, solutions: Sequence[Solution], t_ns: int | None, world_T_body: Pose | None) -> int:
        """Return the index of the solution to believe; `solutions` holds one or two, the better fit first.

        t_ns: the frame's time; without a clock nothing is known of the past and the frame stands alone.
        world_T_body: the drone's attitude, where it is known.
        """
        reference_T_camera = (world_T_body or Pose.identity()) @ self._body_T_camera
        dt_s = self._elapsed(t_ns, world_T_body is not None)
        best_fit = solutions[0].chi2
        now = []
        for solution in solutions:
            rotation = reference_T_camera.rotation @ solution.camera_T_pad.rotation
            spread = reference_T_camera.rotation @ solution.covariance[3:, 3:] @ reference_T_camera.rotation.T
            fit = min(0.5 * _FIT_WORTH * (solution.chi2 - best_fit), _MOST_FIT)
            cost = fit + self._tilt_cost(rotation, spread, dt_s) + self._past_cost(rotation, spread, dt_s)
            now.append(_Hypothesis(cost, rotation, spread))
        least = min(h.cost for h in now)
        self._last = tuple(_Hypothesis(min(h.cost - least, _MOST_COST), h.reference_R_pad, h.spread) for h in now)
        self._last_ns = t_ns
        return min(range(len(now)), key=lambda i: now[i].cost)

    def reset(self) -> None:
        """Forget the past, as when the track is lost."""
        self._last, self._last_ns = (), None

    def _elapsed(self, t_ns: int | None, in_world: bool) -> float | None:
        """Seconds since the last frame, None where the past says nothing."""
        known = t_ns is not None and self._last_ns is not None and in_world == self._in_world
        dt_s = (t_ns - self._last_ns) * 1e-9 if known and t_ns is not None and self._last_ns is not None else None
        self._in_world = in_world
        if dt_s is None or not -_NEW_START_S < dt_s < _NEW_START_S:
            self.reset()
            return None
        return abs(dt_s)

    def _tilt_cost(self, rotation: Array, spread: Array, dt_s: float | None) -> float:
        sigma = _TILT_WORLD_RAD if self._in_world else _TILT_BODY_RAD
        up = np.clip(rotation[2, 2], -1.0, 1.0)  # the pad's normal along the reference's z
        variance = sigma**2 + float(np.trace(spread)) / 3.0
        share = 1.0 if dt_s is None else min(dt_s / _TILT_TIME_S, 1.0)
        return share * 0.5 * float(np.arccos(up)) ** 2 / variance

    def _past_cost(self, rotation: Array, spread: Array, dt_s: float | None) -> float:
        if dt_s is None or not self._last:
            return 0.0
        rate = _TURN_RATE_WORLD_RADPS if self._in_world else _TURN_RATE_BODY_RADPS
        keep = math.exp(-dt_s / _FORGET_S)
        costs = []
        for past in self._last:
            turn = rotvec_from_rotation(rotation @ past.reference_R_pad.T)
            variance = spread + past.spread + (rate * dt_s) ** 2 * np.eye(3)
            costs.append(keep * past.cost + 0.5 * float(turn @ np.linalg.solve(variance, turn)))
        return min(costs)
