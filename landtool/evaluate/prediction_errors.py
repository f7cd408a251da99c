"""Errors of predicted places against where the platform then was, beside those of holding the last place."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from landtool.evaluate.bootstrap import Resamples
from landtool.evaluate.clip_truth import ClipTruth
from landtool.evaluate.columns import Chosen, column, over_parts
from landtool.evaluate.metric import Metric, metric
from landtool.evaluate.pose_difference import normalised
from landtool.evaluate.pose_errors import unit
from landtool.evaluate.track_errors import TrackError, track_errors, true_motions
from landtool.geometry import Array, Pose
from landtool.io.poses import STRAIGHT_DOWN
from landtool.io.tables import Columns, Row
from landtool.types import FrameResult, Reference, Stage, Track

PARTS, NAMES = ("fog_per_m", "distance_m"), ("stage",)
_DOF = 2
PREDICTION_ERROR_COLUMNS: Columns = {
    "model": str,
    "clip": str,
    "frame": int,
    "t_ns": int,
    "track_id": int,
    "reference": str,
    **dict.fromkeys(("horizon_s", "error_m", "held_m", "nees"), float),
}
"""The columns of prediction_errors.csv."""


@dataclass(frozen=True)
class PredictionError:
    """One prediction of a frame, judged when its time has come.

    error_m: how far it is off. held_m: how far the place it was made at is, which is what holding it would say. nees:
    normalised error squared, 2 degrees of freedom.
    """

    clip: str
    frame: int
    t_ns: int | None
    track_id: int
    reference: Reference
    stage: Stage | None
    distance_m: float | None
    fog_per_m: float | None
    horizon_s: float
    error_m: float
    held_m: float
    nees: float | None

    @property
    def unit(self) -> Hashable:
        """What it is resampled with: the same second of a clip."""
        return unit(self.clip, self.frame, self.t_ns)


def prediction_errors(
    clip: str,
    results: Sequence[FrameResult],
    truth: ClipTruth,
    body_T_camera: Pose = STRAIGHT_DOWN,
) -> list[PredictionError]:
    """Return a row for every prediction of the pad's confirmed track, from FIRST_S on, that the truth can judge."""
    motions = true_motions(truth, body_T_camera)
    rows: list[PredictionError] = []
    for error in track_errors(clip, results, truth, body_T_camera):
        row = truth.row(error.frame, error.t_ns)
        if error.judged and error.track is not None and row is not None:
            motion = motions[error.track.reference]
            for horizon_s, xy_m, covariance in _foretold(error.track):
                later = motion.later_m(row, horizon_s)
                if later is not None:
                    rows.append(_prediction_error(error, error.track, horizon_s, xy_m - later, covariance, later))
    return rows


def _foretold(track: Track) -> Iterator[tuple[float, Array, Array]]:
    yield from ((p.horizon_s, p.xy_m, p.covariance) for p in track.predictions)


def _prediction_error(
    error: TrackError, track: Track, horizon_s: float, off: Array, covariance: Array, later: Array
) -> PredictionError:
    return PredictionError(
        *(error.clip, error.frame, error.t_ns, track.track_id, track.reference),
        *(error.stage, error.distance_m, error.fog_per_m, horizon_s),
        error_m=float(np.linalg.norm(off)),
        held_m=float(np.linalg.norm(track.state[:2] - later)),
        nees=normalised(off, covariance),
    )


def prediction_metrics(errors: Sequence[PredictionError], horizons_s: Sequence[float]) -> list[Metric]:
    """Return of each horizon prediction_<h>_s_rmse_m, held_<h>_s_rmse_m, gain_<h>_s_percent and prediction_<h>_s_nees.

    gain: by how much the RMSE is less than that of holding the last place. nees: over its degrees of freedom.
    """
    metrics: list[Metric] = []
    for horizon_s in horizons_s:
        metrics += _of_horizon([e for e in errors if e.horizon_s == horizon_s], f"{horizon_s:g}_s")
    return metrics


def _of_horizon(errors: Sequence[PredictionError], name: str) -> list[Metric]:
    resamples = Resamples([error.unit for error in errors])
    off, held, nees = column(errors, "error_m"), column(errors, "held_m"), column(errors, "nees") / _DOF

    def judge(chosen: Chosen, part: str) -> Iterator[Metric]:
        n = int(chosen.sum())
        yield metric("track", f"prediction_{name}_rmse_m", resamples.rms(off[chosen], chosen), "lower", slice=part)
        yield metric("track", f"held_{name}_rmse_m", resamples.rms(held[chosen], chosen), "neither", slice=part)
        ours, theirs = off[chosen] ** 2, held[chosen] ** 2

        def gains(weights: Array) -> Array:
            return _gain_percent(weights @ ours, weights @ theirs)

        total = float(theirs.sum())
        value = float(_gain_percent(np.array([ours.sum()]), np.array([total]))[0]) if total > 0.0 else None
        yield metric("track", f"gain_{name}_percent", resamples.estimate(value, chosen, gains, n), "higher", slice=part)
        told = chosen & np.isfinite(nees)
        honest = resamples.mean(nees[told], told)
        yield metric("track", f"prediction_{name}_nees", honest, "expected", of=n, expected=1.0, slice=part)

    return over_parts(judge, errors, PARTS, NAMES)


def _gain_percent(ours: Array, theirs: Array) -> Array:
    """Return 100 (1 - rms / held rms) of sums of squares; NaN where holding makes no error."""
    share = np.divide(ours, theirs, out=np.full_like(ours, np.nan), where=theirs > 0.0)
    return np.asarray(100.0 * (1.0 - np.sqrt(share)))


def prediction_error_row(model: str, error: PredictionError) -> Row:
    """Return a row of prediction_errors.csv."""
    e = error
    return (model, e.clip, e.frame, e.t_ns, e.track_id, e.reference, e.horizon_s, e.error_m, e.held_m, e.nees)
