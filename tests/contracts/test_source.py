"""One body for every kind of source: what the pipeline may rely on, whatever the frames come from."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.io.source import Source, open_source
from landtool.types import Frame, LostFrame
from tests.conftest import HEIGHT, WIDTH, ClipMaker, picture, pictured

COUNT = 24
CFR = [512 * index for index in range(COUNT)]
VFR = [0, *(700 * index + 130 * (index % 3) for index in range(1, COUNT))]
MS = Fraction(1, 1000)


@dataclass(frozen=True)
class Case:
    """A recording of COUNT pictures: how to make it, how to open it, and the times it holds."""

    make: Callable[[Path, ClipMaker], Path]
    kind: str
    times_ns: list[int] | list[None]
    fps: Fraction | None = None
    damage: Callable[[Path], None] | None = None


def _ns(ticks: list[int], time_base: Fraction) -> list[int]:
    return [round(tick * time_base * 10**9) for tick in ticks]


def _images(path: Path, _make: ClipMaker) -> Path:
    folder = path / "images"
    folder.mkdir()
    for index in range(COUNT):
        assert cv2.imwrite(str(folder / f"img{index}.png"), picture(index))
    return folder


def _mcap(path: Path, _make: ClipMaker) -> Path:
    mcap_out = pytest.importorskip("landtool.io.mcap_out")
    log = path / "log.mcap"
    with mcap_out.McapImageWriter(
        log, schema="ros2", topic="/camera/image_raw", frame_id="camera", camera=None, encoding="raw"
    ) as writer:
        for index, t_ns in enumerate(MCAP_NS):
            writer.write(Frame(index, t_ns, picture(index)))
    return log


def _zero_packet(path: Path) -> None:
    """Zero 400 bytes of media data, a third of the way into the file."""
    data = bytearray(path.read_bytes())
    place = len(data) // 3
    data[place : place + 400] = bytes(400)
    path.write_bytes(data)


def _cut_file(path: Path) -> None:
    os.truncate(path, path.stat().st_size * 6 // 10)


def _break_image(path: Path) -> None:
    _cut_file(path / "img7.png")


MCAP_NS = [1_700_000_000_000_000_000 + 33_333_333 * index for index in range(COUNT)]
FRONT = {"movflags": "faststart"}
CASES = {
    "mp4": Case(lambda _, make: make("a.mp4", CFR, muxer=FRONT), "video", _ns(CFR, Fraction(1, 15360))),
    "mp4-vfr-b": Case(
        lambda _, make: make("a.mp4", VFR, b_frames=2, muxer=FRONT), "video", _ns(VFR, Fraction(1, 15360))
    ),
    "mkv": Case(lambda _, make: make("a.mkv", VFR, time_base=MS), "video", _ns(VFR, MS)),
    "images": Case(_images, "images", [None] * COUNT),
    "images-fps": Case(_images, "images", _ns(list(range(COUNT)), Fraction(1001, 30000)), Fraction(30000, 1001)),
    "mcap": Case(_mcap, "mcap", MCAP_NS),
}
DAMAGED = {
    "mp4 zeroed": ("mp4", _zero_packet),
    "mp4 cut": ("mp4", _cut_file),
    "mp4-vfr-b cut": ("mp4-vfr-b", _cut_file),
    "mkv cut": ("mkv", _cut_file),
    "images broken": ("images", _break_image),
    "mcap cut": ("mcap", _cut_file),
}


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


@pytest.fixture
def source(case: Case, tmp_path: Path, make_clip: ClipMaker) -> Source:
    return open_source(case.make(tmp_path, make_clip), fps=case.fps)


def _pictures(source: Source) -> list[Frame]:
    frames = list(source)
    assert all(isinstance(frame, Frame) for frame in frames)
    return [frame for frame in frames if isinstance(frame, Frame)]


def test_info_matches_the_recording(source: Source, case: Case) -> None:
    info = source.info
    assert (info.kind, info.width, info.height, info.quarter_turns) == (case.kind, WIDTH, HEIGHT, 0)
    assert info.frames_declared in (None, COUNT)
    assert info.has_clock is (case.times_ns[0] is not None)
    assert info.encoding


def test_frames_come_whole_in_order_with_their_own_times(source: Source, case: Case) -> None:
    frames = _pictures(source)
    assert [frame.index for frame in frames] == list(range(COUNT))
    assert [frame.t_ns for frame in frames] == case.times_ns
    assert [pictured(frame.image) for frame in frames] == list(range(COUNT))
    assert {frame.status for frame in frames} == {"ok"}


def test_images_are_bgr_uint8_contiguous(source: Source) -> None:
    for frame in _pictures(source):
        assert frame.image.shape == (HEIGHT, WIDTH, 3)
        assert frame.image.dtype == np.uint8
        assert frame.image.flags.c_contiguous
        blue = frame.image[20, 20].astype(int)
        assert blue[0] > 240
        assert max(blue[1:]) < 15


def test_report_of_a_good_recording_is_complete(source: Source) -> None:
    list(source)
    report = source.report
    assert (report.decoded, report.damaged, report.lost, report.skipped) == (COUNT, 0, 0, 0)
    assert report.complete
    assert report.declared in (None, COUNT)


def test_second_pass_is_identical(source: Source) -> None:
    first, second = _pictures(source), _pictures(source)
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert (one.index, one.t_ns, one.file) == (other.index, other.t_ns, other.file)
        assert np.array_equal(one.image, other.image)
    assert source.report.decoded == COUNT


def _open_files(path: Path) -> int:
    targets = (str(link.readlink()) for link in Path("/proc/self/fd").iterdir() if link.is_symlink())
    return sum(target.startswith(str(path)) for target in targets)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc to see open files")
def test_early_break_and_close_release_the_file(source: Source, tmp_path: Path) -> None:
    with source as opened:
        for frame in opened:
            assert frame.index == 0
            break
    assert _open_files(tmp_path) == 0
    source.close()
    source.close()
    assert _open_files(tmp_path) == 0
    assert len(_pictures(source)) == COUNT  # closing ends a pass, not the source


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_costs_what_it_damages_and_is_counted(name: str, tmp_path: Path, make_clip: ClipMaker) -> None:
    kind, damage = DAMAGED[name]
    case = CASES[kind]
    path = case.make(tmp_path, make_clip)
    damage(path)
    source = open_source(path, fps=case.fps)
    frames = list(source)
    report = source.report
    assert [frame.index for frame in frames] == list(range(len(frames)))
    assert report.decoded == sum(isinstance(frame, Frame) for frame in frames)
    assert report.lost == sum(isinstance(frame, LostFrame) for frame in frames)
    assert report.damaged == sum(isinstance(frame, Frame) and frame.status == "damaged" for frame in frames)
    assert not report.complete
    assert 5 <= report.decoded <= COUNT
    assert [frame.t_ns for frame in frames] == case.times_ns[: len(frames)]
    for frame in frames:
        if isinstance(frame, LostFrame):
            assert frame.reason
