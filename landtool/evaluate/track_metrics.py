"""What the errors of tracks come to: RMSE, honesty, lag, time to confirmation, gaps, identity, false tracks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from landtool.evaluate.bootstrap import UNDEFINED, Estimate, Resamples
from landtool.evaluate.columns import Chosen, column, over_parts
from landtool.evaluate.metric import Metric, metric
from landtool.evaluate.track_errors import TrackError
from landtool.evaluate.track_gaps import ClipTrack, clip_tracks
from landtool.geometry import Array

PARTS, NAMES = ("fog_per_m", "distance_m"), ("stage",)
MOVING_MPS = 0.2  # slower than this a shift in time cannot be told from an error of place
_DOF = 4  # of place and velocity in the plane


def track_metrics(errors: Sequence[TrackError], nis_dof: int = 2) -> list[Metric]:
    """Return the metrics of tracks; errors: of all clips. nis_dof: numbers a measurement of the filter has, 2 or 4.

    Of confirmed tracks, from FIRST_S on: place_rmse_m, velocity_rmse_mps, nees and nis over their degrees of freedom (1
    of an honest filter), lag_s (by how much the track is before or behind the truth, while the platform moves in its
    frame of reference), false_track_share (of all confirmed tracks). Of whole clips, and of each as a part: confirm_s
    (mean), longest_gap_s, gaps_over_0_2_s and identity_switches (sums).
    """
    resamples = Resamples([error.unit for error in errors])
    judged = np.array([error.judged for error in errors], np.bool_)
    off_m, off_mps = _lengths([e.error_m for e in errors]), _lengths([e.error_mps for e in errors])
    nees, nis = column(errors, "nees") / _DOF, column(errors, "nis") / nis_dof
    shift, power = _lag_terms(errors)
    confirmed, false = column(errors, "confirmed"), column(errors, "false")

    def judge(chosen: Chosen, part: str) -> Iterator[Metric]:
        asked = chosen & judged
        of = int(asked.sum())
        for name, values in (("place_rmse_m", off_m), ("velocity_rmse_mps", off_mps)):
            told = asked & np.isfinite(values)
            yield metric("track", name, resamples.rms(values[told], told), "lower", of=of, slice=part)
        for name, values in (("nees", nees), ("nis", nis)):
            told = asked & np.isfinite(values)
            estimate = resamples.mean(values[told], told)
            yield metric("track", name, estimate, "expected", of=of, expected=1.0, slice=part)
        moving = asked & (power >= MOVING_MPS**2)
        lag = _size_of_ratio(resamples, shift[moving], power[moving], moving)
        yield metric("track", "lag_s", lag, "lower", of=of, slice=part)
        share = resamples.ratio(false[chosen], confirmed[chosen], chosen)
        total = int(confirmed[chosen].sum())
        counted = Estimate(share.value, share.low, share.high, total)
        yield metric("track", "false_track_share", counted, "lower", slice=part)

    return [*over_parts(judge, errors, PARTS, NAMES), *_of_clips(clip_tracks(errors))]


def _lag_terms(errors: Sequence[TrackError]) -> tuple[Array, Array]:
    """Return of every row what the lag is made of: -e . v and v . v, (N,) each, of no power where v is unknown.

    A track behind by tau has e = x(t - tau) - x(t) = -tau v; least squares over rows: tau = -sum e . v / sum v . v.
    """
    shift, power = np.zeros(len(errors)), np.zeros(len(errors))
    for k, error in enumerate(errors):
        if error.error_m is not None and error.true_mps is not None:
            shift[k] = -float(error.error_m @ error.true_mps)
            power[k] = float(error.true_mps @ error.true_mps)
    return shift, power


def _size_of_ratio(resamples: Resamples, shift: Array, power: Array, chosen: Chosen) -> Estimate:
    def sizes(weights: Array) -> Array:
        whole = weights @ power
        return np.abs(np.divide(weights @ shift, whole, out=np.full_like(whole, np.nan), where=whole > 0.0))

    value = abs(float(shift.sum() / power.sum())) if power.size else None
    return resamples.estimate(value, chosen, sizes, int(power.size))


def _of_clips(clips: Sequence[ClipTrack]) -> Iterator[Metric]:
    yield from _clip_metrics(clips, "")
    for clip in clips:
        part = f"clip={'_'.join(clip.clip.split())}"
        yield from (found for found in _clip_metrics([clip], part) if found.value is not None)


def _clip_metrics(clips: Sequence[ClipTrack], part: str) -> Iterator[Metric]:
    confirm = [clip.confirm_s for clip in clips if clip.confirm_s is not None]
    gaps = [clip.longest_gap_s for clip in clips if clip.longest_gap_s is not None]
    notable = [clip.notable_gaps for clip in clips if clip.notable_gaps is not None]
    switches = [clip.switches for clip in clips]
    for name, value, count in (
        ("confirm_s", float(np.mean(confirm)) if confirm else None, len(confirm)),
        ("longest_gap_s", max(gaps, default=None), len(gaps)),
        ("gaps_over_0_2_s", float(sum(notable)) if notable else None, len(notable)),
        ("identity_switches", float(sum(switches)) if switches else None, len(switches)),
    ):
        estimate = UNDEFINED if value is None else Estimate(value, None, None, count)
        yield metric("track", name, estimate, "lower", of=len(clips), slice=part)


def _lengths(vectors: Sequence[Array | None]) -> Array:
    return np.array([np.nan if v is None else float(np.linalg.norm(v)) for v in vectors], np.float64)
