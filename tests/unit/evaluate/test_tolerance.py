"""How much worse a number may become, as a file says it."""

from __future__ import annotations

from pathlib import Path

import pytest

from landtool.errors import InputError, UsageError
from landtool.evaluate.tolerance import Allowance, Tolerance, read_tolerance


def read(folder: Path, text: str) -> Tolerance:
    (folder / "tolerance.toml").write_text(text)
    return read_tolerance(folder / "tolerance.toml")


def test_the_last_pattern_that_matches_wins(tmp_path: Path) -> None:
    tolerance = read(
        tmp_path,
        '["*"]\nrelative = 0.1\n["pose.*"]\nabsolute = 2\n'
        '["speed.*"]\nignore = true\n["speed.track_fps"]\nrelative = 0.5\n',
    )
    assert tolerance.of("track.nees") == Allowance(relative=0.1)
    assert tolerance.of("pose.place_m") == Allowance(absolute=2.0)
    assert tolerance.of("speed.detect_ms") is None
    assert tolerance.of("speed.track_fps") == Allowance(relative=0.5)


def test_the_larger_of_both_counts() -> None:
    both = Allowance(absolute=0.02, relative=0.1)
    assert both.of(0.1) == 0.02
    assert both.of(-0.5) == pytest.approx(0.05)


def test_parts_of_the_data_need_a_pattern_of_their_own(tmp_path: Path) -> None:
    tolerance = read(tmp_path, '["detection.*"]\nabsolute = 0.1\n["*.recall:fog_per_m=*"]\nabsolute = 0.2\n')
    assert tolerance.of("detection.recall") == Allowance(absolute=0.1)
    assert tolerance.of("detection.recall:fog_per_m=0-0.05") == Allowance(absolute=0.2)
    assert tolerance.of("detection.recall:size_px=0-14") is None
    # about all of the data and matched by none: may not get worse at all
    assert tolerance.of("pose.place_m") == Allowance()


def test_a_pattern_that_matches_nothing_is_told(tmp_path: Path) -> None:
    tolerance = read(tmp_path, '["detecton.*"]\nabsolute = 0.1\n["*"]\n["*:size=*"]\nignore = true\n')
    keys = ["detection.map50", "pose.place_m", "detection.recall:size_px=0-14"]
    said = tolerance.notes(keys)
    assert [line.partition("toml: ")[2] for line in said] == [
        "'detecton.*' matches no number; the nearest is detection.map50",
        "'*:size=*' matches no number; the nearest is detection.recall:size_px=0-14",
    ]
    assert tolerance.notes([]) == []


def test_what_comes_along_ignores_speed_and_never_complains() -> None:
    shipped = read_tolerance()
    assert shipped.of("speed.track_fps") is None
    assert shipped.of("detection.recall:size_px=0-14") is None
    for key in ("detection.map50", "tags.corner_px_median", "pose.nees_place", "track.lag_s", "dehaze.ssim_gain"):
        allowance = shipped.of(key)
        assert allowance is not None
        assert 0.0 < allowance.of(1.0) <= 0.1
    assert shipped.notes(["detection.map50"]) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('["*"]\nabsolut = 1\n', r"unknown key '\*: absolut'; nearest known key is '\*: absolute'"),
        ('["*"]\nabsolute = -1\n', r"'\*: absolute' is -1; give a number, 0 or more"),
        ('["*"]\nrelative = nan\n', "relative' is nan"),
        ('["*"]\nrelative = inf\n', "relative' is inf"),
        ('["*"]\nrelative = "10%"\n', "relative' is '10%'"),
        ('["*"]\nabsolute = true\n', "absolute' is True"),
        ('["*"]\nignore = 1\n', "ignore' must be true or false"),
        ('["*"]\nignore = true\nabsolute = 1\n', "is ignored and has a tolerance"),
        ("absolute = 1\n", r"'absolute' must be a table; a table begins with a pattern in quotes"),
        ("[detection.map50]\nabsolute = 1\n", r"\[detection\.map50\] is no pattern; .* in quotes"),
        ('["*"\n', "no valid TOML"),
        ('["*"]\n["*"]\n', "no valid TOML"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path}/tolerance.toml: ")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        read_tolerance(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="no valid TOML"):
        read_tolerance(tmp_path / "bytes.toml")


def test_an_empty_file_allows_nothing(tmp_path: Path) -> None:
    assert read(tmp_path, "").of("pose.place_m") == Allowance()
