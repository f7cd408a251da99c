"""The recordings beside the project: written by other people's writers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError
from landtool.geometry import Array
from landtool.io.mcap import McapSource, describe_mcap
from landtool.io.video import VideoSource
from landtool.types import Frame
from tests.shared import shared_data

MONO8 = "mcap/fieldvideo_ros2_image_mono8_step1024_camerainfo.mcap"
H264 = "mcap/fieldvideo_foxglove_h264_nobframes.mcap"
JPEG = "mcap/swat_mapping_foxglove_compressedimage_calib.mcap"


@pytest.mark.parametrize(
    ("name", "count", "size"), [(MONO8, 10, (960, 540)), (H264, 90, (1920, 1080)), (JPEG, 24, (816, 612))]
)
def test_every_image_and_the_camera(name: str, count: int, size: tuple[int, int]) -> None:
    source = McapSource(shared_data(name))
    frames = 0
    for frame in source:
        assert isinstance(frame, Frame)
        assert frame.image.shape == (size[1], size[0], 3)
        frames += 1
    assert frames == count == source.info.frames_declared
    assert source.report.complete
    assert source.info.notes == ()
    assert source.info.camera is not None
    assert (source.info.camera.width, source.info.camera.height) == size


def test_h264_pictures_are_the_videos_own() -> None:
    """The clip is full range and the log's stream does not say so, so its greys are stretched as limited range."""
    start_ns = 1_700_000_000_000_000_000
    compared = 0
    with VideoSource(shared_data("tags/wpilib/fieldvideo_long.mp4")) as video:
        for frame, original in zip(McapSource(shared_data(H264)), video, strict=False):
            assert isinstance(frame, Frame)
            assert isinstance(original, Frame)
            assert frame.t_ns is not None
            assert original.t_ns is not None
            assert abs(frame.t_ns - start_ns - original.t_ns) <= 1
            stretched = ((grey(original) - 16) * 255 / 219).clip(0, 255)
            assert np.abs(grey(frame) - stretched).mean() < 3
            compared += 1
    assert compared == 90


def grey(frame: Frame) -> Array:
    return cv2.cvtColor(frame.image[::4, ::4], cv2.COLOR_BGR2GRAY).astype(np.float64)


@pytest.mark.parametrize("name", [MONO8, H264, JPEG])
def test_half_a_log_gives_its_whole_messages(name: str, tmp_path: Path) -> None:
    whole = shared_data(name)
    data = whole.read_bytes()
    path = tmp_path / "half.mcap"
    path.write_bytes(data[: len(data) // 2])
    source, full = McapSource(path), McapSource(whole)
    count = 0
    for ours, theirs in zip(source, full, strict=False):
        assert isinstance(ours, Frame)
        assert isinstance(theirs, Frame)
        assert ours.t_ns == theirs.t_ns
        assert np.array_equal(ours.image, theirs.image)
        count += 1
    assert count >= full.info.frames_declared * 0.4  # type: ignore[operator]
    assert source.report.truncated


def test_rosbags_without_images_are_told_apart() -> None:
    bags = sorted(shared_data("mcap/rosbag2").glob("*.mcap"))
    assert len(bags) >= 15
    for bag in bags:
        summary = describe_mcap(bag)
        assert summary.topics
        assert summary.indexed
        with pytest.raises(InputError, match="holds no image topic; it holds"):
            McapSource(bag)


def test_mono8_rows_lose_their_padding() -> None:
    frame = next(iter(McapSource(shared_data(MONO8))))
    assert isinstance(frame, Frame)
    # a padded row taken for pixels would shear the picture: neighbours would no longer agree
    assert np.abs(np.diff(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY).astype(int), axis=0)).mean() < 10
