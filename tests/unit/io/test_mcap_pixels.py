"""Every raw encoding of ROS and Foxglove, from bytes laid out by hand."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from landtool.io.mcap_cdr import BrokenMessageError
from landtool.io.mcap_messages import RawImage
from landtool.io.mcap_pixels import LAYOUTS, bgr_from_raw

BLUE, GREEN, RED = 10, 120, 240
WIDTH, HEIGHT = 8, 6


def message(encoding: str, samples: NDArray[Any], *, padding: int = 0, big_endian: bool = False) -> RawImage:
    rows = np.ascontiguousarray(samples).view(np.uint8).reshape(samples.shape[0], -1)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=0xEE)
    height, width = samples.shape[:2]
    return RawImage(0, width, height, encoding, big_endian, padded.shape[1], padded.tobytes())


def flat(*values: int, dtype: str = "u1") -> NDArray[Any]:
    return np.broadcast_to(np.array(values, dtype), (HEIGHT, WIDTH, len(values)))


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "values", "bgr"),
    [
        ("rgb8", (RED, GREEN, BLUE), (BLUE, GREEN, RED)),
        ("bgr8", (BLUE, GREEN, RED), (BLUE, GREEN, RED)),
        ("8UC3", (BLUE, GREEN, RED), (BLUE, GREEN, RED)),
        ("rgba8", (RED, GREEN, BLUE, 7), (BLUE, GREEN, RED)),
        ("bgra8", (BLUE, GREEN, RED, 7), (BLUE, GREEN, RED)),
        ("mono8", (77,), (77, 77, 77)),
        ("8UC1", (77,), (77, 77, 77)),
    ],
)
def test_8_bit_encodings(encoding: str, values: tuple[int, ...], bgr: tuple[int, ...], padding: int) -> None:
    image = bgr_from_raw(message(encoding, flat(*values), padding=padding))
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert image.dtype == np.uint8
    assert (image == bgr).all()


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
def test_16_bits_scale_full_range_to_full_range(encoding: str, big_endian: bool) -> None:
    grey = np.linspace(0, 255, WIDTH * HEIGHT).round().reshape(HEIGHT, WIDTH)
    samples = (grey * 257).astype(">u2" if big_endian else "<u2")
    image = bgr_from_raw(message(encoding, samples, padding=6, big_endian=big_endian))
    assert (image == grey[..., None]).all()


def test_rgb16_swaps_and_scales() -> None:
    image = bgr_from_raw(message("rgb16", flat(RED * 257, GREEN * 257, BLUE * 257, dtype="<u2")))
    assert (image == (BLUE, GREEN, RED)).all()


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns_name_the_first_block_by_rows(pattern: str, bits: int) -> None:
    levels = {"r": RED, "g": GREEN, "b": BLUE}
    block = np.array([levels[letter] for letter in pattern]).reshape(2, 2)
    mosaic = np.tile(block, (HEIGHT // 2, WIDTH // 2))
    samples = mosaic.astype("u1") if bits == 8 else (mosaic * 257).astype("<u2")
    image = bgr_from_raw(message(f"bayer_{pattern}{bits}", samples, padding=2))
    assert (image[1:-1, 1:-1] == (BLUE, GREEN, RED)).all()


@pytest.mark.parametrize(
    ("encoding", "order"),
    [("yuv422", "uyvy"), ("uyvy", "uyvy"), ("yuv422_yuy2", "yuyv"), ("yuyv", "yuyv")],
)
def test_yuv422_orders(encoding: str, order: str) -> None:
    y, u, v = (int(c) for c in cv2.cvtColor(np.full((1, 1, 3), (40, 90, 200), np.uint8), cv2.COLOR_BGR2YUV)[0, 0])
    # BT.601 limited range, as 4:2:2 cameras send it
    parts = {"y": round(16 + y * 219 / 255), "u": 128 + round((u - 128) * 0.8), "v": 128 + round((v - 128) * 0.8)}
    pair = np.array([parts[letter] for letter in order], np.uint8).reshape(1, 2, 2)
    image = bgr_from_raw(message(encoding, np.tile(pair, (HEIGHT, WIDTH // 2, 1)), padding=4))
    reference = cv2.cvtColor(
        np.tile(np.array([parts["u"], parts["y"], parts["v"], parts["y"]], np.uint8).reshape(1, 2, 2), (1, 1, 1)),
        cv2.COLOR_YUV2BGR_UYVY,
    )[0, 0]
    assert (image == reference).all()
    assert reference[2] > 2 * reference[0]  # the colour is red: the channels are not swapped


def test_the_last_row_may_lack_its_padding() -> None:
    full = message("mono8", flat(77)[..., 0], padding=4)
    cut = RawImage(0, WIDTH, HEIGHT, "mono8", False, full.step, full.data[:-4])
    assert (bgr_from_raw(cut) == 77).all()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"encoding": "32FC1"}, "encoding '32FC1' is not supported"),
        ({"encoding": ""}, "encoding '' is not supported"),
        ({"step": WIDTH - 1}, "step of 7 bytes is less than a row's 8"),
        ({"step": 0}, "step of 0 bytes"),
        ({"data": bytes(47)}, "has 47 bytes of 48"),
        ({"width": 0}, "size is 0x6"),
        ({"height": 0}, "size is 8x0"),
        ({"encoding": "yuv422", "width": 3}, "cannot be 3 pixels wide"),
    ],
)
def test_a_message_that_does_not_fit_says_why(changes: dict[str, Any], reason: str) -> None:
    good = {"width": WIDTH, "height": HEIGHT, "encoding": "mono8", "step": WIDTH, "data": bytes(48)}
    with pytest.raises(BrokenMessageError, match=reason):
        bgr_from_raw(RawImage(stamp_ns=0, big_endian=False, **{**good, **changes}))


def test_the_picture_owns_its_memory() -> None:
    data = bytearray(flat(BLUE, GREEN, RED).tobytes())
    image = bgr_from_raw(RawImage(0, WIDTH, HEIGHT, "bgr8", False, 3 * WIDTH, memoryview(data)))
    data[:] = bytes(len(data))
    assert (image == (BLUE, GREEN, RED)).all()
    assert image.flags.writeable


def test_every_layout_has_a_known_size() -> None:
    assert all(layout.sample_bytes in (1, 2) and 1 <= layout.samples <= 4 for layout in LAYOUTS.values())
