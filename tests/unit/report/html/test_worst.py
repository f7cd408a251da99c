"""The worst frames are of every kind, apart, and say all that went wrong in them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from landtool.report.html.flight import Flight, read_flight
from landtool.report.html.folders import read_evaluation, read_folder
from landtool.report.html.worst import Fault, length, worst
from landtool.report.html.worst_eval import evaluation_faults
from landtool.report.html.worst_run import run_faults
from tests.unit.report.html.runs import landing, write_error_tables, write_evaluation, write_landing
from tests.unit.report.landings import measured, result, track


def flight_of(folder: Path, rows: list) -> Flight:  # type: ignore[type-arg]
    found = read_flight(read_folder(write_landing(folder, rows, video=False)))
    assert found is not None
    return found


def test_no_two_are_near_each_other_and_each_kind_has_its_turn() -> None:
    faults = [Fault("large", 10.0 - 0.01 * i, "large", 0.1 * i, i) for i in range(100)]
    faults += [Fault("rare", 0.1, "rare", 5.0, 50)]
    moments = worst(faults, apart=1.0, most=6)
    at = [moment.fault.at for moment in moments]
    assert len(moments) == 6
    assert at == sorted(at)
    assert min(b - a for a, b in pairwise(at)) >= 1.0 - 1e-9
    assert "rare" in [moment.fault.kind for moment in moments]


def test_a_frame_says_everything_that_went_wrong_in_it() -> None:
    moments = worst([Fault("a", 1.0, "first", 2.0, 20), Fault("b", 1.0, "second", 2.0, 20)], apart=0.5)
    assert [moment.words for moment in moments] == [("first", "second")]


def test_other_places_are_never_too_near() -> None:
    faults = [Fault("a", 1.0, "x", 2.0, 20, place=name) for name in ("one", "two")]
    assert len(worst(faults, apart=5.0)) == 2


def test_a_gap_is_told_in_its_middle_with_its_length(tmp_path: Path) -> None:
    faults = run_faults(flight_of(tmp_path, landing(gap=range(30, 41))))
    (gap,) = [fault for fault in faults if fault.kind == "gap"]
    assert 30 <= gap.frame < 41
    assert gap.words == "the pad was not measured for 0.6 s, bridged by prediction"
    assert [fault.words for fault in faults if fault.kind == "reason"] == ["nothing of the pad found"]


def test_a_gap_without_a_track_weighs_more(tmp_path: Path) -> None:
    rows = landing(gap=range(30, 40))
    rows[30:40] = [result(i) for i in range(30, 40)]
    (gap,) = [fault for fault in run_faults(flight_of(tmp_path, rows)) if fault.kind == "gap"]
    assert gap.words.endswith("and no track that foretold its place")
    assert gap.size > 5.0


def test_what_was_foretold_worst_is_first(tmp_path: Path) -> None:
    flight = flight_of(tmp_path, landing())
    faults = [fault for fault in run_faults(flight) if fault.kind == "prediction"]
    assert faults[0].words.startswith("the prediction made 0.5 s before was 0.4")
    assert faults[0].size == max(fault.size for fault in faults)


def test_a_pose_that_the_track_did_not_take_is_told(tmp_path: Path) -> None:
    rows = landing()
    rows[50] = measured(50, 2.0, tracks=(track((5.0, 0.0), (6.0, 0.0), "coasting"),))
    faults = [fault for fault in run_faults(flight_of(tmp_path, rows)) if fault.kind == "refused"]
    assert [(fault.frame, fault.words) for fault in faults] == [
        (50, "a pose by tag at 2.0 m did not go into the track"),
    ]


def test_truth_tells_misses_false_alarms_flips_and_errors(tmp_path: Path) -> None:
    write_error_tables(write_evaluation(tmp_path))
    faults = evaluation_faults(read_evaluation(tmp_path).tables)
    assert [fault.kind for fault in faults[:2]] == ["flip", "miss"]
    assert (faults[0].place, faults[0].frame) == ("straight", 40)
    assert faults[1].frame == 30
    words = {moment.fault.words for moment in worst(faults, apart=0.5)}
    assert "missed: the detector did not find a pad of 20 px" in words
    assert "false alarm: pad of score 0.70 where there is none" in words


def test_a_box_of_a_clip_is_in_the_clip_at_its_time(tmp_path: Path) -> None:
    write_error_tables(write_evaluation(tmp_path))
    with (tmp_path / "boxes.csv").open("a", encoding="utf-8") as file:
        file.write("shipped,straight,straight.mp4,30,target,pad,0,,,9,3,0,,\n")
    faults = evaluation_faults(read_evaluation(tmp_path).tables)
    (missed,) = [fault for fault in faults if fault.kind == "missed target" and fault.frame == 30]
    assert (missed.place, missed.at) == ("straight", 1.5)


def test_what_no_landing_feels_is_no_fault(tmp_path: Path) -> None:
    write_error_tables(write_evaluation(tmp_path))
    text = (tmp_path / "pose_errors.csv").read_text(encoding="utf-8").splitlines()
    near = "shipped,straight,{},0,tag,near,5,5,20,0,1,{},0.01,0.01,{},1,0,1,1"
    rows = [near.format(0, 0.004, 0.5), near.format(1, 0.04, 1.9), near.format(2, 0.064, 2.5)]
    (tmp_path / "pose_errors.csv").write_text("\n".join([text[0], *rows]) + "\n", encoding="utf-8")
    faults = [f for f in evaluation_faults(read_evaluation(tmp_path).tables) if f.kind in ("place", "normal")]
    assert [fault.words for fault in faults] == [
        "the pad's place 64 mm off at 5.0 m (1.3 %), by tag",
        "the pad's tilt 2.5 deg off at 5.0 m, by tag",
    ]


def test_a_prediction_that_came_true_is_no_fault(tmp_path: Path) -> None:
    rows = landing()[:5]  # in the first frames it is off by a millimetre a frame
    assert [fault for fault in run_faults(flight_of(tmp_path, rows)) if fault.kind == "prediction"] == []


def test_a_length_has_the_digits_that_tell_something() -> None:
    assert [length(metres) for metres in (0.0004, 0.0123, 0.0994, 0.0996, 1.234)] == [
        "0.4 mm", "12 mm", "99 mm", "0.10 m", "1.23 m",
    ]  # fmt: skip
