from __future__ import annotations

import cv2
import numpy as np
import pytest

from landtool.io.damage import is_zeroed


def jpeg() -> bytes:
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    return bytes(cv2.imencode(".jpg", noise)[1])


def with_segment(data: bytes, content: bytes) -> bytes:
    """Put an APP1 segment, as cameras write for thumbnails, behind the start of the image."""
    return data[:2] + b"\xff\xe1" + (len(content) + 2).to_bytes(2, "big") + content + data[2:]


def test_a_sound_picture_is_sound() -> None:
    assert not is_zeroed(jpeg(), jpeg=True)
    assert not is_zeroed(jpeg() + bytes(1000), jpeg=True)


def test_a_padded_thumbnail_in_the_header_is_no_damage() -> None:
    assert not is_zeroed(with_segment(jpeg(), jpeg() + bytes(500)), jpeg=True)


@pytest.mark.parametrize("header", [b"", jpeg() + bytes(500)])
def test_a_lost_block_in_the_scan_is_damage(header: bytes) -> None:
    data = jpeg()
    broken = data[:-1500] + bytes(512) + data[-988:]
    assert len(broken) == len(data)
    assert is_zeroed(with_segment(broken, header), jpeg=True)


def test_other_codecs_are_looked_at_whole() -> None:
    assert is_zeroed(b"\x01" + bytes(64) + b"\x01", jpeg=False)
    assert not is_zeroed(b"\x01" + bytes(63) + b"\x01" + bytes(200), jpeg=False)
