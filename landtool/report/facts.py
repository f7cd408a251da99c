"""The verdict as plain values, for run.json."""

from __future__ import annotations

from typing import Any

from landtool.report.verdict import Verdict


def facts(verdict: Verdict, *, wall_s: float, switch_altitude_m: float | None) -> dict[str, Any]:
    """Return the verdict as plain values with their units in their names, for run.json."""
    gap, lost, end, lateral = verdict.longest_gap, verdict.lost_gap, verdict.end_gap, verdict.lateral
    filter_, ahead = verdict.consistency, verdict.foresight
    return {
        "judgement": verdict.judgement,
        "frames": verdict.frames,
        "frames_measured": verdict.measured,
        "frames_by_method": dict(verdict.methods),
        "frames_by_stage": dict(verdict.stages),
        "frames_by_track_state": dict(verdict.states),
        "first_lock_s": verdict.first and verdict.first.t_s,
        "first_lock_distance_m": verdict.first and verdict.first.distance_m,
        "first_lock_method": verdict.first and verdict.first.method,
        "track_confirmed_s": verdict.confirmed_s,
        "first_tag_distance_m": verdict.tag_distance_m,
        "last_measured_s": verdict.last and verdict.last.t_s,
        "last_measured_distance_m": verdict.last and verdict.last.distance_m,
        "last_measured_method": verdict.last and verdict.last.method,
        "longest_gap_s": gap and gap.seconds,
        "longest_gap_frames": gap and gap.frames,
        "longest_gap_distance_m": gap and gap.distance_m,
        "longest_gap_bridged": gap and gap.bridged,
        "gaps_over_0_2_s": None if verdict.first is None or verdict.first.t_s is None else verdict.notable_gaps,
        "track_lost_s": lost and lost.seconds,
        "track_lost_distance_m": lost and lost.distance_m,
        "unmeasured_at_end_s": end and end.seconds,
        "unmeasured_at_end_frames": end and end.frames,
        "switch_altitude_m": switch_altitude_m,
        "lateral_reference": lateral and lateral.reference,
        "lateral_error_frames": lateral.frames if lateral else 0,
        "lateral_error_max_m": lateral and lateral.max_m,
        "lateral_error_median_m": lateral and lateral.median_m,
        "lateral_error_last_m": lateral and lateral.last_m,
        "flips_rejected": verdict.flips_rejected,
        "poses_refused": verdict.refused,
        "handovers": verdict.handovers,
        "last_handover_altitude_m": verdict.handover_altitude_m,
        "nis_frames": filter_.frames if filter_ else 0,
        "nis_median": filter_ and filter_.median,
        "nis_median_expected": filter_ and filter_.expected,
        "nis_median_band": filter_ and list(filter_.band),
        "filter": filter_ and filter_.confidence,
        "horizon_s": ahead and ahead.horizon_s,
        "predictions_checked": ahead.checked if ahead else 0,
        "prediction_rms_m": ahead and ahead.rms_m,
        "fps": verdict.frames / wall_s if wall_s > 0.0 else None,
    }
