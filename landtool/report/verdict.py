"""The facts of a landing, gathered while its results go by; memory does not grow with their number."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from landtool.report.consistency import Consistency, consistency
from landtool.report.follow import Follower, Moment
from landtool.report.gaps import Gap, GapLog
from landtool.report.series import Series
from landtool.types import FrameResult, PoseMethod, Reference

Judgement = Literal["no_frames", "no_pad", "no_clock", "sighted", "lost", "bridged", "tracked"]


@dataclass(frozen=True)
class Lock:
    """A frame in which the pad was measured. t_s: since the first frame, None without a clock."""

    t_s: float | None
    distance_m: float
    method: PoseMethod


@dataclass(frozen=True)
class Lateral:
    """The drone's horizontal distance from the pad's centre, horizontal in the plane of `reference`.

    frames: in the near stage, which max_m and median_m are about. last_m: of the last measurement in any stage.
    """

    reference: Reference
    last_m: float
    frames: int
    max_m: float | None
    median_m: float | None


@dataclass(frozen=True)
class Foresight:
    """Predictions of one horizon against what was measured later: how many, and their RMS distance."""

    horizon_s: float
    checked: int
    rms_m: float


@dataclass(frozen=True)
class Verdict:
    """Everything that is said of a landing; None is unknown, or has nothing to be about.

    fills_picture: at the last measurement the pad's ring spanned half the picture or more, so that it had to leave it.
    handover_altitude_m: at the last change of stage. refused: poses the tracker's gate kept out.
    """

    frames: int
    methods: Mapping[str, int]
    stages: Mapping[str, int]
    states: Mapping[str, int]
    first: Lock | None
    confirmed_s: float | None
    tag_distance_m: float | None
    last: Lock | None
    fills_picture: bool
    longest_gap: Gap | None
    lost_gap: Gap | None
    notable_gaps: int
    end_gap: Gap | None
    lateral: Lateral | None
    flips_rejected: int
    refused: int
    handovers: int
    handover_altitude_m: float | None
    consistency: Consistency | None
    foresight: Foresight | None

    @property
    def measured(self) -> int:
        """Frames with a pose."""
        return self.frames - self.methods["none"]

    @property
    def lost_at_end(self) -> bool:
        """Whether the pad went out of sight for good, and not for being too near."""
        return self.end_gap is not None and self.end_gap.notable and not self.fills_picture

    @property
    def judgement(self) -> Judgement:
        """The whole in a word."""
        if not self.measured:
            return "no_pad" if self.frames else "no_frames"
        if self.first is not None and self.first.t_s is None:
            return "no_clock"
        if self.confirmed_s is None:
            return "sighted"
        if self.lost_at_end or self.lost_gap is not None:
            return "lost"
        return "bridged" if self.notable_gaps else "tracked"


class VerdictLog:
    """Takes results in, one recording's in order.

    spans_picture_m: from where on the pad's ring spans half the picture. nis_dof: numbers a measurement of the filter
    has, 2 or 4.
    """

    def __init__(self, spans_picture_m: float, nis_dof: int = 2) -> None:
        self._spans_picture_m, self._nis_dof = spans_picture_m, nis_dof
        self._follower, self._gaps = Follower(), GapLog()
        self._methods: Counter[str] = Counter(tag=0, target=0, box=0, none=0)
        self._stages: Counter[str] = Counter(far=0, near=0)
        self._states: Counter[str] = Counter(confirmed=0, coasting=0, tentative=0, none=0)
        self._first: Lock | None = None
        self._last: Lock | None = None
        self._confirmed_s: float | None = None
        self._tag_distance_m: float | None = None
        self._frames = self._flips = self._refused = self._checked = self._handovers = 0
        self._stage: str | None = None
        self._handover_altitude_m: float | None = None
        self._near: dict[Reference, _Errors] = {"world": _Errors(), "body": _Errors()}
        self._nis = Series(("nis",))
        self._squares_m2 = 0.0

    def add(self, result: FrameResult) -> None:
        """Take one frame in."""
        self._frames += 1
        moment = self._follower.see(result)
        self._methods["none" if result.pose is None else result.pose.method] += 1
        self._count_stage(result)
        self._count_track(result, moment)
        proven = moment.track is not None and moment.track.status != "tentative"
        self._gaps.add(moment.t_s, moment.distance_m, tracked=proven)
        if result.pose is not None and moment.distance_m is not None:
            self._flips += result.pose.better_fit_rejected
            self._last = Lock(moment.t_s, moment.distance_m, result.pose.method)
            self._first = self._first or self._last
            if result.pose.method == "tag" and self._tag_distance_m is None:
                self._tag_distance_m = moment.distance_m
        if moment.reference is not None and moment.lateral_m is not None:
            self._near[moment.reference].add(moment.lateral_m, near=result.stage == "near")
        self._checked += len(moment.residuals)
        self._squares_m2 += sum(residual.length_m**2 for residual in moment.residuals)

    def verdict(self) -> Verdict:
        """Return what is known so far."""
        return Verdict(
            frames=self._frames,
            methods=dict(self._methods),
            stages=dict(self._stages),
            states=dict(self._states),
            first=self._first,
            confirmed_s=self._confirmed_s,
            tag_distance_m=self._tag_distance_m,
            last=self._last,
            fills_picture=self._last is not None and self._last.distance_m <= self._spans_picture_m,
            longest_gap=self._gaps.longest,
            lost_gap=self._gaps.lost,
            notable_gaps=self._gaps.notable,
            end_gap=self._gaps.open,
            lateral=self._lateral(),
            flips_rejected=self._flips,
            refused=self._refused,
            handovers=self._handovers,
            handover_altitude_m=self._handover_altitude_m,
            consistency=consistency(self._nis.column("nis"), self._nis_dof),
            foresight=self._foresight(),
        )

    def _count_stage(self, result: FrameResult) -> None:
        if result.stage is None:
            return
        self._stages[result.stage] += 1
        if self._stage not in (None, result.stage):
            self._handovers += 1
            self._handover_altitude_m = result.altitude_m
        self._stage = result.stage

    def _count_track(self, result: FrameResult, moment: Moment) -> None:
        track = moment.track
        self._states["none" if track is None else track.status] += 1
        if track is None or track.status == "tentative":
            return
        if self._confirmed_s is None:
            self._confirmed_s = moment.t_s
        if track.nis is not None:
            self._nis.add(track.nis)
        elif track.status == "coasting":
            self._refused += result.pose is not None and "own pose is not known" not in result.reason

    def _lateral(self) -> Lateral | None:
        """Return the errors in the world's plane, or where the drone's own pose is known nowhere, in the body's."""
        for reference, errors in self._near.items():
            if errors.last_m is not None:
                return Lateral(reference, errors.last_m, errors.frames, errors.max_m, errors.median_m)
        return None

    def _foresight(self) -> Foresight | None:
        if not self._checked or self._follower.horizon_s is None:
            return None
        return Foresight(self._follower.horizon_s, self._checked, math.sqrt(self._squares_m2 / self._checked))


class _Errors:
    """Lateral errors in one plane. last_m: in any stage; the others of the near stage."""

    def __init__(self) -> None:
        self.last_m: float | None = None
        self.max_m: float | None = None
        self.frames = 0
        self._all = Series(("error",))

    def add(self, error_m: float, *, near: bool) -> None:
        self.last_m = error_m
        if near:
            self.frames += 1
            self.max_m = max(error_m, self.max_m or 0.0)
            self._all.add(error_m)

    @property
    def median_m(self) -> float | None:
        return float(np.median(self._all.column("error"))) if self.frames else None
