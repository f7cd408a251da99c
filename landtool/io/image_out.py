"""Image files: what form one is stored in, and pictures written in that form."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import cv2
import numpy as np
from PIL import Image as PilImage
from PIL import UnidentifiedImageError

from landtool.errors import OutputError
from landtool.io.images import FORMATS
from landtool.types import Image

# The endings that can be written, with the format's name
IMAGE_FORMATS = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".bmp": "bmp",
    ".webp": "webp",
    ".tif": "tiff",
    ".tiff": "tiff",
}
_JPEG_QUALITY = 95
_PNG_BITS_AT = 24  # of IHDR, the first chunk
_BITS_PER_SAMPLE_TAG = 258


@dataclass(frozen=True)
class ImageForm:
    """How a picture is stored: the format's name (empty: none that is known), and what of it BGR uint8 leaves out."""

    format: str = ""
    grey: bool = False
    sixteen_bit: bool = False
    alpha: bool = False


def image_form(data: bytes | memoryview) -> ImageForm:
    """Tell the form of an encoded picture by its head; nothing is decoded."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PilImage.DecompressionBombWarning)
            with PilImage.open(BytesIO(data), formats=FORMATS) as stored:
                return _form(stored, data)
    except (UnidentifiedImageError, PilImage.DecompressionBombError, OSError, ValueError, SyntaxError, EOFError):
        return ImageForm()


def _form(stored: PilImage.Image, data: bytes | memoryview) -> ImageForm:
    kind = "jpeg" if stored.format == "MPO" else (stored.format or "").lower()
    deep = stored.mode.startswith("I")
    if kind == "png":
        deep = data[_PNG_BITS_AT] == 16
    elif kind == "tiff":
        bits: Any = getattr(stored, "tag_v2", {}).get(_BITS_PER_SAMPLE_TAG, 8)
        deep = max(bits if isinstance(bits, tuple) else (bits,)) > 8
    grey = stored.mode in ("1", "L", "LA") or stored.mode.startswith("I")
    alpha = stored.mode in ("LA", "RGBA", "PA") or "transparency" in stored.info
    return ImageForm(kind, grey, deep, alpha)


def encode_image(image: Image, suffix: str, *, grey: bool = False, sixteen_bit: bool = False) -> bytes:
    """Return a picture (H, W, 3) BGR encoded for a file of that ending, one of `IMAGE_FORMATS`.

    JPEG has quality 95, all others keep every value. grey: one channel. sixteen_bit: the same values on the scale of
    16 bits, for PNG and TIFF. Raises OutputError for a picture the format cannot hold.
    """
    shown: np.ndarray[Any, Any] = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)) if grey else image
    if sixteen_bit:
        shown = shown.astype(np.uint16) * 257
    return _encoded(shown, suffix)


def encode_share(share: np.ndarray[Any, Any], width: int, height: int) -> bytes:
    """Return a map (h, w) of values in [0, 1] as a grey PNG of 16 bits and that size: 65535 is 1.

    Enlarged bilinearly, as it is used.
    """
    full = cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR)
    return _encoded(np.rint(np.clip(full, 0.0, 1.0) * 65535.0).astype(np.uint16), ".png")


def _encoded(samples: np.ndarray[Any, Any], suffix: str) -> bytes:
    kind = suffix.lower()
    # given to another kind of image, OpenCV warns on stderr for every picture
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if IMAGE_FORMATS[kind] == "jpeg" else []
    try:
        done, data = cv2.imencode(kind, samples, options)
    except cv2.error:
        done = False
    if not done:
        height, width = samples.shape[:2]
        raise OutputError(f"a picture of {width}x{height} cannot be encoded as {kind}", hint="write it as .png")
    return bytes(data)
