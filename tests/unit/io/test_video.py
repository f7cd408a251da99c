from __future__ import annotations

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.io.source import open_source
from landtool.io.video import VideoSource
from landtool.io.video_clock import ticks_to_ns
from landtool.types import Frame, LostFrame
from tests.conftest import HEIGHT, WIDTH, ClipMaker, picture, pictured
from tests.shared import ROOT, shared_data

CFR = [512 * index for index in range(30)]
MS = Fraction(1, 1000)
FRONT = {"movflags": "faststart"}
RECORDINGS = ("mp4", "avi", "mkv", "webm")


def _frames(path: Path) -> list[Frame]:
    frames = list(VideoSource(path))
    assert all(isinstance(frame, Frame) for frame in frames)
    return [frame for frame in frames if isinstance(frame, Frame)]


def _real(folder: str) -> list[Path]:
    base = ROOT.parent / "shared" / "data" / folder
    return sorted(path for path in base.rglob("*") if path.suffix[1:] in RECORDINGS)


def _packet_places(path: Path) -> list[tuple[int, int]]:
    with av.open(str(path)) as container:
        return [(packet.pos or 0, packet.size) for packet in container.demux(video=0) if packet.size]


# --- times ---------------------------------------------------------------------------------------------------------


def test_ticks_are_exact_where_floats_are_not() -> None:
    # 2**53 + 1 ticks of 1/3 s need more bits than a float has
    assert ticks_to_ns(2**53 + 1, Fraction(1, 3)) == ((2**53 + 1) * 10**9 + 1) // 3
    assert ticks_to_ns(-1, Fraction(1001, 30000)) == -33366667


@pytest.mark.parametrize("folder", ["video", "tags/wpilib"])
def test_real_recordings_have_the_count_and_times_pyav_gives(folder: str) -> None:
    shared_data(folder)
    paths = _real(folder)
    assert paths
    for path in paths:
        if path.stat().st_size > 1_500_000:  # the large ones are in the full run
            continue
        _assert_equal_to_pyav(path)


@pytest.mark.full
@pytest.mark.parametrize("folder", ["video", "tags/wpilib"])
def test_large_real_recordings_have_the_count_and_times_pyav_gives(folder: str) -> None:
    shared_data(folder)
    for path in _real(folder):
        _assert_equal_to_pyav(path)


def _assert_equal_to_pyav(path: Path) -> None:
    with av.open(str(path)) as container:
        time_base = container.streams.video[0].time_base
        assert time_base is not None
        expected = [round((frame.pts or 0) * time_base * 10**9) for frame in container.decode(video=0)]
    source = VideoSource(path)
    assert [frame.t_ns for frame in source] == expected, path.name
    assert source.report.complete, path.name
    assert source.report.decoded == len(expected)


def test_b_frames_come_in_presentation_order(make_clip: ClipMaker) -> None:
    frames = _frames(make_clip("b.mp4", CFR, b_frames=3))
    assert [pictured(frame.image) for frame in frames] == list(range(30))
    assert [frame.t_ns for frame in frames] == [ticks_to_ns(tick, Fraction(1, 15360)) for tick in CFR]


def test_later_start_is_kept(make_clip: ClipMaker) -> None:
    frames = _frames(make_clip("late.mkv", [5000 + 40 * index for index in range(5)], time_base=MS))
    assert frames[0].t_ns == 5_000_000_000


def test_transport_stream_start_is_kept(make_clip: ClipMaker) -> None:
    path = make_clip("a.ts", [3000 * index for index in range(10)], time_base=Fraction(1, 90000))
    with av.open(str(path)) as container:
        expected = [frame.pts for frame in container.decode(video=0)]
    assert [frame.t_ns for frame in _frames(path)] == [ticks_to_ns(pts or 0, Fraction(1, 90000)) for pts in expected]


def test_pictures_an_edit_list_hides_are_skipped_not_lost(make_clip: ClipMaker) -> None:
    source = VideoSource(make_clip("negative.mp4", [512 * (index - 5) for index in range(30)]))
    frames = [frame for frame in source if isinstance(frame, Frame)]
    assert [pictured(frame.image) for frame in frames] == list(range(5, 30))
    assert (source.report.skipped, source.report.lost) == (5, 0)
    assert source.report.complete


def test_times_that_repeat_or_step_back_are_kept_and_noted(make_clip: ClipMaker) -> None:
    stored = [0, 33, 33, 20, 100]
    path = make_clip("r.mkv", [0, 1, 2, 3, 4], time_base=MS, codec="mjpeg", stored_pts=stored)
    source = VideoSource(path)
    assert [frame.t_ns for frame in source] == [tick * 1_000_000 for tick in stored]
    assert any(
        note.startswith("pictures with a time not after") and note.endswith(": 2") for note in source.report.notes
    )


def test_absent_presentation_times_are_derived_in_order_and_noted(make_clip: ClipMaker) -> None:
    # AVI stores none: PyAV's own pts of this file run 1 3 4 2 5
    source = VideoSource(make_clip("b.avi", range(30), time_base=Fraction(1, 30), b_frames=2))
    frames = [frame for frame in source if isinstance(frame, Frame)]
    assert [pictured(frame.image) for frame in frames] == list(range(30))
    times = [frame.t_ns for frame in frames]
    assert times == [ticks_to_ns(index + 1, Fraction(1, 30)) for index in range(30)]
    assert any("no presentation times" in note for note in source.report.notes)


def test_hidden_reference_pictures_are_not_lost(make_clip: ClipMaker) -> None:
    options = {"auto-alt-ref": "1", "lag-in-frames": "16", "b": "200k", "deadline": "realtime", "cpu-used": "8"}
    path = make_clip("h.webm", [33 * index for index in range(40)], time_base=MS, codec="libvpx", options=options)
    source = VideoSource(path)
    assert len(list(source)) == 40
    assert source.report.complete


# --- pictures ------------------------------------------------------------------------------------------------------


def test_rotation_is_applied_and_said() -> None:
    path = shared_data("video/torchcodec/nasa_13013_rotated.mp4")
    source = VideoSource(path)
    frame = next(iter(source))
    with av.open(str(path)) as container:
        stored = next(container.decode(video=0)).to_ndarray(format="bgr24")
    assert isinstance(frame, Frame)
    assert source.info.rotation_deg == 270
    assert source.info.quarter_turns == 3
    assert (source.info.width, source.info.height) == (270, 480)
    assert np.array_equal(frame.image, np.rot90(stored, 1))  # numpy turns counter-clockwise, as the metadata does


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_every_quarter_turn_is_turned_the_right_way(degrees: int, tmp_path: Path) -> None:
    path = tmp_path / "turned.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.set_display_rotation(degrees)
        for _ in range(3):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture(0), format="bgr24")))
        container.mux(stream.encode(None))
    with av.open(str(path)) as container:
        counter_clockwise = next(container.decode(video=0)).rotation
    source = VideoSource(path)
    frame = next(iter(source))
    assert isinstance(frame, Frame)
    upright = np.rot90(picture(0), counter_clockwise // 90)
    assert frame.image.shape == upright.shape == (source.info.height, source.info.width, 3)
    assert np.abs(frame.image.astype(int) - upright).mean() < 12
    assert (source.info.rotation_deg + counter_clockwise) % 360 == 0


MATRICES = {1: (0.2126, 0.0722), 5: (0.299, 0.114), 9: (0.2627, 0.0593)}  # H.273 code: Kr, Kb


@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("size", [(96, 64), (97, 63)])
def test_colours_follow_matrix_and_range(matrix: int, full: bool, size: tuple[int, int], tmp_path: Path) -> None:
    y, u, v = 120, 100, 170
    path = tmp_path / "colour.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=30)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv444p"
        stream.codec_context.colorspace, stream.codec_context.color_range = matrix, 2 if full else 1
        frame = av.VideoFrame(*size, "yuv444p")
        for plane, value in zip(frame.planes, (y, u, v), strict=True):
            plane.update(bytes([value]) * plane.buffer_size)
        frame.colorspace, frame.color_range = matrix, 2 if full else 1
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    # ITU-T H.273, 8.3: E'Y = Kr E'R + (1 - Kr - Kb) E'G + Kb E'B, E'PB = (E'B - E'Y) / 2 / (1 - Kb)
    kr, kb = MATRICES[matrix]
    luma = y / 255 if full else (y - 16) / 219
    pb, pr = (np.array([u, v]) - 128) / (255 if full else 224)
    blue, red = luma + 2 * (1 - kb) * pb, luma + 2 * (1 - kr) * pr
    green = (luma - kr * red - kb * blue) / (1 - kr - kb)
    expected = np.clip(np.array([blue, green, red]) * 255, 0, 255)
    image = _frames(path)[0].image
    assert image.shape == (size[1], size[0], 3)
    assert np.abs(image.reshape(-1, 3) - expected).max() <= 2


def test_deep_pictures_become_eight_bits() -> None:
    frames = _frames(shared_data("video/torchcodec/testsrc2_444_10bit_hevc.mp4"))
    eight = _frames(shared_data("video/torchcodec/testsrc2_444_8bit_hevc.mp4"))
    assert frames[0].image.shape == (241, 321, 3)
    assert np.abs(frames[0].image.astype(int) - eight[0].image).mean() < 3


def test_change_of_size_on_the_way_is_given_and_noted(tmp_path: Path, make_clip: ClipMaker) -> None:
    small, large = (
        make_clip(name, [3000 * (start + index) for index in range(10)], time_base=Fraction(1, 90000), size=size)
        for name, start, size in (("a.ts", 0, (96, 64)), ("b.ts", 10, (128, 96)))
    )
    joined = tmp_path / "joined.ts"
    joined.write_bytes(small.read_bytes() + large.read_bytes())
    source = VideoSource(joined)
    shapes = [frame.image.shape for frame in source if isinstance(frame, Frame)]
    assert shapes == [(64, 96, 3)] * 10 + [(96, 128, 3)] * 10
    assert any("size changes to 128x96" in note for note in source.report.notes)


# --- damage --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("codec", "b_frames"), [("libx264", 0), ("libx264", 2), ("libx265", 2), ("mpeg4", 0)])
def test_a_zeroed_packet_is_one_lost_frame_at_its_own_time(codec: str, b_frames: int, make_clip: ClipMaker) -> None:
    options = {"libx264": {"sc_threshold": "0"}, "libx265": {"x265-params": "log-level=none"}}.get(codec, {})
    path = make_clip("z.mp4", CFR, codec=codec, b_frames=b_frames, options=options, muxer=FRONT)
    whole = [frame.t_ns for frame in _frames(path)]
    data = bytearray(path.read_bytes())
    position, size = _packet_places(path)[16]
    data[position : position + size] = bytes(size)
    path.write_bytes(data)
    source = VideoSource(path)
    frames = list(source)
    assert [frame.t_ns for frame in frames] == whole
    lost = [frame for frame in frames if isinstance(frame, LostFrame)]
    assert len(lost) == source.report.lost == 1
    assert lost[0].reason.startswith("its data cannot be decoded")
    assert source.report.decoded == 29
    assert not source.report.complete


@pytest.mark.parametrize("codec", ["libx264", "libx265", "mpeg4"])
def test_ten_percent_zeroed_is_survived_and_counted(codec: str, make_clip: ClipMaker) -> None:
    options = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    path = make_clip("z.mp4", [512 * index for index in range(60)], codec=codec, options=options, muxer=FRONT)
    data = bytearray(path.read_bytes())
    first, length = _packet_places(path)[3][0], len(data) // 200
    rng = np.random.default_rng(4)
    for start in rng.integers(first, len(data) - length, 20):
        data[start : start + length] = bytes(length)
    path.write_bytes(data)
    source = VideoSource(path)
    frames = list(source)
    assert [frame.index for frame in frames] == list(range(60))
    assert source.report.decoded + source.report.lost == 60
    assert source.report.damaged + source.report.lost >= 5
    assert source.report.decoded >= 30


def test_zeros_inside_a_codec_without_checks_are_seen(make_clip: ClipMaker) -> None:
    path = make_clip("z.avi", range(10), time_base=Fraction(1, 30), codec="mjpeg")
    data = bytearray(path.read_bytes())
    position, size = _packet_places(path)[4]
    data[position + size // 2 : position + size // 2 + 200] = bytes(200)
    path.write_bytes(data)
    source = VideoSource(path)
    assert [frame.index for frame in source if isinstance(frame, LostFrame) or frame.damage] == [4]
    assert not source.report.complete


@pytest.mark.parametrize(
    ("name", "muxer", "time_base"),
    [
        ("cut.mp4", FRONT, Fraction(1, 15360)),
        ("cut.mp4", {"movflags": "frag_keyframe+empty_moov"}, Fraction(1, 15360)),
        ("cut.mkv", {}, MS),
        ("cut.ts", {}, Fraction(1, 90000)),
        ("cut.avi", {}, Fraction(1, 30)),
    ],
)
def test_cut_file_gives_what_is_there_and_says_so(
    name: str, muxer: dict[str, str], time_base: Fraction, make_clip: ClipMaker
) -> None:
    step = round(Fraction(1, 30) / time_base)
    path = make_clip(name, [step * index for index in range(60)], time_base=time_base, muxer=muxer)
    whole = [frame.t_ns for frame in _frames(path)]
    os.truncate(path, path.stat().st_size * 6 // 10 // 188 * 188 + 100)  # in the middle of a transport packet too
    source = VideoSource(path)
    frames = list(source)
    assert 25 <= source.report.decoded <= 45
    assert [frame.t_ns for frame in frames] == whole[: len(frames)]
    assert source.report.truncated
    assert not source.report.complete
    assert any("ends" in note for note in source.report.notes)


def test_whole_files_are_not_called_cut(make_clip: ClipMaker) -> None:
    for name, time_base in (("a.mkv", MS), ("a.ts", Fraction(1, 90000)), ("a.avi", Fraction(1, 30)), ("a.mov", MS)):
        step = round(Fraction(1, 30) / time_base)
        source = VideoSource(make_clip(name, [step * index for index in range(20)], time_base=time_base))
        list(source)
        assert source.report.complete, name


# --- what is refused -----------------------------------------------------------------------------------------------


def test_text_named_mp4_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "notes.mp4"
    path.write_text("flight notes\n" * 200)
    with pytest.raises(InputError, match=r"notes\.mp4: is no video that can be read .*; give a video"):
        open_source(path)


def test_empty_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.touch()
    with pytest.raises(InputError, match=r"a\.mp4: is empty; "):
        open_source(path)


def test_file_of_zeros_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(bytes(100_000))
    with pytest.raises(InputError, match="nothing but zero bytes"):
        open_source(path)


def test_missing_index_is_named(make_clip: ClipMaker) -> None:
    path = make_clip("a.mp4", CFR)  # its moov is at the end
    os.truncate(path, path.stat().st_size // 2)
    with pytest.raises(InputError, match=r"no index \(moov box\).*; repair it"):
        open_source(path)


def test_zero_frames_is_refused(make_clip: ClipMaker) -> None:
    path = make_clip("a.mkv", CFR)
    data = path.read_bytes()
    path.write_bytes(data[: data.find(b"\x1f\x43\xb6\x75")])  # up to the first cluster
    with pytest.raises(InputError, match="holds no picture"):
        open_source(path)


def test_sound_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=48000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        sound.sample_rate = 48000
        container.mux(stream.encode(sound))
        container.mux(stream.encode(None))
    with pytest.raises(InputError, match="has no video stream"):
        open_source(path)


def test_bare_stream_without_times_is_refused(make_clip: ClipMaker) -> None:
    with pytest.raises(InputError, match="bare stream without times"):
        open_source(make_clip("a.h264", CFR))


@pytest.mark.parametrize("url", ["rtsp://cam/1", "https://example.org/a.mp4", "http:/example.org/a.mp4", "udp://:5000"])
def test_urls_are_refused(url: str) -> None:
    with pytest.raises(UsageError, match="is no local file"):
        open_source(Path(url) if "//" not in url else url)


PLAYLISTS = {
    "a.m3u8": "#EXTM3U\n#EXT-X-VERSION:3\n#EXTINF:1,\na.ts\n",
    "hidden.mp4": "#EXTM3U\n#EXTINF:1,\na.ts\n",
    "list.mp4": "ffconcat version 1.0\nfile a.ts\n",
    "dash.mp4": '<?xml version="1.0"?>\n<MPD xmlns="urn:mpeg:dash:schema:mpd:2011"/>',
}


@pytest.mark.parametrize("name", PLAYLISTS)
def test_playlists_are_refused_whatever_their_name(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(PLAYLISTS[name])
    with pytest.raises(UsageError, match="is a playlist"):
        open_source(path)


def test_pipes_and_devices_are_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.mp4"
    os.mkfifo(pipe)
    for path in (pipe, Path(os.devnull)):
        with pytest.raises(UsageError, match="is no plain file or folder"):
            open_source(path)


def test_missing_file_names_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "landing_01.mp4").write_bytes(b"x")
    with pytest.raises(UsageError, match=r"does not exist; did you mean .*landing_01\.mp4\?"):
        open_source(tmp_path / "landing_1.mp4")
    with pytest.raises(UsageError, match="there is no folder"):
        open_source(tmp_path / "none" / "a.mp4")


def test_options_of_other_kinds_are_refused(make_clip: ClipMaker) -> None:
    path = make_clip("a.mp4", CFR)
    with pytest.raises(UsageError, match="has its own clock; leave out --fps"):
        open_source(path, fps=30)
    with pytest.raises(UsageError, match="has no topics"):
        open_source(path, topic="/camera")


def test_a_name_with_a_colon_is_a_local_file(make_clip: ClipMaker) -> None:
    assert open_source(make_clip("12:30 flight.mp4", CFR)).info.frames_declared == 30


def test_ffmpeg_stays_silent_on_stderr(make_clip: ClipMaker) -> None:
    path = make_clip("a.mp4", CFR, muxer=FRONT)
    data = bytearray(path.read_bytes())
    data[len(data) // 2 :: 7] = bytes(len(data[len(data) // 2 :: 7]))
    path.write_bytes(data)
    code = "import sys; from landtool.io.video import VideoSource; print(len(list(VideoSource(sys.argv[1]))))"
    run = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.strip() == "30"
    assert run.stderr == ""
