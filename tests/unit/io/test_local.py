"""Tests of the hint for a path that is not there."""

from __future__ import annotations

from pathlib import Path

import pytest

from landtool.errors import UsageError
from landtool.io.local import local_path, nearest


@pytest.mark.parametrize(
    ("missing", "there", "meant"),
    [
        ("clap.mp4", "clip.mp4", True),
        ("clip.MP4", "clip.mp4", True),
        ("camera.yml", "camera.yaml", True),
        ("landing", "landing.mp4", True),
        ("photo", "photos/", True),
        ("landing_1.mp4", "landing_01.mp4", True),
        ("nope.mp4", "one/", False),
        ("nope.onnx", "mine.onnx", False),
        ("none.json", "new.json", False),
        ("clap.csv", "clip.mp4", False),
        ("clip.csv", "clip.mp4", False),
        ("landin", "landing.mp4", False),
    ],
)
def test_only_a_near_name_of_the_same_kind_is_proposed(missing: str, there: str, meant: bool, tmp_path: Path) -> None:
    if there.endswith("/"):
        (tmp_path / there).mkdir()
    else:
        (tmp_path / there).touch()
    expected = f"did you mean {tmp_path / there}?" if meant else f"check the names in {tmp_path}"
    assert nearest(tmp_path / missing) == expected
    with pytest.raises(UsageError, match="does not exist") as caught:
        local_path(tmp_path / missing)
    assert caught.value.hint == expected
