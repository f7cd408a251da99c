"""Recordings the tests make for themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from landtool.types import Image

WIDTH, HEIGHT = 96, 64
BLUE_SQUARE = (slice(8, 32), slice(8, 32))


def picture(index: int, width: int = WIDTH, height: int = HEIGHT) -> Image:
    """A noisy grey picture, (height, width, 3) BGR, that says its index by a white bar, a blue square at top left."""
    grey = np.random.default_rng(index).integers(60, 120, (height, width, 1), np.uint8)
    image = np.repeat(grey, 3, axis=2)
    image[BLUE_SQUARE] = (255, 0, 0)
    image[40:60, 4 : 8 + 2 * (index % 40)] = 255
    return image


def pictured(image: Image) -> int:
    """The index that `picture` drew, modulo 40."""
    white = int((image[50, :, 1] > 180).sum())
    return round((white - 4) / 2)


ClipMaker = Callable[..., Path]


@pytest.fixture
def make_clip(tmp_path: Path) -> ClipMaker:
    """Write a clip of `picture`s at the given pts: make_clip(name, pts, time_base=..., codec=..., b_frames=...)."""

    def make(
        name: str,
        pts: Sequence[int],
        *,
        time_base: Fraction = Fraction(1, 15360),
        codec: str = "libx264",
        b_frames: int = 0,
        gop: int = 10,
        options: dict[str, str] | None = None,
        muxer: dict[str, str] | None = None,
        size: tuple[int, int] = (WIDTH, HEIGHT),
        stored_pts: Sequence[int] | None = None,
    ) -> Path:
        path = tmp_path / name
        stored = iter(stored_pts or ())
        with av.open(str(path), "w", options=muxer or {}) as container:
            stream = container.add_stream(codec, rate=30, options=options or {})
            assert isinstance(stream, av.VideoStream)
            stream.width, stream.height = size
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            stream.time_base = stream.codec_context.time_base = time_base
            stream.codec_context.gop_size = gop
            stream.codec_context.max_b_frames = b_frames
            for index, tick in enumerate(pts):
                frame = av.VideoFrame.from_ndarray(picture(index, *size), format="bgr24")
                frame.pts, frame.time_base = tick, time_base
                for packet in stream.encode(frame):
                    if stored_pts is not None:  # of an all-intra codec; encoder and muxer want times that rise
                        packet.pts, packet.dts = next(stored), index - 1000
                    container.mux(packet)
            container.mux(stream.encode(None))
        return path

    return make
