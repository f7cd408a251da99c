"""The form of image files, and pictures written in it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as PilImage

from landtool.errors import OutputError
from landtool.io.image_out import IMAGE_FORMATS, ImageForm, encode_image, encode_share, image_form
from landtool.io.images import SUFFIXES, read_picture


def test_every_kind_that_is_read_can_be_written(tmp_path: Path) -> None:
    assert set(IMAGE_FORMATS) == set(SUFFIXES)
    image = np.random.default_rng(3).integers(0, 256, (12, 17, 3), np.uint8)
    for suffix, kind in IMAGE_FORMATS.items():
        data = encode_image(image, suffix.upper())
        assert image_form(data) == ImageForm(kind)
        (tmp_path / f"a{suffix}").write_bytes(data)
        back = read_picture(tmp_path / f"a{suffix}").image
        assert back.shape == image.shape
        assert kind == "jpeg" or np.array_equal(back, image)


@pytest.mark.parametrize(
    ("mode", "suffix", "form"),
    [
        ("L", ".jpg", ImageForm("jpeg", grey=True)),
        ("1", ".png", ImageForm("png", grey=True)),
        ("LA", ".png", ImageForm("png", grey=True, alpha=True)),
        ("RGBA", ".png", ImageForm("png", alpha=True)),
        ("RGBA", ".webp", ImageForm("webp", alpha=True)),
        ("I;16", ".png", ImageForm("png", grey=True, sixteen_bit=True)),
        ("I;16", ".tif", ImageForm("tiff", grey=True, sixteen_bit=True)),
        ("CMYK", ".jpg", ImageForm("jpeg")),
        ("RGB", ".tif", ImageForm("tiff")),
    ],
)
def test_the_form_is_told(mode: str, suffix: str, form: ImageForm, tmp_path: Path) -> None:
    PilImage.new(mode, (12, 8)).save(tmp_path / f"a{suffix}")
    assert image_form((tmp_path / f"a{suffix}").read_bytes()) == form


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_colours_of_16_bits_are_told(suffix: str) -> None:
    data = cv2.imencode(suffix, np.zeros((8, 12, 3), np.uint16))[1].tobytes()
    assert image_form(data) == ImageForm(IMAGE_FORMATS[suffix], sixteen_bit=True)


@pytest.mark.parametrize("data", [b"", b"no picture at all", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_picture_has_no_form(data: bytes) -> None:
    assert image_form(data) == ImageForm()


def test_a_picture_too_large_for_its_kind_is_refused() -> None:
    with pytest.raises(OutputError, match=r"17000x4 cannot be encoded as \.webp; write it"):
        encode_image(np.zeros((4, 17000, 3), np.uint8), ".webp")


def test_a_map_is_enlarged_and_fills_16_bits() -> None:
    share = np.array([[0.25, 1.0], [0.25, 1.0]], np.float32)
    back = cv2.imdecode(np.frombuffer(encode_share(share, 8, 6), np.uint8), cv2.IMREAD_UNCHANGED)
    assert back is not None
    assert (back.shape, back.dtype) == ((6, 8), np.uint16)
    assert (back[0, 0], back[0, -1]) == (16384, 65535)
    assert np.all(np.diff(back[0].astype(int)) >= 0)
