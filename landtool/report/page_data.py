"""What the page of plots is drawn from, gathered while the results go by; memory does not grow with their number."""

from __future__ import annotations

import numpy as np

from landtool.report.follow import Follower, Moment
from landtool.report.series import Series
from landtool.types import FrameResult, Reference

# The numbers that stand for names in a series; the larger the worse, where a row takes over the worst of others
METHODS = {"box": 1.0, "target": 2.0, "tag": 3.0}
STAGES = {"far": 1.0, "near": 2.0}
STATES = {"confirmed": 1.0, "coasting": 2.0, "tentative": 3.0}
DAMAGED, LOST = 1.0, 2.0
_FRAME_COLUMNS = (
    *("at", "distance_m", "method", "lateral_m", "vx_mps", "vy_mps", "vx_sigma_mps", "vy_sigma_mps", "nis"),
    *("stage", "altitude_m", "state", "trouble"),
)


class PageData:
    """The series of one recording.

    frames: a row a frame. `at` is its time in seconds since the first one, or its number where there is no clock;
    method, stage and state are the numbers of the tables above, unknown where there is none; trouble is 0, DAMAGED or
    LOST. residuals: a row a prediction whose time has come, `sigma_m` the mean of both directions.
    count: frames so far. has_clock: whether frames carry times. reference: of the lateral errors, None before one.
    """

    def __init__(self, *, has_clock: bool = True) -> None:
        self.frames = Series(_FRAME_COLUMNS, worst=("trouble",))
        self.residuals = Series(("at", "x_m", "y_m", "sigma_m"))
        self.count = 0
        self.has_clock = has_clock
        self.reference: Reference | None = None
        self._follower = Follower()

    @property
    def horizon_s(self) -> float | None:
        """How far ahead the residuals' predictions were made."""
        return self._follower.horizon_s

    def add(self, result: FrameResult, *, lost: bool) -> None:
        """Take one frame in. lost: there was no picture."""
        moment = self._follower.see(result)
        self.count += 1
        trouble = LOST if lost else DAMAGED if result.status == "damaged" else 0.0
        self.frames.add(
            moment.t_s if self.has_clock else result.index,
            moment.distance_m,
            None if result.pose is None else METHODS[result.pose.method],
            self._lateral(moment),
            *_velocity(moment),
            None if result.stage is None else STAGES[result.stage],
            result.altitude_m,
            None if moment.track is None else STATES[moment.track.status],
            trouble,
        )
        for residual in moment.residuals:
            x_m, y_m = residual.xy_m.tolist()
            sigma_m = None if residual.sigma_m is None else float(np.sqrt(np.mean(residual.sigma_m**2)))
            self.residuals.add(residual.t_s, x_m, y_m, sigma_m)

    def _lateral(self, moment: Moment) -> float | None:
        """Return the lateral error where it is in the plane of the first one: both in one line would be a jump."""
        self.reference = self.reference or moment.reference
        return moment.lateral_m if moment.reference == self.reference else None


def _velocity(moment: Moment) -> tuple[float | None, ...]:
    """Return vx, vy, their sigmas, m/s, and the NIS of the pad's track; unknown before it is proven."""
    track = moment.track
    if track is None or track.status == "tentative":
        return (None,) * 5
    sigma = np.sqrt(np.diag(track.covariance)[2:])
    return (*track.state[2:].tolist(), *sigma.tolist(), track.nis)
