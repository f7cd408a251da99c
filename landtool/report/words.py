"""The verdict as lines that a flight team can read."""

from __future__ import annotations

from collections.abc import Mapping

from landtool.report.consistency import Confidence, Consistency
from landtool.report.gaps import NOTABLE_S
from landtool.report.verdict import Foresight, Lateral, Lock, Verdict

_CONFIDENCE: dict[Confidence, str] = {
    "over_confident": "over-confident",
    "as_sure_as_it_should_be": "as sure as it should be",
    "too_careful": "too careful",
}
# What a distance is horizontal in; without the drone's attitude the body's own tilt is in it
_PLANES = {"world": "in the world", "body": "in the body frame, tilt included"}


def verdict_lines(verdict: Verdict, *, diameter_m: float, switch_altitude_m: float | None) -> list[str]:
    """Return the verdict, a fact a line, the judgement first."""
    return [
        f"landing: {_headline(verdict)}",
        f"frames {verdict.frames}: {_shares(verdict.methods, verdict.frames)}",
        *(_lock_lines(verdict, diameter_m) if verdict.measured else []),
        f"lateral error {_lateral(verdict.lateral, switch_altitude_m)}",
        f"stages: {_stages(verdict)}",
        f"track, frames by state: {_shares(verdict.states, verdict.frames)}",
        f"mirror poses rejected {verdict.flips_rejected}, poses the filter refused {verdict.refused}",
        f"filter: {_filter(verdict.consistency)}",
        f"prediction {_foresight(verdict.foresight)}",
    ]


def _headline(verdict: Verdict) -> str:
    first, last = verdict.first, verdict.last
    if first is None or last is None:
        return "no pad found" if verdict.frames else "no frames"
    way = f"from {first.distance_m:.1f} m to {last.distance_m:.1f} m"
    if verdict.judgement == "sighted":
        return f"pad measured in {verdict.measured} of {verdict.frames} frames, not enough for a track"
    if verdict.judgement == "no_clock":
        missed = max(gap.frames for gap in (verdict.longest_gap, verdict.end_gap) if gap)
        return f"pad measured {way}, missed in {missed} frames running at most; no clock, so no track"
    tracked = [f"tracked {way}{_steady(verdict)}", _late(first)]
    if verdict.lost_gap is not None:  # the bad news first
        return _joined(*_troubles(verdict), f"otherwise {tracked[0]}", tracked[1], _end(verdict))
    return _joined(*tracked, *_troubles(verdict), _end(verdict))


def _steady(verdict: Verdict) -> str:
    """Say how closely the pad was measured where there was no trouble."""
    gap = verdict.longest_gap
    if verdict.judgement != "tracked" or gap is None or gap.seconds is None:
        return ""
    if gap.frames or gap.seconds <= NOTABLE_S:
        return f" without a gap over {NOTABLE_S:g} s"
    # where pictures are farther apart than that, one cannot say more than that none was without the pad
    return f" in every picture, at most {gap.seconds:.2f} s apart"


def _late(first: Lock) -> str:
    return f"found after {first.t_s:.1f} s" if first.t_s is not None and first.t_s > NOTABLE_S else ""


def _troubles(verdict: Verdict) -> list[str]:
    lost, gap, said = verdict.lost_gap, verdict.longest_gap, []
    shown = lost or gap
    if shown is None or not shown.notable:
        return []
    if lost is not None:
        said.append(f"track lost at {lost.distance_m:.1f} m for {lost.seconds:.1f} s")
    else:
        said.append(f"{shown.seconds:.1f} s without sight of the pad at {shown.distance_m:.1f} m bridged by prediction")
    if others := verdict.notable_gaps - 1:
        said.append(f"and {others} other gap{'s' if others > 1 else ''} over {NOTABLE_S:g} s")
    return said


def _end(verdict: Verdict) -> str:
    end = verdict.end_gap
    blind = "" if end is None or not end.notable else f"in the last {end.seconds:.1f} s"
    if verdict.lost_at_end:
        return f"then lost for good: the pad was not seen {blind}"
    off = "" if verdict.lateral is None else f"{verdict.lateral.last_m:.2f} m off at the end"
    return _joined(off, blind and f"too near to be seen {blind}")


def _lock_lines(verdict: Verdict, diameter_m: float) -> list[str]:
    first, last, gap = verdict.first, verdict.last, verdict.longest_gap
    assert first is not None
    assert last is not None
    tag = "" if verdict.tag_distance_m is None else f", tag first read at {verdict.tag_distance_m:.2f} m"
    proven = "" if verdict.confirmed_s is None else f", track confirmed after {verdict.confirmed_s:.2f} s"
    said = [
        f"first lock{_after(first.t_s)} at {first.distance_m:.2f} m by {first.method}{proven}{tag}",
        f"last measured{_after(last.t_s)} at {last.distance_m:.2f} m by {last.method}, "
        f"with the pad's D = {diameter_m:g} m",
    ]
    if gap is None:
        return [*said, "longest gap undefined: measured once"]
    seconds = "" if gap.seconds is None else f"{gap.seconds:.2f} s, "
    over = "" if gap.seconds is None else f"; gaps over {NOTABLE_S:g} s: {verdict.notable_gaps}"
    frames = f"{gap.frames} frame{'' if gap.frames == 1 else 's'} without the pad"
    return [*said, f"longest gap {seconds}{frames}, at {gap.distance_m:.2f} m{over}"]


def _after(t_s: float | None) -> str:
    return "" if t_s is None else f" after {t_s:.2f} s"


def _lateral(lateral: Lateral | None, switch_altitude_m: float | None) -> str:
    where = "in the near stage" + ("" if switch_altitude_m is None else f", below {switch_altitude_m:.1f} m")
    if lateral is None:
        return f"{where}: undefined, 0 of 0"
    plane, last = _PLANES[lateral.reference], f"at the end {lateral.last_m:.2f} m"
    if lateral.max_m is None or lateral.median_m is None:
        return f"{where}: undefined, never measured there; {last} ({plane})"
    return f"{where}: worst {lateral.max_m:.2f} m, median {lateral.median_m:.2f} m, {last} ({plane})"


def _stages(verdict: Verdict) -> str:
    shares = _shares(verdict.stages, sum(verdict.stages.values()))
    altitude_m = verdict.handover_altitude_m
    at = "" if altitude_m is None else f", the last at an altitude of {altitude_m:.1f} m"
    return f"{shares}, hand-overs {verdict.handovers}{at}"


def _filter(consistency: Consistency | None) -> str:
    if consistency is None:
        return "undefined, 0 of 0 measurements against a track"
    low, high = consistency.band
    band = f"expected {consistency.expected:.2f} ({low:.2f} to {high:.2f} for {consistency.frames} frames)"
    return f"{_CONFIDENCE[consistency.confidence]}, median NIS {consistency.median:.2f}, {band}"


def _foresight(foresight: Foresight | None) -> str:
    if foresight is None:
        return "error: undefined, 0 of 0 checked"
    checked = f"RMS of {foresight.checked} against what was measured then"
    return f"{foresight.horizon_s:g} s ahead: {foresight.rms_m:.3f} m off, {checked}"


def _shares(counts: Mapping[str, int], total: int) -> str:
    """Return shares in percent, what did not occur left out."""
    if not total:
        return "undefined, 0 of 0"
    return ", ".join(f"{name} {count / total:.1%}" for name, count in counts.items() if count)


def _joined(*parts: str) -> str:
    return ", ".join(filter(None, parts))
