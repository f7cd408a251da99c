from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from landtool.errors import OutputError, UsageError
from landtool.io.video import VideoSource
from landtool.io.video_clock import ticks_to_ns
from landtool.io.video_out import VideoWriter
from landtool.types import Frame
from tests.conftest import HEIGHT, WIDTH, picture, pictured
from tests.limits import files_of_at_most
from tests.shared import ROOT, shared_data

FIXTURES = ROOT / "datasets" / "fixtures"

VARIABLE = [0, 1, 3, 4, 9, 10, 30, 31, 33, 60]  # multiples of a step


def _write(
    path: Path, times_ns: list[int] | list[None], time_base: Fraction | None, *, fps: Fraction | None = None
) -> VideoWriter:
    with VideoWriter(path, WIDTH, HEIGHT, time_base, fps=fps) as writer:
        for index, t_ns in enumerate(times_ns):
            writer.write(picture(index), t_ns)
    return writer


def _read(path: Path) -> list[Frame]:
    source = VideoSource(path)
    frames = [frame for frame in source if isinstance(frame, Frame)]
    assert source.report.complete
    return frames


def _boxes(path: Path) -> list[bytes]:
    data, place, kinds = path.read_bytes(), 0, []
    while place < len(data):
        kinds.append(data[place + 4 : place + 8])
        place += int.from_bytes(data[place : place + 4], "big")
    return kinds


@pytest.mark.parametrize("offset", [0, 7, 127_995])
@pytest.mark.parametrize(
    "time_base",
    [Fraction(1, 15360), Fraction(1, 30000), Fraction(1, 1000), Fraction(1, 90000), Fraction(1, 30),
     Fraction(1001, 30000), Fraction(1, 1_000_000)],
)  # fmt: skip
def test_times_read_back_exactly(time_base: Fraction, offset: int, tmp_path: Path) -> None:
    step = max(1, round(Fraction(1, 30) / time_base))
    times_ns = [ticks_to_ns(offset + step * count, time_base) for count in VARIABLE]
    writer = _write(tmp_path / "o.mp4", times_ns, time_base)
    frames = _read(tmp_path / "o.mp4")
    assert [frame.t_ns for frame in frames] == times_ns
    assert [pictured(frame.image) for frame in frames] == list(range(len(times_ns)))
    assert writer.notes == []
    assert writer.written == len(times_ns)


def test_real_variable_rate_is_kept(tmp_path: Path) -> None:
    source = VideoSource(shared_data("video/mapillary/sample-5s_h265.mp4"))
    with av.open(str(source.path)) as container:
        packets = [packet.pts for packet in container.demux(video=0) if packet.pts is not None]
    assert source.info.time_base is not None
    times_ns = [ticks_to_ns(pts, source.info.time_base) for pts in sorted(packets)]
    _write(tmp_path / "o.mp4", times_ns, source.info.time_base)
    assert [frame.t_ns for frame in _read(tmp_path / "o.mp4")] == times_ns


def test_epoch_stamps_count_from_the_first_within_a_microsecond(tmp_path: Path) -> None:
    first = 1_700_000_000_123_456_789
    times_ns = [first + 33_333_333 * count for count in VARIABLE]
    writer = _write(tmp_path / "o.mp4", times_ns, None)
    back = [frame.t_ns for frame in _read(tmp_path / "o.mp4")]
    assert back[0] == 0
    assert max(abs((b or 0) - (t - first)) for b, t in zip(back, times_ns, strict=True)) <= 500
    assert any("is 1700000000.123" in note for note in writer.notes)
    assert any("microseconds" in note for note in writer.notes)


def test_a_negative_start_moves_to_zero_and_differences_stay(tmp_path: Path) -> None:
    base = Fraction(1, 15360)
    times_ns = [ticks_to_ns(512 * (count - 5), base) for count in range(10)]
    writer = _write(tmp_path / "o.mp4", times_ns, base)
    assert [frame.t_ns for frame in _read(tmp_path / "o.mp4")] == [
        ticks_to_ns(512 * count, base) for count in range(10)
    ]
    assert any("on the source's clock" in note for note in writer.notes)
    assert "-0.166666667 s" in writer.notes[0]


def test_a_clock_set_on_the_way_closes_the_gap(tmp_path: Path) -> None:
    """A recorder that starts at 1970 and then learns the time of day."""
    late_ns = 1_700_000_000 * 10**9
    times_ns = [0, 33_000_000, 66_000_000, late_ns, late_ns + 40_000_000]
    writer = _write(tmp_path / "o.mp4", times_ns, None)
    assert [frame.t_ns for frame in _read(tmp_path / "o.mp4")] == [0, 33_000_000, 66_000_000, 99_000_000, 139_000_000]
    assert "1.7e+09 s without a picture do not fit an MP4 and were left out of it" in writer.notes


def test_repeated_and_backward_times_move_to_the_next_tick(tmp_path: Path) -> None:
    times_ns = [0, 33_000_000, 33_000_000, 20_000_000, 100_000_000]
    writer = _write(tmp_path / "o.mp4", times_ns, Fraction(1, 1000))
    assert [frame.t_ns for frame in _read(tmp_path / "o.mp4")] == [0, 33_000_000, 34_000_000, 35_000_000, 100_000_000]
    assert writer.bumped == 2
    assert any(note.startswith("pictures not later") and note.endswith(": 2") for note in writer.notes)


def test_a_folder_without_clock_needs_a_rate(tmp_path: Path) -> None:
    _write(tmp_path / "o.mp4", [None] * 4, None, fps=Fraction(30000, 1001))
    assert [frame.t_ns for frame in _read(tmp_path / "o.mp4")] == [0, 33_366_667, 66_733_333, 100_100_000]
    with pytest.raises(UsageError, match="say how many a second with --fps"):
        _write(tmp_path / "p.mp4", [None], None)
    with pytest.raises(UsageError, match="give --fps above 0"):
        VideoWriter(tmp_path / "q.mp4", WIDTH, HEIGHT, fps=Fraction(0))


def test_the_last_picture_stays_as_long_as_the_one_before(tmp_path: Path) -> None:
    _write(tmp_path / "o.mp4", [0, 10_000_000, 50_000_000], Fraction(1, 1000))
    assert VideoSource(tmp_path / "o.mp4").info.duration_ns == 90_000_000


def test_one_picture_is_a_video(tmp_path: Path) -> None:
    _write(tmp_path / "o.mp4", [0], Fraction(1, 15360))
    assert len(_read(tmp_path / "o.mp4")) == 1


def test_it_is_what_every_player_takes(tmp_path: Path) -> None:
    _write(tmp_path / "o.mp4", [40_000_000 * index for index in range(60)], Fraction(1, 1000))
    with av.open(str(tmp_path / "o.mp4")) as container:
        codec = container.streams.video[0].codec_context
        assert (codec.name, codec.pix_fmt) == ("h264", "yuv420p")
        assert (codec.colorspace, codec.color_range, codec.color_primaries, codec.color_trc) == (1, 1, 1, 1)
        assert codec.level <= 51  # the rate is not mistaken for the clock's ticks
        assert not codec.has_b_frames
        assert sum(packet.is_keyframe for packet in container.demux(video=0)) >= 2  # one every two seconds
    kinds = _boxes(tmp_path / "o.mp4")
    assert kinds[0] == b"ftyp"
    assert kinds.count(b"moov") == 1
    assert b"moof" not in kinds


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("size", [(97, 64), (96, 63), (97, 63)])
def test_odd_sides_are_padded_by_the_edge(size: tuple[int, int], quick: bool, tmp_path: Path) -> None:
    width, height = size
    ramp = np.repeat(np.tile(np.linspace(0, 255, width).astype(np.uint8), (height, 1))[:, :, None], 3, axis=2)
    with VideoWriter(tmp_path / "o.mp4", width, height, fps=Fraction(25), quick=quick) as writer:
        writer.write(ramp, None)
    image = _read(tmp_path / "o.mp4")[0].image
    assert image.shape == (height + height % 2, width + width % 2, 3)
    assert np.abs(image[:height, :width].astype(int) - ramp).max() < 12
    assert np.abs(image[:, -1].astype(int) - image[:, -2]).max() < 8
    assert any("padded" in note for note in writer.notes)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("bgr", [(255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128), (28, 25, 215), (0, 0, 0)])
def test_colours_come_back(bgr: tuple[int, int, int], quick: bool, tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "o.mp4", WIDTH, HEIGHT, fps=Fraction(25), quick=quick) as writer:
        writer.write(np.full((HEIGHT, WIDTH, 3), bgr, np.uint8), None)
    assert np.abs(_read(tmp_path / "o.mp4")[0].image.astype(int) - bgr).max() <= 3


def test_quick_pictures_are_as_good_and_little_larger(tmp_path: Path) -> None:
    frames = [frame.image for frame in VideoSource(FIXTURES / "approach.mp4") if isinstance(frame, Frame)][:40]
    height, width = frames[0].shape[:2]
    psnr, size = {}, {}
    for quick in (False, True):
        path = tmp_path / f"{quick}.mp4"
        with VideoWriter(path, width, height, fps=Fraction(30), quick=quick) as writer:
            for image in frames:
                writer.write(image, None)
        back = [frame.image for frame in VideoSource(path) if isinstance(frame, Frame)]
        psnr[quick] = np.mean([cv2.PSNR(image, seen) for image, seen in zip(frames, back, strict=True)])
        size[quick] = path.stat().st_size
    assert psnr[True] > psnr[False] - 0.3
    assert size[True] < 1.3 * size[False]


def test_pictures_of_another_size_are_scaled_and_counted(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "o.mp4", WIDTH, HEIGHT, fps=Fraction(25)) as writer:
        writer.write(picture(0), None)
        writer.write(picture(1, 2 * WIDTH, 2 * HEIGHT), None)
    assert {frame.image.shape for frame in _read(tmp_path / "o.mp4")} == {(HEIGHT, WIDTH, 3)}
    assert writer.resized == 1
    assert any("scaled to 96x64" in note for note in writer.notes)


def test_the_same_pictures_give_the_same_bytes(tmp_path: Path) -> None:
    seen = set()
    for _ in range(40):  # small pictures once differed in one of thirty runs
        _write(tmp_path / "o.mp4", [40_000_000 * index for index in range(20)], Fraction(1, 1000))
        seen.add((tmp_path / "o.mp4").read_bytes())
    assert len(seen) == 1


KILLED = """
import os, sys
from fractions import Fraction
from pathlib import Path
from landtool.io.video_out import VideoWriter
from tests.conftest import HEIGHT, WIDTH, picture
writer = VideoWriter(Path(sys.argv[1]), WIDTH, HEIGHT, Fraction(1, 1000))
for index in range(200):
    writer.write(picture(index), (700 + 40 * index) * 1_000_000)
os.kill(os.getpid(), 9)
"""


def test_a_killed_recording_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "o.mp4"
    subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=ROOT, check=False)
    times_ns = [frame.t_ns for frame in VideoSource(path)]
    assert times_ns == [(700 + 40 * index) * 1_000_000 for index in range(len(times_ns))]
    assert len(times_ns) >= 100  # of 200: all but the last key frame's distance and what the encoder looks ahead


def _write_noise(path: Path) -> None:
    rng = np.random.default_rng(0)
    with VideoWriter(path, WIDTH, HEIGHT, fps=Fraction(25)) as writer:
        for _ in range(200):
            writer.write(rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8), None)


def test_a_full_disk_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"o\.mp4: cannot be written \(.*\); "), files_of_at_most(30_000):
        _write_noise(tmp_path / "o.mp4")


def test_a_place_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        VideoWriter(tmp_path / "none" / "o.mp4", WIDTH, HEIGHT, fps=Fraction(25))


def test_no_picture_is_an_error(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="no picture was written"),
        VideoWriter(tmp_path / "o.mp4", WIDTH, HEIGHT, fps=Fraction(25)),
    ):
        pass


def _fail_while_writing(writer: VideoWriter) -> None:
    with writer:
        writer.write(picture(0), None)
        raise KeyError


def test_an_error_of_the_caller_is_not_hidden(tmp_path: Path) -> None:
    writer = VideoWriter(tmp_path / "o.mp4", WIDTH, HEIGHT, fps=Fraction(25))
    with pytest.raises(KeyError):
        _fail_while_writing(writer)
    writer.close()  # closing again is harmless
    with pytest.raises(OutputError, match="is closed already"):
        writer.write(picture(0), None)


def test_a_mov_holds_the_same_times(tmp_path: Path) -> None:
    times_ns = [0, 40_000_000, 55_000_000, 1_000_000_000]
    with VideoWriter(tmp_path / "a.MOV", 32, 16, Fraction(1, 1000)) as writer:
        for t_ns in times_ns:
            writer.write(np.zeros((16, 32, 3), np.uint8), t_ns)
    assert (tmp_path / "a.MOV").read_bytes()[4:12] == b"ftypqt  "
    assert [frame.t_ns for frame in VideoSource(tmp_path / "a.MOV")] == times_ns
