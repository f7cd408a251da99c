"""From measured places, frame by frame, to tracks with a life of their own.

A track is tentative until enough of its first frames measured it, then confirmed, and coasting while it is not
measured. It ends after `coast_s` without a measurement; the next measurement begins a track with a new number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from landtool.errors import UsageError
from landtool.geometry import Array
from landtool.tracking import kalman
from landtool.tracking.kalman import Innovation, KalmanState
from landtool.types import Reference, Track, TrackState

MeasurementModel = Literal["position", "paper"]

# The least and the most each number of a TrackerConfig may be
BOUNDS: dict[str, tuple[float, float]] = {
    "accel_sigma_mps2": (1e-3, 1e3),
    "init_velocity_sigma_mps": (1e-3, 1e3),
    "gate_probability": (0.5, 0.999999),
    "confirm_hits": (1, 1000),
    "confirm_window": (1, 1000),
    "replace_hits": (1, 1000),
    "coast_s": (0.0, 3600.0),
    "backward_s": (0.0, 3600.0),
    "horizon_s": (0.0, 60.0),
    "ego_position_sigma_m": (0.0, 100.0),
    "ego_attitude_sigma_deg": (0.0, 90.0),
}


@dataclass(frozen=True)
class TrackerConfig:
    """How the platform is expected to move, and when a track is believed. Raises UsageError outside `BOUNDS`."""

    # sigma of the platform's acceleration, a new random value at every step (the drone's own, too, in the body frame)
    accel_sigma_mps2: float = 2.0
    # sigma of the velocity of a track seen once: the faster, the more its second measurement may differ
    init_velocity_sigma_mps: float = 5.0
    # share of the right measurements that pass the gate on the normalised innovation squared
    gate_probability: float = 0.999
    # a tentative track is confirmed by so many measurements ...
    confirm_hits: int = 3
    # ... in so many frames, and dropped when it cannot get them any more
    confirm_window: int = 5
    # a confirmed track that is not measured any more gives way to a confirmed newer one of so many measurements
    replace_hits: int = 5
    # a track ends when its last measurement is longer ago than this
    coast_s: float = 2.0
    # a clock that steps back by no more than this stands still; by more, all tracks end
    backward_s: float = 0.1
    # how far ahead the place of the platform is predicted
    horizon_s: float = 0.5
    # how far the drone's own poses are off from frame to frame, where it is known: each direction, each axis
    ego_position_sigma_m: float = 0.01
    # the same of its attitude, which counts more the farther away the pad is
    ego_attitude_sigma_deg: float = 0.1
    # what counts as measured: the position, or the paper's position and velocity made of two positions
    measurement: MeasurementModel = "position"

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            if not low <= getattr(self, name) <= high:
                raise UsageError(f"{name} = {getattr(self, name)} is outside {low:g} to {high:g}")
        if self.confirm_hits > self.confirm_window:
            reason = f"confirm_hits = {self.confirm_hits} can never be reached in {self.confirm_window} frames"
            raise UsageError(reason, hint="raise confirm_window")
        if self.measurement not in get_args(MeasurementModel):
            known = ", ".join(get_args(MeasurementModel))
            raise UsageError(f"unknown measurement '{self.measurement}'", hint=f"known: {known}")


@dataclass(frozen=True, eq=False)
class PlanarMeasurement:
    """Where the platform was measured: xy_m (2,) in the reference frame, covariance (2, 2) in m^2.

    Raises ValueError for values that are not finite, or a covariance that is not positive definite.
    """

    xy_m: Array
    covariance: Array

    def __post_init__(self) -> None:
        xy_m = np.array(self.xy_m, dtype=np.float64).reshape(2)
        covariance = np.array(self.covariance, dtype=np.float64).reshape(2, 2)
        if not (np.isfinite(xy_m).all() and np.isfinite(covariance).all()):
            raise ValueError("a measured position or its covariance is not finite")
        if np.linalg.eigvalsh(covariance)[0] <= 0:
            raise ValueError("the covariance of a measured position is not positive definite")
        object.__setattr__(self, "xy_m", xy_m)
        object.__setattr__(self, "covariance", 0.5 * (covariance + covariance.T))


@dataclass(frozen=True, eq=False)
class _Target:
    """One track between two steps. hits: of the last `confirm_window` frames, whether each measured it."""

    track_id: int
    state: KalmanState
    born_ns: int
    hit_ns: int
    last: PlanarMeasurement
    hits: tuple[bool, ...] = (True,)
    hit_count: int = 1
    confirmed: bool = False
    nis: float | None = None

    @property
    def status(self) -> TrackState:
        if not self.confirmed:
            return "tentative"
        return "confirmed" if self.hits[-1] else "coasting"


class Tracker:
    """Follows platforms in one reference frame. Numbers of tracks grow and are never used twice by one tracker.

    note: what happened in the last step that a log should hold (a clock that stepped back, a track replaced), or "".
    """

    def __init__(self, config: TrackerConfig, reference: Reference) -> None:
        self.config = config
        self.reference = reference
        self.note = ""
        self._targets: list[_Target] = []
        self._now_ns: int | None = None
        self._next_id = 1

    def step(self, t_ns: int, measurements: Sequence[PlanarMeasurement]) -> tuple[Track, ...]:
        """Advance to `t_ns`, take in what was measured then, and return the tracks that live, oldest first.

        A repeated stamp, or one no more than `backward_s` back, is one more look at the same moment: measurements
        update, nothing is predicted. A clock further back ends all tracks, and `note` says so.
        """
        self.note = ""
        dt_s = self._advance(t_ns)
        predicted = [self._predict(target, dt_s) for target in self._targets if not self._expired(target)]
        pairs = self._associate(predicted, measurements)
        targets = [
            self._hit(target, measurements[pairs[i]]) if i in pairs else self._miss(target)
            for i, target in enumerate(predicted)
        ]
        used = set(pairs.values())
        targets += [self._begin(m) for i, m in enumerate(measurements) if i not in used]
        self._targets = self._without_replaced([target for target in targets if self._may_live(target)])
        return tuple(self._report(target) for target in self._targets)

    def reset(self) -> None:
        """End all tracks and forget the time, as before another recording."""
        self._targets, self._now_ns = [], None

    @property
    def _now(self) -> int:
        if self._now_ns is None:
            raise RuntimeError("the tracker has no time before its first step")
        return self._now_ns

    def _advance(self, t_ns: int) -> float:
        """Move the clock and return the seconds it went forward."""
        if self._now_ns is not None and t_ns < self._now_ns:
            back_s = (self._now_ns - t_ns) * 1e-9
            if back_s <= self.config.backward_s:
                return 0.0
            self.note = f"time went back by {back_s:.3f} s: all tracks end"
            self.reset()
        dt_s = 0.0 if self._now_ns is None else (t_ns - self._now_ns) * 1e-9
        self._now_ns = t_ns
        return dt_s

    def _expired(self, target: _Target) -> bool:
        return (self._now - target.hit_ns) * 1e-9 > self.config.coast_s

    def _predict(self, target: _Target, dt_s: float) -> _Target:
        return replace(target, state=kalman.predict(target.state, dt_s, self.config.accel_sigma_mps2))

    def _associate(self, targets: Sequence[_Target], measurements: Sequence[PlanarMeasurement]) -> dict[int, int]:
        """Return which target (index) takes which measurement (index): the nearest in its gate, each used once."""
        candidates = []
        for i, target in enumerate(targets):
            for j, measurement in enumerate(measurements):
                difference = kalman.innovation(target.state, *self._seen(target, measurement))
                if difference.nis <= self._gate(difference):
                    # a young track knows little, so everything is near to it: proven ones choose first
                    rank = ("confirmed", "coasting", "tentative").index(target.status)
                    candidates.append((rank, difference.nis, i, j))
        pairs: dict[int, int] = {}
        for _, _, i, j in sorted(candidates):
            if i not in pairs and j not in pairs.values():
                pairs[i] = j
        return pairs

    def _gate(self, difference: Innovation) -> float:
        return kalman.chi2_quantile(self.config.gate_probability, len(difference.y))

    def _seen(self, target: _Target, measurement: PlanarMeasurement) -> tuple[Array, Array, Array]:
        """Return z, H and R of a measurement, as the configured model makes them for this target."""
        dt_s = (self._now - target.hit_ns) * 1e-9
        if self.config.measurement == "position" or dt_s == 0.0:  # no time, no velocity
            return measurement.xy_m, kalman.H_POSITION, measurement.covariance
        last = target.last
        z, R = kalman.paper_measurement(measurement.xy_m, measurement.covariance, last.xy_m, last.covariance, dt_s)
        return z, kalman.H_PAPER, R

    def _hit(self, target: _Target, measurement: PlanarMeasurement) -> _Target:
        state, difference = kalman.update(target.state, *self._seen(target, measurement))
        hits = (*target.hits, True)[-self.config.confirm_window :]
        return replace(
            target,
            state=state,
            hit_ns=self._now,
            last=measurement,
            hits=hits,
            hit_count=target.hit_count + 1,
            confirmed=target.confirmed or sum(hits) >= self.config.confirm_hits,
            nis=difference.nis,
        )

    def _miss(self, target: _Target) -> _Target:
        return replace(target, hits=(*target.hits, False)[-self.config.confirm_window :], nis=None)

    def _begin(self, measurement: PlanarMeasurement) -> _Target:
        state = kalman.initial(measurement.xy_m, measurement.covariance, self.config.init_velocity_sigma_mps)
        track_id, self._next_id = self._next_id, self._next_id + 1
        confirmed = self.config.confirm_hits == 1
        return _Target(track_id, state, self._now, self._now, measurement, confirmed=confirmed)

    def _may_live(self, target: _Target) -> bool:
        misses = len(target.hits) - sum(target.hits)
        return target.confirmed or misses <= self.config.confirm_window - self.config.confirm_hits

    def _without_replaced(self, targets: list[_Target]) -> list[_Target]:
        """Drop coasting tracks in whose stead a newer one is measured: they follow a place the platform left.

        Only a track begun after the old one's last measurement can be its successor, so two platforms measured side
        by side keep their tracks when one of them is covered.
        """
        kept = []
        for old in targets:
            heirs = [new for new in targets if self._succeeds(new, old)]
            if heirs:
                self.note = f"track {old.track_id} gives way to track {heirs[0].track_id}"
            else:
                kept.append(old)
        return kept

    def _succeeds(self, new: _Target, old: _Target) -> bool:
        proven = new.status == "confirmed" and new.hit_count >= self.config.replace_hits
        return proven and old.status == "coasting" and new.born_ns > old.hit_ns

    def _report(self, target: _Target) -> Track:
        state, horizon_s = target.state, self.config.horizon_s
        ahead = (kalman.transition(horizon_s) @ state.mean)[:2]
        return Track(
            target.track_id,
            target.status,
            self.reference,
            state.mean,
            state.covariance,
            target.nis,
            horizon_s,
            ahead,
        )
