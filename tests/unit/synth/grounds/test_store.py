from __future__ import annotations

import errno
from pathlib import Path

import numpy as np
import pytest

from landtool.synth.grounds import GroundTexture, ground_albedo, make_ground_texture
from landtool.synth.grounds.store import GroundStore


def test_a_ground_is_painted_once_and_read_as_it_was(tmp_path: Path) -> None:
    painted: list[GroundTexture] = []

    def paint() -> GroundTexture:
        painted.append(make_ground_texture("sand", np.random.default_rng(3)))
        return painted[-1]

    mine = GroundStore(tmp_path / "grounds").get("sand", paint)
    others = GroundStore(tmp_path / "grounds").get("sand", paint)
    assert len(painted) == 1
    x, y = np.meshgrid(np.linspace(-3.0, 3.0, 40, dtype=np.float32), np.linspace(-2.0, 2.0, 30, dtype=np.float32))
    footprint = np.full((1, 1), 0.004, np.float32)
    np.testing.assert_array_equal(ground_albedo(others, x, y, footprint), ground_albedo(mine, x, y, footprint))
    np.testing.assert_array_equal(others.mean, mine.mean)


def test_what_nobody_finishes_is_painted_by_who_needs_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("landtool.synth.grounds.store._PATIENCE_S", 0.05)
    store = GroundStore(tmp_path)
    assert store.claim("snow")
    assert not store.claim("snow")
    made = make_ground_texture("snow", np.random.default_rng(1))
    assert store.get("snow", lambda: made) is made


def test_where_there_is_no_room_a_ground_is_not_shared_and_nobody_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    store = GroundStore(tmp_path)
    made = make_ground_texture("snow", np.random.default_rng(1))
    assert store.get("snow", lambda: made) is made
    assert list(tmp_path.iterdir()) == []
    assert store.claim("snow")
