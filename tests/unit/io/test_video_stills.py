"""Pictures of a video at given times, and its times without decoding it."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError
from landtool.io.video_out import VideoWriter
from landtool.io.video_stills import read_stills, read_times

FPS, FRAMES = 20, 90  # with key frames two seconds apart


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip that begins after half a second; every picture's grey level tells its number modulo 13."""
    path = tmp_path_factory.mktemp("clip") / "clip.mp4"
    with VideoWriter(path, 64, 48, Fraction(1, FPS)) as video:
        for i in range(FRAMES):
            video.write(np.full((48, 64, 3), 20 + 16 * (i % 13), np.uint8), time_ns(i))
    return path


def time_ns(i: int) -> int:
    return (i + FPS // 2) * 1_000_000_000 // FPS


def number(jpeg: bytes | None) -> int:
    """Return a picture's number modulo 13."""
    assert jpeg is not None
    return round((float(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR).mean()) - 20) / 16)


def test_times_are_those_that_were_written(clip: Path) -> None:
    times = read_times(clip)
    assert times.t_ns == tuple(time_ns(i) for i in range(FRAMES))
    assert times.end_ns == time_ns(FRAMES)
    assert (times.width, times.height) == (64, 48)


def test_stills_are_the_pictures_of_their_times_in_the_order_asked_for(clip: Path) -> None:
    wanted = [70, 3, 39, 40, 41, 89, 0, 3]
    found = read_stills(clip, [time_ns(i) for i in wanted], 32)
    assert [number(jpeg) for jpeg in found] == [i % 13 for i in wanted]
    assert cv2.imdecode(np.frombuffer(found[0] or b"", np.uint8), cv2.IMREAD_COLOR).shape == (24, 32, 3)


def test_a_time_between_two_pictures_shows_the_earlier_one(clip: Path) -> None:
    (found,) = read_stills(clip, [time_ns(10) + 20_000_000], 64)
    assert number(found) == 10


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "text.mp4"
    path.write_text("no video")
    with pytest.raises(InputError, match="is no video that can be read"):
        read_times(path)
    with pytest.raises(InputError, match="is no video that can be read"):
        read_stills(path, [0], 32)


def test_pictures_that_are_damaged_are_left_out(clip: Path, tmp_path: Path) -> None:
    data = bytearray(clip.read_bytes())
    start = data.index(b"mdat") + 4
    data[start : start + 2000] = bytes(2000)
    path = tmp_path / "damaged.mp4"
    path.write_bytes(data)
    first, last = read_stills(path, [time_ns(0), time_ns(FRAMES - 1)], 32)
    assert first is None
    assert last is None or number(last) == (FRAMES - 1) % 13
