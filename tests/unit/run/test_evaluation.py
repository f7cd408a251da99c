"""A dataset through every stage: what is scored of each part, and what one that is broken costs the others."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from landtool.config import EvalConfig, TrackConfig
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import SHIPPED_MODEL
from landtool.errors import InputError, UsageError
from landtool.evaluate.metric import Metric
from landtool.evaluate.record import read_metrics
from landtool.io.tables import read_rows
from landtool.run import detection, evaluation, tracking
from landtool.run.eval_request import EvalRequest
from landtool.run.evaluation import EvalOutcome, evaluate
from tests.cli.landing import Landing, cut, record
from tests.evaluated import BOXES, CLOCK, COUNT, POSES, add_clip, add_stills, write_truth
from tests.shared import ROOT

EVERY = 7
TABLES = {"save": ("csv",)}
MODEL = ROOT / "landtool/models" / SHIPPED_MODEL
Evaluate = Callable[..., EvalOutcome]


@pytest.fixture(scope="module")
def landing(tmp_path_factory: pytest.TempPathFactory) -> Landing:
    return record(tmp_path_factory.mktemp("landing"))


_once = cache(detection.load_detector)


@pytest.fixture(autouse=True)
def _networks_are_loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for user in (evaluation, tracking):
        monkeypatch.setattr(user, "load_detector", _once)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return tmp_path / "data"


@pytest.fixture
def run(tmp_path: Path, data: Path) -> Evaluate:
    """Return a function that evaluates `data` at some stages into `out`; other names are those of the request."""

    def call(*stages: str, others: dict[str, Any] | None = None, **changes: Any) -> EvalOutcome:
        settings = EvalConfig(dataset=data, stages=stages, **{"every": EVERY, "save": (), **(others or {})})
        request = EvalRequest(settings, TrackConfig(dehaze="off"), tmp_path / "out", overwrite=True)
        return evaluate(replace(request, **changes))

    return call


def numbers(outcome: EvalOutcome) -> dict[str, Metric]:
    return {metric.key: metric for metric in outcome.record.metrics}


class TestStages:
    def test_boxes_alone_are_not_followed(self, landing: Landing, data: Path, run: Evaluate) -> None:
        (add_clip(landing, data).parent / "a.camera.yaml").unlink()  # none is needed
        outcome = run("detection", others=TABLES)
        found = numbers(outcome)
        assert (found["detection.recall"].value, found["detection.recall"].count) == (1.0, COUNT // EVERY)
        assert {metric.stage for metric in found.values()} == {"detection", "speed"}
        assert sorted(path.name for path in outcome.folder.iterdir()) == ["boxes.csv", "metrics.csv", "metrics.json"]
        assert outcome.record.notes == ()

    def test_poses_and_track_are_those_of_track(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_clip(landing, data)
        outcome = run("pose", "track", others=TABLES)
        found = numbers(outcome)
        assert found["pose.pose_share"].value == 1.0
        median = found["pose.place_percent_median"].value
        assert median is not None
        assert 0.0 < median < 2.0
        assert found["time.rate_ppm"].value == pytest.approx(0.0, abs=50.0)
        assert {path.name for path in (outcome.folder / "runs/a").iterdir()} >= {"poses.csv", "run.json", "track.png"}
        assert len(list(read_rows(outcome.folder / "pose_errors.csv", {"frame": int}))) == COUNT
        assert not (outcome.folder / "boxes.csv").exists()
        assert outcome.record.exit_code == 0

    def test_what_no_stage_asks_for_is_not_opened(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_clip(landing, data)
        for end in ("camera.yaml", "truth.csv", "ego.csv", "mp4"):
            (data / f"a.{end}").write_text("broken")
        outcome = run("dehaze")
        assert outcome.record.exit_code == 3
        assert [note.partition(": ")[2] for note in outcome.record.notes] == [
            "nothing to evaluate with was found: every number is undefined, 0 of 0"
        ]
        assert {metric.said for metric in outcome.record.metrics} == {"undefined, 0 of 0"}

    def test_all_parts_are_one_set(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_clip(landing, data)
        add_stills(landing, data / "stills")
        outcome = run("detection")
        assert numbers(outcome)["detection.recall"].of == COUNT // EVERY + 2
        assert [(part.name, part.kind, part.frames) for part in outcome.record.parts] == [
            ("a", "clip", COUNT), ("stills", "stills", 2),
        ]  # fmt: skip
        assert outcome.record.speed[0].stage == "look"
        assert outcome.record.speed[0].frames == COUNT // EVERY + 2

    def test_as_many_pictures_as_were_expected(self, landing: Landing, data: Path, tmp_path: Path) -> None:
        add_clip(landing, data)
        add_stills(landing, data / "stills")
        told: Counter[str] = Counter()
        evaluate(
            EvalRequest(EvalConfig(dataset=data, every=5, save=()), TrackConfig(dehaze="off"), tmp_path / "out"),
            on_expect=lambda count: told.update(expected=count),
            on_picture=lambda: told.update(seen=1),
        )
        assert told["expected"] == told["seen"] == COUNT + 3 + 2

    def test_nothing_but_metrics_json_may_be_kept(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_stills(landing, data)
        outcome = run("detection")
        assert [path.name for path in outcome.folder.iterdir()] == ["metrics.json"]

    def test_the_same_again_is_the_same(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_clip(landing, data)
        outcomes = [run("detection", "track") for _ in range(2)]
        first, second = ([m for m in outcome.record.metrics if m.stage != "speed"] for outcome in outcomes)
        assert first == second
        assert outcomes[0].record.digest == outcomes[1].record.digest


class TestTruth:
    @pytest.mark.parametrize(
        ("frames", "said"),
        [
            (range(COUNT + 3), f"a: frames of the truth that the recording does not have: 3 of {COUNT + 3}"),
            (range(9), f"a: frames without truth: 5 of {COUNT}"),
            (range(2, COUNT), f"a: frames without truth: 2 of {COUNT}"),
        ],
    )
    def test_another_length_is_said(
        self, frames: range, said: str, landing: Landing, data: Path, run: Evaluate
    ) -> None:
        write_truth(add_clip(landing, data).with_name("a.truth.csv"), frames=frames)
        outcome = run("pose")
        assert outcome.record.notes == (said,)
        assert outcome.record.exit_code == 0
        assert numbers(outcome)["pose.pose_share"].of == len(set(frames) & set(range(COUNT)))

    @pytest.mark.parametrize(
        ("groups", "scored", "undefined", "said"),
        [
            ((*CLOCK, *BOXES), "detection.recall", "pose.pose_share", "no camera_T_pad"),
            ((*CLOCK, *POSES), "pose.pose_share", "detection.recall", "no box: detection cannot be told from it"),
            (("frame", *POSES), "pose.pose_share", "time.rate_ppm", "no t_ns: velocities, lag, predictions"),
            (("t_ns", *POSES), "track.place_rmse_m", "time.rate_ppm", "no frame: the clock's rate cannot be told"),
        ],
        ids=["boxes only", "poses only", "no clock", "no numbers"],
    )  # fmt: skip
    def test_what_it_does_not_tell_is_undefined(
        self,
        groups: tuple[str, ...],
        scored: str,
        undefined: str,
        said: str,
        landing: Landing,
        data: Path,
        run: Evaluate,
    ) -> None:
        write_truth(add_clip(landing, data).with_name("a.truth.csv"), groups)
        outcome = run("detection", "pose", "track")
        found = numbers(outcome)
        assert any(said in note for note in outcome.record.notes)
        assert found[undefined].value is None
        # the landing is over before a track is judged
        assert found[scored].value is not None or found[scored].key == "track.place_rmse_m"
        assert outcome.record.exit_code == 0

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (lambda text: text[:700], r"a\.truth\.csv: line \d: .*; the file may be cut"),
            (lambda text: text.splitlines()[0] + "\n", r"a\.truth\.csv: holds no frames"),
            (lambda _: "", r"a\.truth\.csv: is empty"),
            (lambda text: text.replace("frame,t_ns", "number,time"), r"neither a column frame nor t_ns"),
        ],
    )
    def test_a_broken_one_alone_is_the_error(
        self, change: Callable[[str], str], said: str, landing: Landing, data: Path, run: Evaluate
    ) -> None:
        truth = add_clip(landing, data).with_name("a.truth.csv")
        truth.write_text(change(truth.read_text()))
        with pytest.raises(InputError, match=said):
            run("detection")
        assert not (data.parent / "out").exists()

    def test_pictures_that_truth_csv_leaves_out_are_said(self, data: Path, run: Evaluate) -> None:
        shutil.copytree(ROOT / "datasets/fixtures/stills", data)
        rows = (data / "truth.csv").read_text().splitlines(keepends=True)
        left = [row for row in rows if "images/test/" in row]
        (data / "truth.csv").write_text("".join(row for row in rows if row != left[0]))
        outcome = run("detection")
        assert f"{data.name}: pictures that truth.csv does not tell of: 1" in outcome.record.notes


class TestFailures:
    def test_one_part_costs_the_others_nothing(
        self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path
    ) -> None:
        add_clip(landing, data)
        add_clip(landing, data, "b").with_name("b.pad.toml").write_text("diamter_m = 1\n")
        outcome = run("pose", junit=tmp_path / "j/unit.xml")
        (note,) = outcome.record.notes
        assert note.startswith("b was not scored: ")
        assert note.endswith("unknown key 'diamter_m'; nearest known key is 'diameter_m'")
        assert outcome.record.exit_code == 3
        assert numbers(outcome)["pose.pose_share"].of == COUNT
        assert [path.name for path in (outcome.folder / "runs").iterdir()] == ["a"]
        assert (tmp_path / "j/unit.xml").read_text().count("<error ") == 1

    def test_where_none_can_be_scored_junit_says_so_too(
        self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path
    ) -> None:
        add_clip(landing, data).with_name("a.camera.yaml").unlink()
        with pytest.raises(UsageError, match="no camera calibration; pass --camera FILE"):
            run("pose", junit=tmp_path / "unit.xml")
        assert "no camera calibration" in (tmp_path / "unit.xml").read_text()
        assert not (tmp_path / "out").exists()

    def test_a_recording_that_is_cut_is_scored_with_loss(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_clip(landing, data).unlink()
        cut(landing.log(data / "a.mcap"), 0.5)
        for stage in ("pose", "detection"):
            outcome = run(stage)
            assert outcome.record.exit_code == 3
            assert any("the log is cut at byte" in note for note in outcome.record.notes)

    def test_a_picture_that_cannot_be_decoded(self, landing: Landing, data: Path, run: Evaluate) -> None:
        cut(add_stills(landing, data / "x") / "images/0.png", 0.5)
        add_stills(landing, data / "y")
        outcome = run("detection")
        assert outcome.record.exit_code == 3
        assert "x was not scored" in outcome.record.notes[-1]
        assert numbers(outcome)["detection.recall"].of == 2

    def test_an_interruption_leaves_nothing(self, landing: Landing, data: Path) -> None:
        add_clip(landing, data)

        def stop() -> None:
            raise KeyboardInterrupt

        settings = EvalConfig(dataset=data, stages=("track",))
        with pytest.raises(KeyboardInterrupt):
            evaluate(EvalRequest(settings, TrackConfig(), data.parent / "out"), on_picture=stop)
        assert [path.name for path in data.parent.iterdir()] == ["data"]

    def test_nothing_at_all_is_undefined(self, data: Path, run: Evaluate) -> None:
        data.mkdir()
        outcome = run("detection", "pose", "track", "dehaze")
        assert outcome.record.exit_code == 3
        assert {metric.said for metric in outcome.record.metrics} == {"undefined, 0 of 0"}
        _, read = read_metrics(outcome.folder)
        assert read == outcome.record.metrics


class TestNetworks:
    def test_side_by_side(self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path) -> None:
        add_clip(landing, data)
        models = []
        for folder in ("one", "two"):
            (tmp_path / folder).mkdir()
            models.append(Path(shutil.copy(MODEL, tmp_path / folder / "net.onnx")))
        outcome = run("detection", "track", models=tuple(models))
        assert [model.name for model in outcome.record.models] == ["one-net", "two-net"]
        assert sorted(p.relative_to(outcome.folder).as_posix() for p in outcome.folder.glob("runs/*/*")) == [
            "runs/one-net/a", "runs/two-net/a",
        ]  # fmt: skip
        recalls = [m for m in outcome.record.metrics if m.key == "detection.recall"]
        assert [(m.model, m.value) for m in recalls] == [("one-net", 1.0), ("two-net", 1.0)]
        with pytest.raises(UsageError, match="two models of one name"):
            run("detection", models=(models[0], models[0]))
        with pytest.raises(UsageError, match="a baseline is about one network"):
            run("detection", models=tuple(models), others={"baseline": tmp_path / "b.json"})

    def test_one_that_finds_nothing(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_stills(landing, data)
        outcome = run("detection", config=TrackConfig(detector=DetectorConfig(conf=1.0)))
        found = numbers(outcome)
        assert found["detection.recall"].value == 0.0
        assert found["detection.precision"].said == "undefined, 0 of 0"
        assert found["detection.mean_iou"].said == "undefined, 0 of 2"

    def test_classes_it_does_not_have(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_stills(landing, data, name="car")
        outcome = run("detection")
        assert numbers(outcome)["detection.map50"].value == 0.0
        assert "targets of 'car' count as missed, as the model has no such class: 2" in outcome.record.notes
        assert any(note.startswith("detections of 'pad' are left out") for note in outcome.record.notes)

    def test_classes_are_told_apart_by_name(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_stills(landing, data / "a", name="car")
        add_stills(landing, data / "b", name="pad")
        found = numbers(run("detection"))
        assert (found["detection.recall"].value, found["detection.recall"].of) == (0.5, 4)


class TestBaseline:
    def test_it_is_kept_and_held(self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path) -> None:
        add_stills(landing, data)
        kept = {"baseline": tmp_path / "b.json"}
        assert run("detection", others=kept, update_baseline=True).kept
        same = run("detection", others=kept)
        assert same.gate is not None
        assert (same.gate.passed, same.record.exit_code, same.kept) == (True, 0, False)
        worse = run("detection", others=kept, config=TrackConfig(detector=DetectorConfig(conf=1.0)))
        assert worse.gate is not None
        assert worse.record.exit_code == 1
        assert {row.key for row in worse.gate.of("worse")} == {"detection.recall"}
        written = json.loads((worse.folder / "metrics.json").read_text())
        assert written["gate"]["passed"] is False
        assert "the baseline was made with other settings" in worse.record.notes

    def test_a_run_with_a_failed_part_is_not_kept(
        self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path
    ) -> None:
        add_stills(landing, data / "good")
        cut(add_stills(landing, data / "bad") / "images/0.png", 0.5)
        outcome = run("detection", others={"baseline": tmp_path / "b.json"}, update_baseline=True)
        assert not outcome.kept
        assert not (tmp_path / "b.json").exists()
        assert outcome.record.notes[-1].endswith("b.json: not written, as not all of the data could be scored")
        assert outcome.record.exit_code == 3

    def test_nor_is_one_of_nothing(self, data: Path, run: Evaluate, tmp_path: Path) -> None:
        data.mkdir()
        assert not run("detection", others={"baseline": tmp_path / "b.json"}, update_baseline=True).kept
        assert not (tmp_path / "b.json").exists()

    @pytest.mark.parametrize(
        ("evaluated", "changes", "said"),
        [
            ({"tolerance": Path("t.toml")}, {}, "a tolerance, but no numbers to compare with"),
            ({}, {"update_baseline": True}, "no baseline to update; say where it is with --baseline FILE"),
            ({"baseline": Path("none.json")}, {}, r"none\.json: does not exist; .*--update-baseline"),
            ({"baseline": Path("a.txt")}, {"update_baseline": True}, r"a\.txt: is no baseline, and would be replaced"),
            ({"baseline": Path()}, {"update_baseline": True}, "is a folder, a file is to be written; .*--baseline"),
            ({}, {"junit": Path()}, "is a folder, a file is to be written; choose another --junit"),
            ({}, {"config": TrackConfig(camera=Path("no.yaml"))}, r"no\.yaml: does not exist"),
            ({}, {"config": TrackConfig(pad=Path("no.toml"))}, r"no\.toml: does not exist"),
            ({"baseline": Path("out/b.json")}, {"update_baseline": True}, r"out: holds the input out/b\.json"),
        ],
    )
    def test_what_cannot_be_is_told_before_the_work(
        self,
        evaluated: dict[str, Any],
        changes: dict[str, Any],
        said: str,
        landing: Landing,
        data: Path,
        run: Evaluate,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        add_stills(landing, data)
        (tmp_path / "a.txt").write_text("mine")
        with pytest.raises(UsageError, match=said):
            run("detection", others=evaluated, **{"folder": Path("out"), **changes})
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "data"]
        assert (tmp_path / "a.txt").read_text() == "mine"


class TestWhatWins:
    def test_what_lies_beside_wins_and_what_was_given_in_vain_is_said(
        self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path
    ) -> None:
        add_clip(landing, data)
        shutil.copy(data / "a.camera.yaml", tmp_path / "cam.yaml")
        outcome = run("pose", config=TrackConfig(camera=tmp_path / "cam.yaml", dehaze="off"))
        assert outcome.record.notes == ("the camera given was not used: every recording has a calibration beside it",)

    def test_what_is_given_is_taken_where_nothing_lies_beside(
        self, landing: Landing, data: Path, run: Evaluate, tmp_path: Path
    ) -> None:
        add_clip(landing, data)
        (data / "a.camera.yaml").rename(tmp_path / "cam.yaml")
        config = TrackConfig(camera=tmp_path / "cam.yaml", dehaze="off")
        assert numbers(run("pose", config=config))["pose.pose_share"].value == 1.0
        half = numbers(run("pose", config=replace(config, diameter_m=0.5)))
        off = half["pose.place_percent_median"].value
        assert off == pytest.approx(50.0, abs=2.0)

    def test_settings_of_other_kinds_of_recordings_do_not_matter(
        self, landing: Landing, data: Path, run: Evaluate
    ) -> None:
        add_clip(landing, data)
        outcome = run("detection", config=TrackConfig(fps=30.0, topic="/image", dehaze="off"))
        assert outcome.record.exit_code == 0

    def test_a_folder_of_pictures_gets_its_clock(self, landing: Landing, data: Path, run: Evaluate) -> None:
        add_clip(landing, data).unlink()
        landing.images(data / "a")
        write_truth(data / "a.truth.csv", ("frame", *POSES, *BOXES), range(4))
        outcome = run("track", others=TABLES, config=TrackConfig(fps=30.0, dehaze="off"))
        assert outcome.record.exit_code == 0
        errors = list(read_rows(outcome.folder / "track_errors.csv", {"t_ns": int}))
        assert errors[-1]["t_ns"] == 100_000_000
