"""From measured places, frame by frame, to tracks with a life of their own.

A track is tentative until enough of its first frames measured it, then confirmed, and coasting while it is not
measured. It ends after `coast_s` without a measurement; the next measurement begins a track with a new number.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from landtool.geometry import Array
from landtool.tracking import kalman, mixture
from landtool.tracking.config import BOUNDS, MeasurementModel, TrackerConfig
from landtool.tracking.kalman import Innovation
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.motion import motion_of
from landtool.tracking.report import report
from landtool.tracking.target import Target
from landtool.tracking.vertical import Vertical
from landtool.types import Reference, Track

__all__ = ["BOUNDS", "Expected", "MeasurementModel", "PlanarMeasurement", "Tracker", "TrackerConfig"]

_MOMENTS_KEPT = 256  # a clock that stands still keeps no more than this of what may have to be done again


@dataclass(frozen=True, eq=False)
class Expected:
    """Where a living track would be measured: xy_m (2,), covariance (2, 2) in m^2, z_m, all in the reference frame.

    hit_ns: when it was measured last.
    """

    track_id: int
    confirmed: bool
    hit_ns: int
    xy_m: Array
    covariance: Array
    z_m: float


@dataclass(frozen=True, eq=False)
class _Moment:
    """A step that may have to be done again: what came in, and all there was before it.

    numbers: of the tracks that the measurements began, None for those that began none.
    """

    t_ns: int
    measurements: tuple[PlanarMeasurement, ...]
    targets: tuple[Target, ...]
    before_ns: int | None
    numbers: tuple[int | None, ...]


class Tracker:
    """Follows platforms in one reference frame. Numbers of tracks grow and are never used twice by one tracker.

    since_ns: from when on the drone's own place has drifted. note: what happened in the last step that a log should
    hold (a clock that stepped back, a track replaced), or "". taken: the number of the track that each of its
    measurements went to.
    """

    def __init__(self, config: TrackerConfig, reference: Reference, since_ns: int | None = None) -> None:
        self.config = config
        self.reference = reference
        self.note = ""
        self.taken: tuple[int, ...] = ()
        self.motion = motion_of(config, reference)
        self._since_ns = since_ns
        self._targets: tuple[Target, ...] = ()
        self._now_ns: int | None = None
        self._next_id = 1
        self._past: deque[_Moment] = deque(maxlen=_MOMENTS_KEPT)

    def step(self, t_ns: int, measurements: Sequence[PlanarMeasurement], lead_s: float = 0.0) -> tuple[Track, ...]:
        """Take in what was measured at `t_ns` and return the tracks that live `lead_s` later, oldest first.

        A repeated stamp is one more look at the same moment. One no more than `backward_s` back is put in at its right
        place: what came after it is done again, and its own tracks are as of its time. A clock further back ends all
        tracks, and `note` says so.
        """
        self.note = ""
        later = self._rewound(t_ns)
        self.taken = self._take(t_ns, tuple(measurements))
        tracks = tuple(report(target, self.motion, self.config, self.reference, lead_s) for target in self._targets)
        if later:
            note, taken = self.note, self.taken
            for moment in later:
                self._take(moment.t_ns, moment.measurements, moment.numbers)
            self.note, self.taken = note, taken
        return tracks

    def expected(self, t_ns: int) -> tuple[Expected, ...]:
        """Return where each living track would be measured at a time; one before the last step is that step's."""
        if self._now_ns is None:
            return ()
        dt_s = max(0.0, (t_ns - self._now_ns) * 1e-9)
        living = [target for target in self._targets if (t_ns - target.hit_ns) * 1e-9 <= self.config.coast_s]
        return tuple(self._expected(target, dt_s) for target in living)

    @property
    def living(self) -> frozenset[int]:
        """The numbers of the tracks that live."""
        return frozenset(target.track_id for target in self._targets)

    def reset(self) -> None:
        """End all tracks and forget the time, as before another recording."""
        self._targets, self._now_ns = (), None
        self._past.clear()

    @property
    def _now(self) -> int:
        if self._now_ns is None:
            raise RuntimeError("the tracker has no time before its first step")
        return self._now_ns

    def _rewound(self, t_ns: int) -> list[_Moment]:
        """Go back to before what is later than `t_ns`, and return that, to be done again."""
        if self._now_ns is None or t_ns >= self._now_ns:
            return []
        back_s = (self._now_ns - t_ns) * 1e-9
        if back_s > self.config.backward_s:
            self.note = f"time went back by {back_s:.3f} s: all tracks end"
            self.reset()
            return []
        later = [moment for moment in self._past if moment.t_ns > t_ns]
        if later:
            self._targets, self._now_ns = later[0].targets, later[0].before_ns
        for _ in later:
            self._past.pop()
        return later

    def _take(
        self, t_ns: int, measurements: tuple[PlanarMeasurement, ...], numbers: tuple[int | None, ...] = ()
    ) -> tuple[int, ...]:
        """Advance to a time, take in its measurements, and return the numbers of the tracks they went to.

        numbers: of tracks that the measurements began before, when the step is done again.
        """
        before, before_ns = self._targets, self._now_ns
        dt_s = 0.0 if before_ns is None else (t_ns - before_ns) * 1e-9
        self._now_ns = t_ns
        predicted = [self._predict(target, dt_s) for target in before if not self._expired(target)]
        pairs = self._associate(predicted, measurements)
        targets = [
            self._hit(target, measurements[pairs[i]]) if i in pairs else target.missed(self.config.confirm_window)
            for i, target in enumerate(predicted)
        ]
        taken: dict[int, int] = {j: predicted[i].track_id for i, j in pairs.items()}
        new: list[int | None] = list(numbers) or [None] * len(measurements)
        for j, measurement in enumerate(measurements):
            if j not in taken:
                new[j] = self._number(new[j])
                targets.append(self._begin(measurement, int(new[j] or 0)))
                taken[j] = targets[-1].track_id
        self._targets = self._without_replaced([target for target in targets if target.may_live(self.config)])
        self._keep(_Moment(t_ns, measurements, before, before_ns, tuple(new)))
        return tuple(taken[j] for j in range(len(measurements)))

    def _keep(self, moment: _Moment) -> None:
        self._past.append(moment)
        while (moment.t_ns - self._past[0].t_ns) * 1e-9 > self.config.backward_s:
            self._past.popleft()

    def _number(self, known: int | None) -> int:
        if known is not None:
            return known
        self._next_id += 1
        return self._next_id - 1

    def _expired(self, target: Target) -> bool:
        return (self._now - target.hit_ns) * 1e-9 > self.config.coast_s

    def _predict(self, target: Target, dt_s: float) -> Target:
        if dt_s == 0.0:
            return target
        belief = mixture.advanced(target.belief, self.motion.step(dt_s))
        return replace(target, belief=belief, height=target.height.after(dt_s))

    def _expected(self, target: Target, dt_s: float) -> Expected:
        height = target.height.after(dt_s)
        at_height = replace(target.last, z_m=height.z_m)
        mean, covariance = mixture.collapsed(mixture.advanced(target.belief, self.motion.step(dt_s)))
        H = self.motion.sight(at_height)
        return Expected(target.track_id, target.confirmed, target.hit_ns, H @ mean, H @ covariance @ H.T, height.z_m)

    def _associate(self, targets: Sequence[Target], measurements: Sequence[PlanarMeasurement]) -> dict[int, int]:
        """Return which target (index) takes which measurement (index), each used once.

        The nearest in its gate; then, of proven targets, the nearest in the same place.
        """
        candidates = []
        for i, target in enumerate(targets):
            for j, measurement in enumerate(measurements):
                difference = mixture.compared(target.belief, *self._seen(target, measurement))
                # a young track knows little, so everything is near to it: proven ones choose first
                rank = ("confirmed", "coasting", "tentative").index(target.status)
                if difference.nis <= self._gate(difference):
                    candidates.append((rank, difference.nis, i, j))
                elif target.confirmed and math.hypot(*difference.y[:2]) < self.config.same_place_m:
                    candidates.append((rank + 3, difference.nis, i, j))
        pairs: dict[int, int] = {}
        for _, _, i, j in sorted(candidates):
            if i not in pairs and j not in pairs.values():
                pairs[i] = j
        return pairs

    def _gate(self, difference: Innovation) -> float:
        return kalman.chi2_quantile(self.config.gate_probability, len(difference.y))

    def _seen(self, target: Target, measurement: PlanarMeasurement) -> tuple[Array, Array, Array]:
        """Return z, H and R of a measurement, as the configured model makes them for this target."""
        dt_s = (self._now - target.hit_ns) * 1e-9
        if self.config.measurement == "position" or dt_s == 0.0:  # no time, no velocity
            return measurement.xy_m, self.motion.sight(measurement), measurement.covariance
        last = target.last
        z, R = kalman.paper_measurement(measurement.xy_m, measurement.covariance, last.xy_m, last.covariance, dt_s)
        return z, kalman.H_PAPER, R

    def _hit(self, target: Target, measurement: PlanarMeasurement) -> Target:
        seen = self._seen(target, measurement)
        difference = mixture.compared(target.belief, *seen)
        excess = difference.nis / self._gate(difference)
        # as sure as it was, the track would not follow
        before = target.belief if excess <= 1.0 else mixture.doubted(target.belief, excess)
        belief, _ = mixture.updated(before, *seen, self.motion.learnt)
        hits = (*target.hits, True)[-self.config.confirm_window :]
        return replace(
            target,
            belief=belief,
            height=target.height.measured(measurement.z_m, measurement.z_variance_m2),
            hit_ns=self._now,
            last=measurement,
            hits=hits,
            hit_count=target.hit_count + 1,
            confirmed=target.confirmed or sum(hits) >= self.config.confirm_hits,
            nis=difference.nis,
        )

    def _begin(self, measurement: PlanarMeasurement, track_id: int) -> Target:
        age_s = 0.0 if self._since_ns is None else max(0.0, (self._now - self._since_ns) * 1e-9)
        belief = self.motion.begin(measurement, age_s)
        height = Vertical.begun(measurement.z_m, measurement.z_variance_m2)
        confirmed = self.config.confirm_hits == 1
        return Target(track_id, belief, height, self._now, self._now, measurement, confirmed=confirmed)

    def _without_replaced(self, targets: list[Target]) -> tuple[Target, ...]:
        """Drop coasting tracks in whose stead a newer one is measured: they follow a place the platform left.

        Only a track begun after the old one's last measurement can be its successor, so two platforms measured side
        by side keep their tracks when one of them is covered.
        """
        kept = []
        for old in targets:
            heirs = [new for new in targets if new.succeeds(old, self.config)]
            if heirs:
                self.note = f"track {old.track_id} gives way to track {heirs[0].track_id}"
            else:
                kept.append(old)
        return tuple(kept)
