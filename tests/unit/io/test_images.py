from __future__ import annotations

import struct
import zlib
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as PilImage

from landtool.errors import InputError, UsageError
from landtool.io.images import MAX_PIXELS, ImageFolderSource, natural_key
from landtool.io.source import open_source
from landtool.types import Frame, LostFrame
from tests.conftest import picture

RED_BGR = (0, 0, 255)


def _only(path: Path) -> Frame:
    (frame,) = ImageFolderSource(path)
    assert isinstance(frame, Frame)
    return frame


def _save(path: Path, mode: str, colour: object, **options: object) -> Path:
    PilImage.new(mode, (12, 8), colour).save(path, **options)  # type: ignore[arg-type]
    return path


def test_names_are_read_in_natural_order(tmp_path: Path) -> None:
    names = ["img10.png", "img2.png", "IMG1.png", "img2b.png", "a.png", "007.png"]
    for name in names:
        _save(tmp_path / name, "L", 0)
    assert [frame.file for frame in ImageFolderSource(tmp_path)] == [
        "007.png", "a.png", "IMG1.png", "img2.png", "img2b.png", "img10.png",
    ]  # fmt: skip


def test_natural_key_does_not_choke_on_other_scripts_digits() -> None:
    assert sorted(["a²", "a٣", "a1", "1a"], key=natural_key)[0] == "1a"


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".JPEG", ".bmp", ".webp", ".tif"])
def test_every_format_gives_bgr(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    PilImage.new("RGB", (48, 32), (255, 0, 0)).save(path)
    frame = _only(path)
    assert frame.image.shape == (32, 48, 3)
    assert frame.image.flags.c_contiguous
    assert np.abs(frame.image.astype(int) - RED_BGR).max() <= 3


@pytest.mark.parametrize(
    ("mode", "colour", "expected"),
    [
        ("L", 77, (77, 77, 77)),
        ("1", 1, (255, 255, 255)),
        ("LA", (77, 0), (77, 77, 77)),  # alpha is ignored, not composed
        ("RGBA", (255, 0, 0, 0), RED_BGR),
        ("I;16", 65535, (255, 255, 255)),
        ("I;16", 129 * 257 + 100, (129, 129, 129)),
    ],
)
def test_grey_alpha_and_deep_pngs_become_bgr(
    mode: str, colour: object, expected: tuple[int, int, int], tmp_path: Path
) -> None:
    assert _only(_save(tmp_path / "a.png", mode, colour)).image[3, 3].tolist() == list(expected)


def test_palette_becomes_bgr(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    PilImage.new("RGB", (12, 8), (255, 0, 0)).quantize(4).save(path)
    assert _only(path).image[3, 3].tolist() == list(RED_BGR)


def test_deep_colour_png_is_scaled(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    assert cv2.imwrite(str(path), np.full((8, 12, 3), (10 * 257, 20 * 257, 65535), np.uint16))
    assert _only(path).image[3, 3].tolist() == [10, 20, 255]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied(orientation: int, tmp_path: Path) -> None:
    upright = PilImage.fromarray(np.ascontiguousarray(picture(3)[:, :, ::-1]))
    # The stored picture is the upright one moved the other way, by the standard's own table (row 0, column 0).
    stored = {
        1: upright,
        2: upright.transpose(PilImage.Transpose.FLIP_LEFT_RIGHT),
        3: upright.transpose(PilImage.Transpose.ROTATE_180),
        4: upright.transpose(PilImage.Transpose.FLIP_TOP_BOTTOM),
        5: upright.transpose(PilImage.Transpose.TRANSPOSE),
        6: upright.transpose(PilImage.Transpose.ROTATE_90),
        7: upright.transpose(PilImage.Transpose.TRANSVERSE),
        8: upright.transpose(PilImage.Transpose.ROTATE_270),
    }[orientation]
    exif = PilImage.Exif()
    exif[0x0112] = orientation
    stored.save(tmp_path / "a.png", exif=exif)
    source = ImageFolderSource(tmp_path)
    (frame,) = source
    assert isinstance(frame, Frame)
    assert np.array_equal(frame.image, picture(3))
    assert (source.info.width, source.info.height) == (96, 64)
    # 6 is a camera turned so that its pictures need a quarter turn clockwise
    assert source.info.rotation_deg == {1: 0, 2: 0, 3: 180, 4: 180, 5: 90, 6: 90, 7: 270, 8: 270}[orientation]
    assert any("mirrored" in note for note in source.info.notes) is (orientation in (2, 4, 5, 7))


def test_broken_images_are_lost_frames_with_name_and_reason(tmp_path: Path) -> None:
    for index in range(6):
        assert cv2.imwrite(str(tmp_path / f"{index}.jpg"), picture(index))
    (tmp_path / "1.jpg").write_bytes((tmp_path / "1.jpg").read_bytes()[:900])
    (tmp_path / "2.jpg").write_bytes(b"")
    (tmp_path / "3.jpg").write_text("no picture")
    assert cv2.imwrite(str(tmp_path / "4.png"), picture(4))
    (tmp_path / "4.jpg").unlink()
    data = (tmp_path / "4.png").read_bytes()
    (tmp_path / "4.png").write_bytes(data[: len(data) // 2])
    source = ImageFolderSource(tmp_path, fps=Fraction(10))
    frames = list(source)
    assert [frame.index for frame in frames] == list(range(6))
    assert [frame.t_ns for frame in frames] == [index * 100_000_000 for index in range(6)]
    lost = {frame.file: frame.reason for frame in frames if isinstance(frame, LostFrame)}
    assert list(lost) == ["1.jpg", "2.jpg", "3.jpg", "4.png"]
    assert "truncated" in lost["1.jpg"]
    assert lost["2.jpg"] == "is empty"
    assert lost["3.jpg"] == "is no image that can be read"
    assert lost["4.png"]
    assert (source.report.decoded, source.report.lost, source.report.complete) == (2, 4, False)


def test_a_jpeg_with_a_hole_of_zeros_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    assert cv2.imwrite(str(path), picture(3))
    data = bytearray(path.read_bytes())
    data[-400:-200] = bytes(200)
    path.write_bytes(data)
    source = ImageFolderSource(tmp_path)
    (frame,) = source
    assert isinstance(frame, Frame)
    assert frame.status == "damaged"
    assert (source.report.damaged, source.report.complete) == (1, False)


def test_a_first_image_that_is_broken_does_not_end_it(tmp_path: Path) -> None:
    (tmp_path / "0.png").write_bytes(b"broken")
    _save(tmp_path / "1.png", "L", 5)
    source = ImageFolderSource(tmp_path)
    assert [type(frame) for frame in source] == [LostFrame, Frame]
    assert (source.info.width, source.info.height) == (12, 8)


def test_other_entries_are_left_out_and_noted(tmp_path: Path) -> None:
    _save(tmp_path / "a.png", "L", 5)
    (tmp_path / "notes.txt").write_text("windy")
    (tmp_path / "more.png").mkdir()
    (tmp_path / ".hidden.png").write_bytes(b"x")
    source = ImageFolderSource(tmp_path)
    assert [frame.file for frame in source] == ["a.png"]
    assert source.report.notes == ["left out, as they are no images: 2"]


def test_folders_without_images_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is an empty folder; give a folder that holds images"):
        open_source(tmp_path)
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(InputError, match="holds no images"):
        open_source(tmp_path)
    (tmp_path / "a.png").write_text("x")
    with pytest.raises(InputError, match=r"holds no image that can be decoded: is no image .*\(a\.png\)"):
        open_source(tmp_path)


def test_images_of_different_sizes_are_given(tmp_path: Path) -> None:
    for index, size in enumerate([(10, 20), (30, 5)]):
        PilImage.new("L", size).save(tmp_path / f"{index}.png")
    shapes = [frame.image.shape for frame in ImageFolderSource(tmp_path) if isinstance(frame, Frame)]
    assert shapes == [(20, 10, 3), (5, 30, 3)]


def _bomb(path: Path, width: int, height: int) -> None:
    """A PNG of a few hundred bytes that claims to be huge."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + data)


@pytest.mark.parametrize("side", [int(MAX_PIXELS**0.5) + 1, 12_000, 60_000])
def test_an_image_beyond_the_limit_is_refused_without_decoding(
    side: int, tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    _bomb(tmp_path / "0.png", side, side)
    _save(tmp_path / "1.png", "L", 5)
    lost, kept = ImageFolderSource(tmp_path)
    assert isinstance(lost, LostFrame)
    assert "limit of 80 megapixels" in lost.reason
    assert isinstance(kept, Frame)
    assert len(recwarn) == 0


def test_rate_gives_exact_times(tmp_path: Path) -> None:
    for index in range(4):
        _save(tmp_path / f"{index}.png", "L", 5)
    assert [frame.t_ns for frame in open_source(tmp_path, fps=Fraction(30000, 1001))] == [
        0, 33_366_667, 66_733_333, 100_100_000,
    ]  # fmt: skip


@pytest.mark.parametrize("fps", [0, -1.0, float("nan"), float("inf")])
def test_impossible_rates_are_refused(fps: float, tmp_path: Path) -> None:
    _save(tmp_path / "0.png", "L", 5)
    with pytest.raises(UsageError, match="give --fps above 0"):
        open_source(tmp_path, fps=fps)


def test_one_image_is_a_folder_of_one_whatever_its_name(tmp_path: Path) -> None:
    path = _save(tmp_path / "photo.dat", "RGB", (255, 0, 0), format="PNG")
    source = open_source(path)
    assert source.info.kind == "images"
    assert [frame.file for frame in source] == ["photo.dat"]
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(InputError, match=r"photo\.dat: is no image that can be read; copy it again"):
        open_source(path)
