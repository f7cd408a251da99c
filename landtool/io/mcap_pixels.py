"""From the pixels of raw image messages to BGR, 8 bits a channel, and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.io.mcap_cdr import BrokenMessageError
from landtool.io.mcap_messages import RawImage
from landtool.types import Image

Samples = NDArray[Any]  # (H, W) or (H, W, C), uint8 or uint16, in the machine's byte order


class Layout(NamedTuple):
    """How an encoding stores a pixel: bytes a sample, samples a pixel, and the way to BGR."""

    sample_bytes: int
    samples: int
    to_bgr: Callable[[Samples], Image]


def _colour(code: int) -> Callable[[Samples], Image]:
    return lambda samples: np.asarray(cv2.cvtColor(_eight_bit(samples), code), dtype=np.uint8)


def _bgr(samples: Samples) -> Image:
    return np.array(_eight_bit(samples))


def _eight_bit(samples: Samples) -> Image:
    """Scale 16 bits to 8, full scale to full scale, as ROS's cv_bridge does."""
    if samples.dtype == np.uint8:
        return np.ascontiguousarray(samples)
    return np.asarray(cv2.convertScaleAbs(samples, alpha=255.0 / 65535.0), dtype=np.uint8)


def _layouts() -> dict[str, Layout]:
    """Return the table of ROS's encodings and Foxglove's names for the same."""
    grey, rgb = _colour(cv2.COLOR_GRAY2BGR), _colour(cv2.COLOR_RGB2BGR)
    rgba, bgra = _colour(cv2.COLOR_RGBA2BGR), _colour(cv2.COLOR_BGRA2BGR)
    uyvy, yuy2 = _colour(cv2.COLOR_YUV2BGR_UYVY), _colour(cv2.COLOR_YUV2BGR_YUY2)
    table = {
        "yuv422": Layout(1, 2, uyvy),
        "uyvy": Layout(1, 2, uyvy),
        "yuv422_yuy2": Layout(1, 2, yuy2),
        "yuyv": Layout(1, 2, yuy2),
    }
    for bits, size in ((8, 1), (16, 2)):
        for name, samples, to_bgr in (("rgb", 3, rgb), ("bgr", 3, _bgr), ("rgba", 4, rgba), ("bgra", 4, bgra)):
            table[f"{name}{bits}"] = Layout(size, samples, to_bgr)
        for name, samples, to_bgr in (("UC1", 1, grey), ("UC3", 3, _bgr), ("UC4", 4, bgra)):
            table[f"{bits}{name}"] = Layout(size, samples, to_bgr)
        table[f"mono{bits}"] = Layout(size, 1, grey)
        # ROS names the first 2x2 block by rows, so does OpenCV's long form
        for pattern in ("RGGB", "BGGR", "GBRG", "GRBG"):
            code: int = getattr(cv2, f"COLOR_Bayer{pattern}2BGR")
            table[f"bayer_{pattern.lower()}{bits}"] = Layout(size, 1, _colour(code))
    return table


LAYOUTS = _layouts()


def bgr_from_raw(message: RawImage) -> Image:
    """Return (H, W, 3) BGR uint8, own memory.

    Raises BrokenMessageError for sizes that do not fit the data and for an encoding that is not known.
    """
    layout = LAYOUTS.get(message.encoding)
    if layout is None:
        raise BrokenMessageError(f"the encoding '{message.encoding}' is not supported")
    if message.width < 1 or message.height < 1:
        raise BrokenMessageError(f"the image size is {message.width}x{message.height}")
    row_bytes = message.width * layout.sample_bytes * layout.samples
    if message.step < row_bytes:
        raise BrokenMessageError(f"the step of {message.step} bytes is less than a row's {row_bytes}")
    need = message.step * (message.height - 1) + row_bytes  # the last row's padding may be left out
    if len(message.data) < need:
        raise BrokenMessageError(f"the image has {len(message.data)} bytes of {need}")
    if message.encoding in ("yuv422", "uyvy", "yuv422_yuy2", "yuyv") and message.width % 2:
        raise BrokenMessageError(f"a {message.encoding} image cannot be {message.width} pixels wide")
    return layout.to_bgr(_samples(message, layout, row_bytes))


def raw_from_bgr(image: Image, like: RawImage) -> RawImage:
    """Return a picture (H, W, 3) BGR as a message that differs from `like` in its pixels only, without padding.

    16 bits hold the 8 there are, full scale to full scale; alpha becomes opaque. Encodings with less than a whole
    sample a pixel and channel (Bayer patterns, YUV 4:2:2) become bgr8.
    """
    stored = _STORED.get(like.encoding)
    encoding = like.encoding if stored else "bgr8"
    sample_bytes, code = stored or (1, None)
    samples: Samples = np.ascontiguousarray(image if code is None else np.asarray(cv2.cvtColor(image, code)))
    if sample_bytes == 2:
        samples = (samples.astype(np.uint16) * 257).astype(">u2" if like.big_endian else "<u2")
    height, width = image.shape[:2]
    data = samples.tobytes()
    return replace(like, width=width, height=height, encoding=encoding, step=len(data) // height, data=data)


def _stored() -> dict[str, tuple[int, int | None]]:
    """Return bytes a sample and the way from BGR of every encoding that can be written."""
    grey, rgb, rgba, bgra = cv2.COLOR_BGR2GRAY, cv2.COLOR_BGR2RGB, cv2.COLOR_BGR2RGBA, cv2.COLOR_BGR2BGRA
    table: dict[str, tuple[int, int | None]] = {}
    for bits, size in ((8, 1), (16, 2)):
        for name, code in (("mono", grey), ("rgb", rgb), ("bgr", None), ("rgba", rgba), ("bgra", bgra)):
            table[f"{name}{bits}"] = (size, code)
        for name, code in (("UC1", grey), ("UC3", None), ("UC4", bgra)):
            table[f"{bits}{name}"] = (size, code)
    return table


_STORED = _stored()


def _samples(message: RawImage, layout: Layout, row_bytes: int) -> Samples:
    """Return a view of the pixels without the padding, 16-bit values in the machine's byte order."""
    raw = np.frombuffer(message.data, dtype=np.uint8)
    rows = np.lib.stride_tricks.as_strided(raw, (message.height, row_bytes), (message.step, 1), writeable=False)
    samples: Samples = rows
    if layout.sample_bytes == 2:
        order = ">u2" if message.big_endian else "<u2"
        samples = np.ascontiguousarray(rows).view(order).astype(np.uint16)
    shape = (message.height, message.width, layout.samples)
    return samples.reshape(shape if layout.samples > 1 else shape[:2])
