"""Errors of the pad's track against the truth: a row a frame, with or without a track."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from landtool.evaluate.clip_truth import ClipTruth, TrueFrame
from landtool.evaluate.pose_difference import normalised
from landtool.evaluate.pose_errors import unit
from landtool.evaluate.true_motion import TrueMotion
from landtool.geometry import Array, Pose
from landtool.io.poses import STRAIGHT_DOWN
from landtool.io.tables import Columns, Row
from landtool.types import FrameResult, Reference, Stage, Track, TrackState

FIRST_S = 1.0  # a track is judged from then on: before, it knows its velocity from some frames only, and settles
FALSE_M, FALSE_SIGMAS = 1.0, 3.0  # a track is of something else when it is off by both of these
_REFERENCES: tuple[Reference, ...] = ("body", "world")
TRACK_ERROR_COLUMNS: Columns = {
    "model": str,
    "clip": str,
    "frame": int,
    "t_ns": int,
    "track_id": int,
    "state": str,
    "reference": str,
    **dict.fromkeys(("error_x_m", "error_y_m", "error_vx_mps", "error_vy_mps", "nees", "nis"), float),
}
"""The columns of track_errors.csv."""


@dataclass(frozen=True, eq=False)
class TrackError:
    """What became of the pad's track in one frame with truth; None where there is none, or the truth does not tell.

    t_s: since the truth's first frame. seen: any of the pad is. confirmed, false: tracks in this frame that are, and of
    those how many are of something else. track: the pad's, confirmed or coasting. error_m, error_mps: (2,) of place and
    velocity, track minus truth in its reference frame; true_mps: (2,) the true velocity there. nees: normalised error
    squared of both, 4 degrees of freedom.
    """

    clip: str
    frame: int
    t_ns: int | None
    t_s: float | None
    stage: Stage | None
    distance_m: float | None
    fog_per_m: float | None
    seen: bool
    confirmed: int = 0
    false: int = 0
    track: Track | None = None
    error_m: Array | None = None
    error_mps: Array | None = None
    true_mps: Array | None = None
    nees: float | None = None

    @property
    def unit(self) -> Hashable:
        """What it is resampled with: the same second of a clip."""
        return unit(self.clip, self.frame, self.t_ns)

    @property
    def state(self) -> TrackState | None:
        """The state of the pad's track."""
        return None if self.track is None else self.track.status

    @property
    def nis(self) -> float | None:
        """The normalised innovation squared of this frame's measurement."""
        return None if self.track is None else self.track.nis

    @property
    def judged(self) -> bool:
        """Whether the track is to be right by now: confirmed, and the clip has begun."""
        return self.state == "confirmed" and (self.t_s is None or self.t_s >= FIRST_S)


def true_motions(truth: ClipTruth, body_T_camera: Pose = STRAIGHT_DOWN) -> dict[Reference, TrueMotion]:
    """Return how the pad moves in both frames of reference."""
    return {reference: truth.motion(reference, body_T_camera) for reference in _REFERENCES}


def track_errors(
    clip: str, results: Sequence[FrameResult], truth: ClipTruth, body_T_camera: Pose = STRAIGHT_DOWN
) -> list[TrackError]:
    """Return a row for every frame of a clip with truth."""
    motions, rows = true_motions(truth, body_T_camera), []
    for result in results:
        row = truth.row(result.index, result.t_ns)
        if row is not None:
            rows.append(_track_error(clip, result, truth.frames[row], row, motions, truth.start_ns))
    return rows


def _track_error(
    clip: str,
    result: FrameResult,
    true: TrueFrame,
    row: int,
    motions: dict[Reference, TrueMotion],
    start_ns: int | None,
) -> TrackError:
    facts = true.facts
    t_s = None if true.t_ns is None or start_ns is None else (true.t_ns - start_ns) * 1e-9
    seen = true.visible_fraction is None or true.visible_fraction > 0.0
    known = TrackError(
        clip, result.index, result.t_ns, t_s, result.stage, facts.distance_m, facts.fog_per_m, seen
    )  # fmt: skip
    proven = [track for track in result.tracks if track.status == "confirmed"]
    false = sum(is_false(track, motions[track.reference].places_m[row]) for track in proven)
    known = replace(known, confirmed=len(proven), false=false)
    track = pads_track(result.tracks, motions, row)
    return known if track is None else _judged(known, track, motions[track.reference], row)


def pads_track(tracks: Sequence[Track], motions: dict[Reference, TrueMotion], row: int) -> Track | None:
    """Return the track that stands for the pad: confirmed before coasting, near the truth before others, the oldest.

    One that has strayed is still the pad's where there is no better one: to leave it out would flatter.
    """
    proven = [track for track in tracks if track.status != "tentative"]
    return min(
        proven,
        key=lambda t: (t.status != "confirmed", is_false(t, motions[t.reference].places_m[row]), t.track_id),
        default=None,
    )


def is_false(track: Track, place_m: Array) -> bool:
    """Whether a track is of something else than the pad at a true place (2,): farther off than 1 m and than 3 sigma."""
    off_m = float(np.linalg.norm(track.state[:2] - place_m))
    # the deviation of a place in the plane along its worst direction
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(track.covariance[:2, :2])[-1]))
    return off_m > max(FALSE_M, FALSE_SIGMAS * sigma_m)


def _judged(known: TrackError, track: Track, motion: TrueMotion, row: int) -> TrackError:
    place, velocity = motion.places_m[row], motion.velocities_mps[row]
    if not np.isfinite(place).all():
        return replace(known, track=track)
    off = track.state[:2] - place
    if not np.isfinite(velocity).all():
        return replace(known, track=track, error_m=off)
    off_mps = track.state[2:] - velocity
    nees = normalised(np.concatenate([off, off_mps]), track.covariance)
    return replace(known, track=track, error_m=off, error_mps=off_mps, true_mps=velocity, nees=nees)


def track_error_row(model: str, error: TrackError) -> Row | None:
    """Return a row of track_errors.csv, None for a frame without the pad's track."""
    if error.track is None:
        return None
    off = [None, None] if error.error_m is None else error.error_m.tolist()
    off += [None, None] if error.error_mps is None else error.error_mps.tolist()
    when = model, error.clip, error.frame, error.t_ns
    return (*when, error.track.track_id, error.track.status, error.track.reference, *off, error.nees, error.nis)
