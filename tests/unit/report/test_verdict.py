from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable

import numpy as np
import pytest

from landtool.report.facts import facts
from landtool.report.verdict import Verdict, VerdictLog
from landtool.report.words import verdict_lines
from landtool.types import FrameResult
from tests.shared import ROOT
from tests.unit.report.landings import FPS, STEP_NS, measured, result, track


def judged(results: Iterable[FrameResult], nis_dof: int = 2) -> Verdict:
    log = VerdictLog(1.0, nis_dof)
    for one in results:
        log.add(one)
    return log.verdict()


def lines(verdict: Verdict, switch_altitude_m: float | None = None) -> list[str]:
    return verdict_lines(verdict, diameter_m=1.0, switch_altitude_m=switch_altitude_m)


def landing(missing: range = range(0), *, bridged: bool = True, last_m: float = 0.5) -> list[FrameResult]:
    """Sixty frames from 6.4 m down, without the pad in those that are missing."""
    said = []
    for i in range(60):
        height_m = 6.4 + (last_m - 6.4) * i / 59
        gone = i in missing
        tracks = (track(status="coasting" if gone else "confirmed"),) if bridged or not gone else ()
        said.append(result(i, tracks=tracks) if gone else measured(i, height_m, drone_m=(0.08, 0.0), tracks=tracks))
    return said


class TestHeadline:
    def test_a_good_landing(self) -> None:
        verdict = judged(landing())
        assert verdict.judgement == "tracked"
        said = "landing: tracked from 6.4 m to 0.5 m without a gap over 0.2 s, 0.08 m off at the end"
        assert lines(verdict)[0] == said

    def test_a_gap_the_track_bridged(self) -> None:
        verdict = judged(landing(range(20, 31)))
        assert verdict.judgement == "bridged"
        assert "0.6 s without sight of the pad at 4.5 m bridged by prediction" in lines(verdict)[0]
        assert verdict.longest_gap is not None
        assert (verdict.longest_gap.seconds, verdict.longest_gap.frames) == (pytest.approx(0.6), 11)

    def test_a_track_that_was_lost_comes_first(self) -> None:
        verdict = judged(landing(range(20, 31), bridged=False))
        assert verdict.judgement == "lost"
        assert lines(verdict)[0].startswith(
            "landing: track lost at 4.5 m for 0.6 s, otherwise tracked from 6.4 m to 0.5 m"
        )

    def test_a_longer_bridged_gap_does_not_hide_a_loss(self) -> None:
        results = landing(range(10, 18), bridged=False)[:20] + landing(range(30, 50))[20:]
        verdict = judged(results)
        assert verdict.judgement == "lost"
        assert verdict.longest_gap is not None
        assert verdict.longest_gap.frames == 20
        assert "track lost at 5.5 m for 0.4 s, and 1 other gap over 0.2 s" in lines(verdict)[0].replace(
            "0.5 s", "0.4 s"
        )

    def test_three_frames_at_20_hz_are_no_gap_and_four_are(self) -> None:
        # 4 steps of 0.05 s are 0.2 s, which is not over 0.2 s
        assert judged(landing(range(20, 23))).notable_gaps == 0
        assert judged(landing(range(20, 24))).notable_gaps == 1

    def test_lost_for_good_far_away(self) -> None:
        verdict = judged(landing(range(40, 60)))
        assert verdict.judgement == "lost"
        assert lines(verdict)[0].endswith("then lost for good: the pad was not seen in the last 1.0 s")

    def test_too_near_to_be_seen_is_no_loss(self) -> None:
        verdict = judged(landing(range(58, 60), last_m=0.4) + [result(i, tracks=(track(),)) for i in range(60, 70)])
        assert verdict.judgement == "tracked"
        assert lines(verdict)[0].endswith("0.08 m off at the end, too near to be seen in the last 0.6 s")

    def test_found_late(self) -> None:
        assert "found after 1.0 s" in lines(judged(landing(range(20))))[0]

    def test_pictures_far_apart_are_no_gap(self) -> None:
        verdict = judged(measured(i, 5.0 - i, t_ns=i * 500_000_000, tracks=(track(),)) for i in range(4))
        assert verdict.judgement == "tracked"
        assert "from 5.0 m to 2.0 m in every picture, at most 0.50 s apart" in lines(verdict)[0]

    def test_no_pad(self) -> None:
        verdict = judged(result(i) for i in range(3))
        assert verdict.judgement == "no_pad"
        assert lines(verdict)[0] == "landing: no pad found"

    def test_no_frames(self) -> None:
        verdict = judged([])
        assert lines(verdict)[0] == "landing: no frames"
        assert "undefined, 0 of 0" in "\n".join(lines(verdict))

    def test_one_frame(self) -> None:
        verdict = judged([measured(0, 5.0, tracks=(track(status="tentative"),))])
        assert verdict.judgement == "sighted"
        assert lines(verdict)[0] == "landing: pad measured in 1 of 1 frames, not enough for a track"
        assert "longest gap undefined: measured once" in lines(verdict)

    def test_no_clock(self) -> None:
        results = [result(i, t_ns=None) if i in (3, 4) else measured(i, 5.0, t_ns=None) for i in range(8)]
        verdict = judged(results)
        assert verdict.judgement == "no_clock"
        assert "missed in 2 frames running at most; no clock, so no track" in lines(verdict)[0]
        values = facts(verdict, wall_s=1.0, switch_altitude_m=None)
        assert (values["first_lock_s"], values["longest_gap_s"], values["gaps_over_0_2_s"]) == (None, None, None)
        assert (values["longest_gap_frames"], values["first_lock_distance_m"]) == (2, 5.0)


class TestFacts:
    def test_locks_say_when_where_and_how(self) -> None:
        methods = ["box", "target", "tag"]
        results = [result(0), *(measured(i, 9.0 - i, methods[min(i - 1, 2)], tracks=(track(),)) for i in range(1, 6))]
        verdict = judged(results)
        assert verdict.first is not None
        assert verdict.last is not None
        assert (verdict.first.t_s, verdict.first.distance_m, verdict.first.method) == (pytest.approx(0.05), 8.0, "box")
        assert (verdict.last.t_s, verdict.last.distance_m, verdict.last.method) == (pytest.approx(0.25), 4.0, "tag")
        assert verdict.tag_distance_m == 6.0
        assert verdict.methods == {"tag": 3, "target": 1, "box": 1, "none": 1}

    def test_lateral_error_is_of_the_near_stage_and_in_the_world(self) -> None:
        far = measured(0, 9.0, stage="far", drone_m=(3.0, 0.0))
        near = [
            measured(1 + i, 2.0, drone_m=(x, 0.1), pad_m=(0.1, 0.1), tilt_rad=0.1)
            for i, x in enumerate((0.5, 0.2, 0.3))
        ]
        lateral = judged([far, *near]).lateral
        assert lateral is not None
        assert (lateral.reference, lateral.frames) == ("world", 3)
        assert (lateral.max_m, lateral.median_m, lateral.last_m) == pytest.approx((0.4, 0.2, 0.2))

    def test_without_ego_the_tilt_is_in_it_and_said(self) -> None:
        lateral = judged([measured(0, 2.0, drone_m=None, tilt_rad=0.1)]).lateral
        assert lateral is not None
        assert (lateral.reference, lateral.last_m) == ("body", pytest.approx(2.0 * math.sin(0.1)))
        assert "body frame, tilt included" in "\n".join(lines(judged([measured(0, 2.0, drone_m=None)])))

    def test_never_near(self) -> None:
        verdict = judged([measured(0, 9.0, stage="far", drone_m=(1.0, 0.0))])
        assert verdict.lateral is not None
        assert (verdict.lateral.max_m, verdict.lateral.last_m) == (None, pytest.approx(1.0))
        assert "below 6.0 m: undefined, never measured there; at the end 1.00 m" in "\n".join(lines(verdict, 6.0))

    def test_counts_hand_overs_and_leaves_lost_frames_out(self) -> None:
        stages = ["far", "far", None, "near", "near", "far", "near"]
        verdict = judged(result(i, stage=s, altitude_m=7.0 - i) for i, s in enumerate(stages))
        assert (verdict.handovers, verdict.handover_altitude_m) == (3, 1.0)
        assert verdict.stages == {"far": 3, "near": 3}

    def test_counts_mirror_poses_and_refused_ones(self) -> None:
        results = [
            measured(0, 5.0, better_fit_rejected=True, tracks=(track(nis=1.0),)),
            measured(1, 5.0, tracks=(track(status="coasting"),)),
        ]
        verdict = judged(results)
        assert (verdict.flips_rejected, verdict.refused) == (1, 1)
        assert "mirror poses rejected 1, poses the filter refused 1" in lines(verdict)

    def test_the_filter_is_judged_by_the_pads_own_proven_track(self) -> None:
        # the quantiles of chi-square with 2 degrees of freedom, -2 ln(1 - p)
        nis = -2.0 * np.log1p(-(np.arange(200) + 0.5) / 200)
        other = track((9.0, 0.0), nis=100.0, track_id=0)
        results = [measured(i, 5.0, tracks=(track(nis=float(value)), other)) for i, value in enumerate(nis)]
        verdict = judged([measured(0, 5.0, tracks=(track(status="tentative", nis=99.0),)), *results])
        assert verdict.consistency is not None
        assert (verdict.consistency.frames, verdict.consistency.confidence) == (200, "as_sure_as_it_should_be")
        assert "filter: as sure as it should be, median NIS" in "\n".join(lines(verdict))

    def test_all_values_are_plain_and_nothing_is_nan(self) -> None:
        for results in ([], [result(0)], landing(), [measured(0, 5.0, t_ns=None)]):
            values = facts(judged(results), wall_s=2.0, switch_altitude_m=6.0)
            assert json.loads(json.dumps(values, allow_nan=False)) == values
            assert values["fps"] == len(results) / 2.0

    def test_the_docs_name_every_key(self) -> None:
        page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
        rows = page.split("#### verdict", 1)[1].split("\n### ", 1)[0]
        named = [key for row in re.findall(r"^\| ([a-z_0-9, ]+) \|", rows, re.MULTILINE) for key in row.split(", ")]
        assert named[1:] == list(facts(judged([]), wall_s=1.0, switch_altitude_m=None))  # the first is the header

    def test_every_key_is_there_whatever_happened(self) -> None:
        keys = [list(facts(judged(r), wall_s=1.0, switch_altitude_m=None)) for r in ([], landing())]
        assert keys[0] == keys[1]


class TestPrediction:
    def test_is_compared_with_what_was_measured_when_its_time_had_come(self) -> None:
        # the platform drives 1 m/s in x, the filter foretells 0.1 m too far and 0.05 m to the left
        def place(i: float) -> tuple[float, float]:
            return i / FPS, 0.0

        results = []
        for i in range(40):
            ahead = place(i + 0.5 * FPS)
            results.append(measured(i, 5.0, pad_m=place(i), tracks=(track(place(i), (ahead[0] + 0.1, 0.05)),)))
        verdict = judged(results)
        assert verdict.foresight is not None
        assert verdict.foresight.checked == 30
        assert verdict.foresight.rms_m == pytest.approx(math.hypot(0.1, 0.05))
        assert "prediction 0.5 s ahead: 0.112 m off, RMS of 30 against what was measured then" in lines(verdict)

    def test_between_frames_the_way_is_a_straight_line(self) -> None:
        # frames 0.15 s apart never meet a horizon of 0.5 s
        results = [
            measured(
                i,
                5.0,
                t_ns=3 * i * STEP_NS,
                pad_m=(0.15 * i, 0.0),
                tracks=(track((0.15 * i, 0.0), (0.15 * i + 0.5, 0.0)),),
            )
            for i in range(10)
        ]
        verdict = judged(results)
        assert verdict.foresight is not None
        assert verdict.foresight.rms_m == pytest.approx(0.0, abs=1e-9)

    def test_over_a_gap_nothing_is_checked(self) -> None:
        def seen(index: int, t_s: float) -> FrameResult:
            tracks = (track(ahead_m=(7.0, 0.0)),)
            return measured(index, 5.0, t_ns=round(t_s * 1e9), tracks=tracks)

        assert judged([seen(0, 0.0), seen(1, 0.4), seen(2, 0.7)]).foresight is None  # 0.5 s is in no measured place
        foresight = judged([seen(0, 0.0), seen(1, 0.4), seen(2, 0.5)]).foresight
        assert foresight is not None
        assert (foresight.checked, foresight.rms_m) == (1, 7.0)

    def test_a_clock_that_steps_back_forgets_what_was_foretold(self) -> None:
        first = [measured(i, 5.0, tracks=(track(ahead_m=(7.0, 0.0)),)) for i in range(5)]
        again = [measured(5 + i, 5.0, t_ns=(i - 100) * STEP_NS, tracks=(track(),)) for i in range(40)]
        verdict = judged([*first, *again])
        assert verdict.foresight is not None
        assert verdict.foresight.rms_m == 0.0
        assert verdict.notable_gaps == 0
