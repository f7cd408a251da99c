"""The numbers that are kept: written, read back, and refused where they are none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from landtool.errors import InputError, UsageError
from landtool.evaluate.baseline import Baseline, read_baseline, settings_digest, write_baseline
from tests.unit.evaluate.metrics import made

KEPT = Baseline(
    "da", "5e",
    (
        made("pose.place_m", 0.1 + 0.2, low=0.25, high=0.35),
        made("detection.map50", None, "higher"),
        made("detection.recall:size_px=0-14", 0.5, "higher"),
        made("track.nees", 1.2, "expected", expected=1.0),
    ),
)  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Return a baseline in a file."""
    path = tmp_path / "baseline.json"
    write_baseline(path, KEPT)
    return path


def test_what_is_read_is_what_was_written(file: Path) -> None:
    read = read_baseline(file)
    assert sorted(read.metrics, key=lambda m: m.key) == sorted(KEPT.metrics, key=lambda m: m.key)
    assert (read.dataset, read.settings, read.version) == (KEPT.dataset, KEPT.settings, KEPT.version)


def test_a_change_of_one_number_changes_one_line(file: Path, tmp_path: Path) -> None:
    other = Baseline("da", "5e", (*reversed(KEPT.metrics[1:]), made("pose.place_m", 0.4, low=0.25, high=0.35)))
    write_baseline(tmp_path / "other.json", other)
    lines = [path.read_text().splitlines() for path in (file, tmp_path / "other.json")]
    assert len(lines[0]) == len(lines[1])
    assert sum(a != b for a, b in zip(*lines, strict=True)) == 1


def test_without_metrics(tmp_path: Path) -> None:
    write_baseline(tmp_path / "empty.json", Baseline("da", "5e", ()))
    assert read_baseline(tmp_path / "empty.json").metrics == ()


def test_an_update_replaces_a_baseline_and_nothing_else(file: Path, tmp_path: Path) -> None:
    write_baseline(file, Baseline("db", "5e", KEPT.metrics[:1]))
    assert read_baseline(file).dataset == "db"
    for name, content in (("landtool.toml", "[eval]\n"), ("metrics.json", '{"format_version": 1, "metrics": []}')):
        (tmp_path / name).write_text(content)
        with pytest.raises(UsageError, match="is no baseline, and would be replaced by one; choose another name"):
            write_baseline(tmp_path / name, KEPT)
        assert (tmp_path / name).read_text() == content


def test_what_differs_is_told() -> None:
    assert KEPT.notes(KEPT) == []
    other = Baseline("db", "5f", (), version="0.0.9")
    assert other.notes(KEPT) == [
        f"the baseline is of landtool 0.0.9, this is {KEPT.version}",
        "the baseline is of other data: a number is worse only where its interval says so, too",
        "the baseline was made with other settings",
    ]


def test_settings_are_told_apart_by_their_values_alone() -> None:
    assert settings_digest({"a": 1, "b": (2.0, None)}) == settings_digest({"b": [2.0, None], "a": 1})
    assert settings_digest({"a": 1}) != settings_digest({"a": 2})


def test_two_of_one_key_are_refused() -> None:
    with pytest.raises(ValueError, match="two metrics of one key"):
        Baseline("da", "5e", (made("pose.place_m", 1.0), made("pose.place_m", 2.0)))


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("none.json", "make one with --update-baseline"),
        ("no/folder.json", "make one with --update-baseline"),
        ("basline.json", "did you mean {}? Else make one with --update-baseline"),
    ],
)
def test_a_missing_one_can_be_made(name: str, hint: str, tmp_path: Path) -> None:
    (tmp_path / "new.json").touch()
    (tmp_path / "baseline.json").touch()
    with pytest.raises(UsageError, match="does not exist") as caught:
        read_baseline(tmp_path / name)
    assert caught.value.hint == hint.format(tmp_path / "baseline.json")


class TestBroken:
    @pytest.mark.parametrize(
        ("content", "said"),
        [
            ("", "is no baseline"),
            ("[]", "is no baseline"),
            ("{}", "is no baseline"),
            ("\x00\xff", "is no baseline"),
            ('{"format_version": 2, "anything": 1}', "was written for format 2, this is 1"),
            ('{"format_version": 1}', "dataset, settings, landtool or metrics is missing"),
            ('{"format_version": 1, "dataset": "", "settings": "", "landtool": "", "metrics": [1]}', "a metric"),
            (
                '{"format_version": 1, "dataset": "", "settings": "", "landtool": "", "metrics": [{}]}',
                "a metric without",
            ),
        ],
    )
    def test_in_one_line_with_the_way_out(self, tmp_path: Path, content: str, said: str) -> None:
        path = tmp_path / "baseline.json"
        path.write_text(content, encoding="latin-1")
        with pytest.raises(
            InputError, match=rf"baseline\.json: .*{said}.*; make it again with --update-baseline"
        ) as caught:
            read_baseline(path)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("length", [1, 40, 200, -3])
    def test_cut(self, file: Path, length: int) -> None:
        file.write_bytes(file.read_bytes()[:length])
        with pytest.raises(InputError, match="is no baseline"):
            read_baseline(file)

    @pytest.mark.parametrize(
        ("name", "value"),
        [("value", "NaN"), ("value", "-Infinity"), ("low", "1e999"), ("value", '"0.5"'), ("value", "true"),
         ("count", "1.5"), ("stage", '"poses"'), ("better", '"smaller"'), ("name", "null")],
    )  # fmt: skip
    def test_in_its_numbers(self, file: Path, name: str, value: str) -> None:
        content = json.loads(file.read_text())
        content["metrics"][0][name] = "here"
        file.write_text(json.dumps(content).replace('"here"', value))
        with pytest.raises(InputError, match="make it again with --update-baseline"):
            read_baseline(file)

    def test_twice_the_same(self, file: Path) -> None:
        content = json.loads(file.read_text())
        content["metrics"].append(content["metrics"][0])
        file.write_text(json.dumps(content))
        with pytest.raises(InputError, match="two metrics of one key"):
            read_baseline(file)

    def test_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="does not exist"):
            read_baseline(tmp_path / "baseline.json")
        with pytest.raises(UsageError, match="is a folder"):
            read_baseline(tmp_path)


def test_a_clip_that_is_gone_is_named() -> None:
    kept = Baseline("a", "", (made("time.rate_ppm:clip=one", 0.0), made("time.rate_ppm:clip=two", 0.0)))
    now = Baseline("b", "", (made("time.rate_ppm:clip=two", 0.0),))
    assert [note for note in kept.notes(now) if "one" in note] == ["one is in the baseline and was not scored"]
    assert not any("two" in note for note in kept.notes(now))


def test_stages_that_were_not_scored_are_named() -> None:
    kept = Baseline("a", "", (made("pose.place_m", 1.0), made("track.nees", 1.0), made("track.nis", 1.0)))
    now = Baseline("a", "", (made("pose.place_m", 1.0),))
    (note,) = kept.notes(now)
    assert note.startswith("the baseline has track, which")
    assert kept.notes(kept) == []
