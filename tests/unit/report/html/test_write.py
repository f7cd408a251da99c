"""The page as a whole: what is in it, what is said of what is not, and what is refused."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.io.tables import TABLES
from landtool.report.html.film import Budget, film, stills
from landtool.report.html.flight import read_flight
from landtool.report.html.folders import read_folder
from landtool.report.html.write import write_report
from tests.unit.report.html.runs import (
    GATE,
    gate_row,
    landing,
    metric,
    write_error_tables,
    write_evaluation,
    write_landing,
)
from tests.unit.report.landings import STEP_NS, measured, result

VOID = {"meta", "link", "br", "img", "input", "hr"}


class Checker(HTMLParser):
    """Follows the elements; every one that opens closes."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("script", "style"):
            self.text += data


def page(folder: Path, output: Path, **options: Any) -> tuple[str, Checker]:
    """Write the report, check that its elements close and that it asks nothing of a network, and return it."""
    write_report(folder, output, **options)
    text = output.read_text(encoding="utf-8")
    checker = Checker()
    checker.feed(text)
    assert checker.open == []
    for _, attrs in checker.seen:
        for name in ("src", "href"):
            assert not re.match(r"(https?:)?//", attrs.get(name) or "")
    assert not re.search(r"\b(nan|NaN|inf|None|Undefined)\b", re.sub(r"<script.*?</script>", "", text, flags=re.S))
    return text, checker


def test_a_run_shows_its_verdict_first(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing(gap=range(30, 40)), notes=("the lens was dirty",))
    text, checker = page(run, tmp_path / "r.html")
    words = " ".join(checker.text.split())
    assert "Tracked, with gaps" in words
    for line in json.loads((run / "run.json").read_text())["verdict"]["lines"]:
        assert line in words
    assert "the lens was dirty" in words
    assert text.index("Tracked, with gaps</h2>") < text.index("<video") < text.index('id="worst"')
    assert "ab" * 32 in words
    assert "tracker.horizon_s" in words
    assert [attrs["role"] for _, attrs in checker.seen if attrs.get("class") == "timeline"] == ["slider"]
    pictures = [attrs for tag, attrs in checker.seen if tag == "img"]
    assert 3 <= len(pictures) <= 12
    assert all((attrs["src"] or "").startswith("data:image/jpeg;base64,/9j/") for attrs in pictures)


def test_the_same_run_makes_the_same_page(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing())
    first, _ = page(run, tmp_path / "a.html")
    second, _ = page(run, tmp_path / "b.html")
    assert first == second


@pytest.mark.parametrize("name", ["a<b>&\"c'.mp4", "дрон 着陸.mp4", "</script><script>alert(1)</script>.mp4"])
def test_names_are_texts_and_nothing_else(name: str, tmp_path: Path) -> None:
    rows = landing()
    rows[40] = measured(40, 2.0, reason=f"strange: {name}")
    text, checker = page(write_landing(tmp_path / "run", rows, name=name, notes=(name,)), tmp_path / "r.html")
    assert name.rsplit("/", 1)[-1] in checker.text
    assert f"strange: {name}" in checker.text
    assert text.count("<script") == 3  # the video, the timeline, the page's own
    assert "<b>&" not in text


def test_the_video_is_embedded_linked_or_left_out(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "a b&c" / "run", landing())
    embedded, _ = page(run, tmp_path / "e.html", video="embed")
    assert 'type="text/plain" id="data-run"' in embedded
    linked, checker = page(run, tmp_path / "l.html", video="link")
    (source,) = [attrs["src"] for tag, attrs in checker.seen if tag == "video"]
    assert source == "a%20b%26c/run/annotated.mp4"
    assert "has to stay where it is" in checker.text
    without, _ = page(run, tmp_path / "n.html", video="none")
    assert "<video" not in without
    assert "<img" in without
    assert len(without) < len(linked) + 1000 < len(embedded)


def test_auto_links_what_is_too_large(tmp_path: Path) -> None:
    run = read_folder(write_landing(tmp_path / "run", landing()))
    flight = read_flight(run)
    assert flight is not None
    assert run.video is not None
    size = run.video.stat().st_size
    budget = Budget(2 * size - 1)
    assert film(run.video, flight, tmp_path / "r.html", "auto", budget, without="").data
    second = film(run.video, flight, tmp_path / "r.html", "auto", budget, without="")
    assert (second.data, second.url) == ("", "run/annotated.mp4")


def test_a_lost_frame_shows_the_picture_before_it(tmp_path: Path) -> None:
    rows = landing()
    rows[20] = result(20, stage=None, status="damaged", reason="its data cannot be decoded")
    run = read_folder(write_landing(tmp_path / "run", rows))
    flight = read_flight(run)
    assert flight is not None
    shown = film(run.video, flight, tmp_path / "r.html", "auto", Budget(), without="").shown_s
    assert shown is not None
    assert shown[20] == shown[19]
    assert shown[21] == pytest.approx(21 * STEP_NS / 1e9, abs=1e-6)
    _, checker = page(run.path, tmp_path / "r.html")
    assert "no picture could be got from the recording" in checker.text


def test_a_late_video_is_sought_by_its_own_clock(tmp_path: Path) -> None:
    run = read_folder(write_landing(tmp_path / "run", landing(), start_ns=700_000_000))
    flight = read_flight(run)
    assert flight is not None
    made = film(run.video, flight, tmp_path / "r.html", "auto", Budget(), without="")
    assert made.shown_s is not None
    assert made.shown_s == pytest.approx([0.7 + i * STEP_NS / 1e9 for i in range(60)], abs=1e-6)
    levels = [
        cv2.imdecode(np.frombuffer(base64.b64decode(jpeg), np.uint8), cv2.IMREAD_COLOR).mean()  # type: ignore[union-attr]
        for jpeg in stills(made, [0, 30, 59])
    ]
    assert levels == pytest.approx([20, 80, 138], abs=3)


def test_a_cut_video_is_said_and_the_rest_is_there(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing())
    video = run / "annotated.mp4"
    video.write_bytes(video.read_bytes()[:700])
    text, checker = page(run, tmp_path / "r.html")
    assert "No video: annotated.mp4 cannot be used" in checker.text
    assert "<video" not in text
    assert '<div class="timeline"' in text


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (landing(1), "longest gap undefined: measured once"),
        (landing(clock=False), "The recording has no clock"),
        ([result(i, stage="far") for i in range(60)], "No pad found"),
        ([], "No frames"),
    ],
    ids=["one frame", "no clock", "no pose", "no frame"],
)
def test_runs_with_little_in_them_are_told_of(rows: list[Any], said: str, tmp_path: Path) -> None:
    _, checker = page(write_landing(tmp_path / "run", rows), tmp_path / "r.html")
    assert said in checker.text


def test_missing_tables_are_named(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing(), tables=(), video=False)
    text, checker = page(run, tmp_path / "r.html")
    assert all(f"{name} was not saved" in checker.text for name in TABLES)
    assert "No timeline" in checker.text
    assert "timeline-run" not in text


def test_a_broken_table_is_said(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing())
    (run / "poses.csv").write_text("frame,t_ns\n1,x\n", encoding="utf-8")
    _, checker = page(run, tmp_path / "r.html")
    assert "poses.csv cannot be used: line 1: not exactly one column method" in checker.text


def test_a_run_of_a_version_without_words_is_shown_by_its_numbers(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing())
    record = json.loads((run / "run.json").read_text())
    del record["verdict"]["lines"]
    (run / "run.json").write_text(json.dumps(record))
    _, checker = page(run, tmp_path / "r.html")
    assert "of an earlier landtool" in checker.text
    assert "prediction_rms_m" in checker.text


def test_an_evaluation_shows_gate_numbers_and_clips(tmp_path: Path) -> None:
    folder = write_evaluation(tmp_path / "eval", gate=GATE)
    write_error_tables(folder)
    write_landing(folder / "runs" / "straight", landing())
    write_landing(folder / "runs" / "turn", [], video=False)
    text, checker = page(folder, tmp_path / "e.html")
    words = " ".join(checker.text.split())
    assert "Gate not met" in words
    assert "2 worse than allowed" in words
    assert "0.953 (0.8577 to 1.048), 120 of 126" in words
    assert "undefined, 0 of 0" in words
    assert "near 1" in words
    for model in ("shipped", "other"):
        assert f'<th scope="col">{model}</th>' in text
    assert 'id="clip-0"' in text
    assert 'id="clip-1"' in text
    assert "Precision and recall" in words
    assert "track_errors.csv was not saved" in words
    assert "straight, frame 40" in words


def test_the_gate_shows_what_is_not_the_same_first(tmp_path: Path) -> None:
    text, _ = page(write_evaluation(tmp_path / "eval", gate=GATE), tmp_path / "e.html")
    gate = text[text.index('<div id="gate">') : text.index("In short")]
    opened, folded = gate.split("<details>")
    rows = re.findall(r'<tr( class="row-bad")?><th scope="row">(.*?)</th>(.*?)</tr>', opened)
    assert [(bool(mark), key) for mark, key, _ in rows] == [
        (True, "detection.map50"),
        (True, "pose.normal_deg_median"),
        (True, "pose.place_percent_median"),
    ]
    cells = [dict(re.findall(r'<td data-name="(.*?)">(.*?)</td>', row)) for _, _, row in rows]
    assert cells[0] == {
        "baseline": "0.95", "now": "0.7", "interval": "0.6 to 0.8", "allowed": "0.02", "worse by": "0.25",
        "verdict": "worse",
    }  # fmt: skip
    assert (cells[2]["now"], cells[2]["verdict"]) == ("undefined", "gone")
    assert "The same: 1</summary>" in folded
    assert "tags.read" in folded


def test_a_gate_without_a_change_says_so(tmp_path: Path) -> None:
    same = {"passed": True, "baseline": "b.json", "rows": [gate_row("tags.read", 0.9, 0.9, "same", by=0.0)]}
    assert (
        "Nothing left its tolerance: 1 compared."
        in page(write_evaluation(tmp_path / "eval", gate=same), tmp_path / "e.html")[1].text
    )
    empty = {"passed": False, "baseline": "b.json", "rows": [gate_row("tags.read", None, 0.9, "new")]}
    words = page(write_evaluation(tmp_path / "new", gate=empty), tmp_path / "n.html")[1].text
    assert "Nothing could be compared, against b.json" in words
    assert "left its tolerance" not in words


def test_why_there_is_no_video_is_said(tmp_path: Path) -> None:
    said = {}
    for name, save in (("none", ("csv",)), ("lost", ("csv", "video"))):
        run = write_landing(tmp_path / name, landing(), video=False, save=save)
        said[name] = page(run, tmp_path / f"{name}.html")[1].text
    assert "the run saved none; give `landtool track` --save csv,video for one." in said["none"]
    assert "annotated.mp4 is missing: the run saved one" in said["lost"]
    assert "the run saved none" not in said["lost"]
    folder = write_evaluation(tmp_path / "eval")
    write_landing(folder / "runs" / "straight", landing(), video=False, save=("csv",))
    assert "give `landtool eval` --save csv,video for one." in page(folder, tmp_path / "e.html")[1].text


def test_the_run_of_an_evaluation_has_truth(tmp_path: Path) -> None:
    assert "The run has no truth" in page(write_landing(tmp_path / "run", landing()), tmp_path / "r.html")[1].text
    folder = write_evaluation(tmp_path / "eval")
    write_landing(folder / "runs" / "straight", landing())
    assert "no truth" not in page(folder, tmp_path / "e.html")[1].text


def test_times_say_what_their_stages_are(tmp_path: Path) -> None:
    spent = [{"model": "shipped", "stage": name, "frames": 10, "seconds": 0.3} for name in ("detect", "look")]
    folder = write_evaluation(tmp_path / "eval", speed=spent)
    words = page(folder, tmp_path / "e.html")[1].text
    assert "detect: the network inside `landtool track`" in words
    assert "look: one whole look of the network at a picture with its rings, as in `landtool detect`" in words
    assert "tags: reading" not in words


def test_clips_come_in_the_order_of_the_models(tmp_path: Path) -> None:
    folder = write_evaluation(tmp_path / "eval")
    for name in ("other/a", "other/b", "shipped/a", "shipped/b"):
        write_landing(folder / "runs" / name, landing(2), video=False)
    text, _ = page(folder, tmp_path / "e.html")
    assert re.findall(r'class="flight"><h2>(.*?)</h2>', text) == ["shipped/a", "shipped/b", "other/a", "other/b"]


def test_an_evaluation_of_nothing_is_undefined(tmp_path: Path) -> None:
    empty = [metric("detection", "map50", None, 0, 0)]
    folder = write_evaluation(tmp_path / "eval", metrics=empty, curves=[], speed=[], models=[])
    _, checker = page(folder, tmp_path / "e.html")
    assert "undefined, 0 of 0" in checker.text
    assert "Measured, no gate" in checker.text
    assert "runs/ holds no run of the clips" in checker.text
    assert "no curve: 0 of 0 targets" in checker.text
    nothing = write_evaluation(tmp_path / "none", metrics=[], curves=[], speed=[], models=[])
    assert "no number at all: undefined, 0 of 0" in page(nothing, tmp_path / "n.html")[1].text


def test_a_broken_run_of_a_clip_does_not_take_the_page_with_it(tmp_path: Path) -> None:
    folder = write_evaluation(tmp_path / "eval")
    (folder / "runs" / "straight").mkdir(parents=True)
    (folder / "runs" / "straight" / "run.json").write_text("{")
    _, checker = page(folder, tmp_path / "e.html")
    assert "No run: is no JSON." in checker.text


def test_what_is_neither_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        write_report(tmp_path / "none", tmp_path / "r.html")
    with pytest.raises(UsageError, match="neither a run nor an evaluation"):
        write_report(tmp_path, tmp_path / "r.html")
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="is no folder"):
        write_report(tmp_path / "file", tmp_path / "r.html")
    write_landing(tmp_path / "track" / "flight", landing(2), video=False)
    with pytest.raises(UsageError, match=r"holds a run and is none itself; give .*flight"):
        write_report(tmp_path / "track", tmp_path / "r.html")
    assert not (tmp_path / "r.html").exists()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "is no JSON"),
        ("[]", "is no JSON object"),
        ('{"command": "track"}', "has no key config"),
        ('{"a": NaN}', "is no JSON"),
        ("\0\0", "is no JSON"),
    ],
)
def test_a_broken_record_is_refused(text: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(InputError, match=reason):
        write_report(tmp_path, tmp_path / "r.html")


def test_another_command_has_no_landing(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing(2), video=False)
    text = (run / "run.json").read_text().replace('"command": "track"', '"command": "detect"')
    (run / "run.json").write_text(text)
    with pytest.raises(UsageError, match="is a run of `landtool detect`"):
        write_report(run, tmp_path / "r.html")


def test_outputs_that_cannot_be_are_refused(tmp_path: Path) -> None:
    run = write_landing(tmp_path / "run", landing(2))
    with pytest.raises(UsageError, match=r"end it with \.html"):
        write_report(run, run / "frames.csv")
    (tmp_path / "r.html").write_text("mine")
    with pytest.raises(OutputExistsError):
        write_report(run, tmp_path / "r.html")
    assert (tmp_path / "r.html").read_text() == "mine"
    (tmp_path / "link.html").symlink_to(run / "run.json")
    with pytest.raises(UsageError, match="is the input itself"):
        write_report(run, tmp_path / "link.html", overwrite=True)
    write_report(run, tmp_path / "r.html", overwrite=True)
    with pytest.raises(UsageError, match="no way to show a video"):
        write_report(run, tmp_path / "s.html", video="film")  # type: ignore[arg-type]
