"""What each frame says of the landing: where the drone is, which track is the pad's, which prediction came true."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array
from landtool.types import FrameResult, Reference, Track

_BRIDGE_S = 0.2  # between two measurements so far apart a straight line stands for the platform's way


@dataclass(frozen=True, eq=False)
class Residual:
    """A prediction against what was measured when its time had come.

    t_s: that time. xy_m: (2,) predicted minus measured, in the track's reference. sigma_m: (2,) of the prediction's own
    covariance, None where the track gives none.
    """

    t_s: float
    xy_m: Array
    sigma_m: Array | None

    @property
    def length_m(self) -> float:
        """How far the prediction was off."""
        return float(np.linalg.norm(self.xy_m))


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame of the landing; None for what is not known.

    t_s: since the first frame with a time. distance_m: of the pad's centre from the camera. lateral_m: horizontal
    distance of the drone from it, in the world's plane or the body's, as `reference` says. track: the pad's.
    """

    t_s: float | None
    distance_m: float | None
    lateral_m: float | None
    reference: Reference | None
    track: Track | None
    residuals: tuple[Residual, ...]


@dataclass(frozen=True, eq=False)
class _Pending:
    """A prediction whose time has not come: covariance (2, 2) or None."""

    t_ns: int
    xy_m: Array
    covariance: Array | None


class Follower:
    """Goes along with the results of one recording. It remembers the predictions of one horizon, nothing else.

    horizon_s: how far ahead the tracks' main prediction is, None before the first one.
    """

    def __init__(self) -> None:
        self.horizon_s: float | None = None
        self._start_ns: int | None = None
        self._now_ns: int | None = None
        self._track_id: int | None = None
        self._pending: deque[_Pending] = deque()
        self._last: tuple[int, Array] | None = None

    def see(self, result: FrameResult) -> Moment:
        """Take one frame in and return what it means."""
        t_ns = result.t_ns
        if t_ns is not None:
            self._start_ns = t_ns if self._start_ns is None else self._start_ns
            if self._now_ns is not None and t_ns < self._now_ns:  # what was foretold was of another time
                self._pending.clear()
                self._last = None
            self._now_ns = t_ns
        track = self._pads_track(result)
        reference, lateral_m = _lateral(result)
        return Moment(
            self._since_start(t_ns),
            None if result.pose is None else float(np.linalg.norm(result.pose.camera_T_pad.translation)),
            lateral_m,
            reference,
            track,
            self._verified(result, track),
        )

    def _since_start(self, t_ns: int | None) -> float | None:
        return None if t_ns is None or self._start_ns is None else (t_ns - self._start_ns) * 1e-9

    def _pads_track(self, result: FrameResult) -> Track | None:
        """Return the track of the pad landed on: proven ones first, of them the nearest to where the pad was measured.

        Without a measurement it is the one followed so far, then the oldest.
        """

        def rank(track: Track) -> tuple[bool, float, bool, int]:
            place = _place(result, track.reference)
            off_m = 0.0 if place is None else float(np.linalg.norm(track.state[:2] - place))
            return track.status == "tentative", off_m, track.track_id != self._track_id, track.track_id

        chosen = min(result.tracks, key=rank, default=None)
        self._track_id = self._track_id if chosen is None else chosen.track_id
        return chosen

    def _verified(self, result: FrameResult, track: Track | None) -> tuple[Residual, ...]:
        """Remember this frame's prediction, and compare those whose time has come with the way between measurements."""
        t_ns = result.t_ns
        if t_ns is None:
            return ()
        if track is not None:
            self.horizon_s = track.horizon_s
        if track is not None and track.status != "tentative":
            later_ns = t_ns + round(track.horizon_s * 1e9)
            self._pending.append(_Pending(later_ns, track.predicted_xy_m, _covariance(track)))
        place = None if track is None else _place(result, track.reference)
        if place is None:
            return ()
        before_ns, before = self._last or (t_ns, place)
        self._last = t_ns, place
        said = []
        while self._pending and self._pending[0].t_ns <= t_ns:
            due = self._pending.popleft()
            near = due.t_ns == t_ns or (t_ns - before_ns) * 1e-9 <= _BRIDGE_S
            if before_ns <= due.t_ns and near:
                share = 1.0 if t_ns == before_ns else (due.t_ns - before_ns) / (t_ns - before_ns)
                off = due.xy_m - (before + share * (place - before))
                sigma = None if due.covariance is None else np.sqrt(np.diag(due.covariance))
                said.append(Residual(self._since_start(due.t_ns) or 0.0, off, sigma))
        return tuple(said)


def _covariance(track: Track) -> Array | None:
    return next((p.covariance for p in track.predictions if p.horizon_s == track.horizon_s), None)


def _place(result: FrameResult, reference: Reference) -> Array | None:
    """Return where the pad was measured (2,) in the plane of a reference frame, metres."""
    pose = result.world_T_pad if reference == "world" else result.body_T_pad
    return None if pose is None else pose.translation[:2]


def _lateral(result: FrameResult) -> tuple[Reference | None, float | None]:
    """Return the horizontal distance of the drone from the pad's centre, and in which frame it is horizontal."""
    if result.body_T_pad is None:
        return None, None
    if result.world_T_pad is None:
        return "body", float(np.hypot(*result.body_T_pad.translation[:2]))
    # world_T_body = world_T_pad (body_T_pad)^-1: so it is of this very measurement
    world_T_body = result.world_T_pad @ result.body_T_pad.inverse()
    return "world", float(np.hypot(*(result.world_T_pad.translation - world_T_body.translation)[:2]))
