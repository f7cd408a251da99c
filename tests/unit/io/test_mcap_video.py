"""Video in MCAP logs: one packet a message, every codec, and what a lost message costs."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from landtool.errors import InputError
from landtool.io.mcap import McapSource
from landtool.types import Frame, Image, LostFrame
from tests.unit.io.mcap_logs import START_NS, STEP_NS, Log, grey, namespace, ros_image

WIDTH, HEIGHT, COUNT = 96, 64, 20
ENCODERS = {
    "h264": ("libx264", {"tune": "zerolatency", "crf": "10", "x264-params": "repeat-headers=1:keyint=5:scenecut=0"}),
    "h265": (
        "libx265",
        {"tune": "zerolatency", "crf": "10", "x265-params": "repeat-headers=1:keyint=5:log-level=none"},
    ),
    "vp9": ("libvpx-vp9", {"deadline": "realtime", "lag-in-frames": "0", "crf": "10", "g": "5"}),
}
B_FRAMES = {"crf": "10", "x264-params": "repeat-headers=1:keyint=10:scenecut=0:bframes=3:b-adapt=0"}


def pictures() -> list[Image]:
    """A bright square on grey that moves two pixels a picture and tells its number."""
    stack = np.full((COUNT, HEIGHT, WIDTH, 3), 60, np.uint8)
    for n, image in enumerate(stack):
        image[20:40, 2 * n + 4 : 2 * n + 24] = 220
    return list(stack)


def number_of(image: Image) -> int:
    """Read the number off a picture of `pictures`."""
    columns = np.flatnonzero(image[30, :, 1] > 140)
    return round(float(columns[0] - 4) / 2)


def packets(encoder: str, options: dict[str, str]) -> list[tuple[int, bytes]]:
    """Encode the pictures; (number, bytes) in the order of decoding."""
    context = av.CodecContext.create(encoder, "w")
    assert isinstance(context, VideoCodecContext)
    context.width, context.height, context.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    context.time_base, context.framerate = Fraction(1, 30), Fraction(30)
    context.options = options
    sent = []
    for n, image in enumerate(pictures()):
        frame = VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
        frame.pts = n
        sent += context.encode(frame)
    sent += context.encode(None)
    return [(packet.pts or 0, bytes(packet)) for packet in sent]


def write_video(path: Path, coded: Sequence[tuple[int, bytes]], form: str) -> Path:
    with Log(path) as log:
        for n, data in coded:
            message = CompressedVideo(format=form, data=data)
            message.timestamp.seconds, message.timestamp.nanos = divmod(START_NS + n * STEP_NS, 10**9)
            log.proto("/cam/video", message, START_NS + n * STEP_NS)
    return path


@pytest.mark.parametrize("form", list(ENCODERS))
def test_every_codec_gives_every_picture_at_its_time(tmp_path: Path, form: str) -> None:
    coded = packets(*ENCODERS[form])
    assert len(coded) == COUNT
    source = McapSource(write_video(tmp_path / "a.mcap", coded, form))
    frames = list(source)
    assert source.info.encoding == form
    assert source.report.complete
    assert [frame.t_ns for frame in frames] == [START_NS + n * STEP_NS for n in range(COUNT)]
    for n, (frame, original) in enumerate(zip(frames, pictures(), strict=True)):
        assert isinstance(frame, Frame)
        assert number_of(frame.image) == n
        assert np.abs(frame.image.astype(int) - original).mean() < 3


def test_ros2_compressed_image_with_h264(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Log(path) as log:
        for n, data in packets(*ENCODERS["h264"]):
            header = ros_image(START_NS + n, grey(0), "mono8").header
            message = namespace(header=header, format="h264", data=data)
            log.ros("/cam/h264", "sensor_msgs/msg/CompressedImage", message, START_NS + n)
    assert [number_of(frame.image) for frame in McapSource(path) if isinstance(frame, Frame)] == list(range(COUNT))


def test_b_frames_come_with_their_own_messages(tmp_path: Path) -> None:
    """Foxglove forbids them, but they are found: in message order, each picture with its message's time."""
    coded = packets("libx264", B_FRAMES)
    order = [n for n, _ in coded]
    assert order != sorted(order)
    source = McapSource(write_video(tmp_path / "a.mcap", coded, "h264"))
    frames = [frame for frame in source if isinstance(frame, Frame)]
    assert [number_of(frame.image) for frame in frames] == order
    assert [frame.t_ns for frame in frames] == [START_NS + n * STEP_NS for n in order]
    assert source.report.complete


@pytest.mark.parametrize("data", [b"", b"no video data at all"])
@pytest.mark.parametrize("form", ["h264", "h265"])
def test_a_broken_packet_marks_what_builds_on_it(tmp_path: Path, form: str, data: bytes) -> None:
    coded = packets(*ENCODERS[form])
    coded[7] = (7, data)
    source = McapSource(write_video(tmp_path / "a.mcap", coded, form))
    frames = list(source)
    assert [frame.index for frame in frames] == list(range(COUNT))
    lost = [frame for frame in frames if isinstance(frame, LostFrame)]
    assert lost[0].index == 7
    assert lost[0].t_ns == START_NS + 7 * STEP_NS
    assert lost[0].reason
    # 8 and 9 build on it, 10 is the next key frame
    assert all(isinstance(frames[n], LostFrame) or frames[n].damage for n in (8, 9))  # type: ignore[union-attr]
    good = [frame for frame in frames[10:] if isinstance(frame, Frame) and not frame.damage]
    assert [number_of(frame.image) for frame in good] == list(range(10, COUNT))
    assert not source.report.complete


def test_a_start_between_key_frames_loses_what_cannot_be_decoded(tmp_path: Path) -> None:
    coded = packets(*ENCODERS["h264"])[2:]
    source = McapSource(write_video(tmp_path / "a.mcap", coded, "h264"))
    frames = list(source)
    assert all(isinstance(frame, LostFrame) or frame.damage for frame in frames[:3])
    assert [number_of(frame.image) for frame in frames[3:] if isinstance(frame, Frame)] == list(range(5, COUNT))
    assert source.info.frames_declared == COUNT - 2
    assert (source.info.width, source.info.height) == (WIDTH, HEIGHT)


def test_no_key_frame_at_all_is_an_error(tmp_path: Path) -> None:
    coded = packets(*ENCODERS["h264"])[1:5]
    with pytest.raises(InputError, match="not one of the 4 messages of /cam/video gives a picture"):
        McapSource(write_video(tmp_path / "a.mcap", coded, "h264"))


def test_a_pass_given_up_leaves_the_next_one_whole(tmp_path: Path) -> None:
    source = McapSource(write_video(tmp_path / "a.mcap", packets(*ENCODERS["h264"]), "h264"))
    for frame in source:
        if frame.index == 7:
            break
    assert [number_of(frame.image) for frame in source if isinstance(frame, Frame)] == list(range(COUNT))
