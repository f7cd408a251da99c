from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.synth.grounds import ground_albedo, load_photos, photo_ground
from landtool.tone import srgb_decode


def _write(path: Path, picture: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), picture)
    return path


def _colors(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)


def _texels(ground) -> np.ndarray:
    width, height, left, top = ground.detail.places[:, 0].astype(int)
    return ground.detail.picture[top : top + height, left : left + width, :3]


def test_a_folder_is_read_in_natural_order_without_what_is_no_picture(tmp_path: Path) -> None:
    for name in ("b10.png", "b9.PNG", "a.jpg", ".hidden.png"):
        _write(tmp_path / name, _colors(20, 20))
    (tmp_path / "notes.txt").write_text("no picture")
    (tmp_path / "folder.png").mkdir()
    assert [path.name for path in load_photos(tmp_path)] == ["a.jpg", "b9.PNG", "b10.png"]


def test_an_empty_or_absent_folder_is_a_wrong_request(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no photographs"):
        load_photos(tmp_path)
    with pytest.raises(UsageError, match="no such folder"):
        load_photos(tmp_path / "absent")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".webp", ".bmp", ".tif"])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.6])
def test_a_broken_photograph_is_named(tmp_path: Path, suffix: str, share: float) -> None:
    whole = _write(tmp_path / f"whole{suffix}", _colors(90, 120)).read_bytes()
    broken = tmp_path / f"broken{suffix}"
    broken.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match="broken"):
        photo_ground(broken)


def test_text_a_speck_and_nothing_are_no_photographs(tmp_path: Path) -> None:
    (tmp_path / "text.jpg").write_text("hello")
    _write(tmp_path / "speck.png", _colors(4, 400))
    for name in ("text.jpg", "speck.png", "absent.png"):
        with pytest.raises(InputError, match=name):
            photo_ground(tmp_path / name)


def test_a_photograph_lies_in_its_own_colours_at_the_scale_asked_for(tmp_path: Path) -> None:
    picture = _colors(60, 90)
    ground = replace(photo_ground(_write(tmp_path / "p.png", picture)), tile_m=9.0)
    np.testing.assert_array_equal(_texels(ground), picture)
    # texels are square: 0.1 m both ways; the patches change its brightness a little
    x, y = (grid.astype(np.float32) * np.float32(0.1) + np.float32(0.05) for grid in np.meshgrid(range(90), range(60)))
    found = ground_albedo(ground, x, y, np.full((1, 1), 0.1, np.float32))
    assert np.corrcoef(found.ravel(), srgb_decode(picture / 255.0).ravel())[0, 1] > 0.99


def test_the_repeats_of_a_photograph_join(tmp_path: Path) -> None:
    ramp = np.repeat(np.linspace(20, 235, 128).astype(np.uint8)[None, :], 128, axis=0)
    ground = photo_ground(_write(tmp_path / "ramp.png", ramp))
    x = np.linspace(0.0, 4 * ground.tile_m, 512, dtype=np.float32)[None]
    line = ground_albedo(ground, x, np.ones_like(x), np.full_like(x, ground.texel_m * 2))[0, :, 1]
    assert np.abs(np.diff(line)).max() < 0.1 * np.ptp(line)


def test_grey_photographs_are_tinted_and_coloured_ones_are_not(tmp_path: Path) -> None:
    grey = _write(tmp_path / "grey.png", np.full((32, 32), 128, np.uint8))
    means = [photo_ground(grey, np.random.default_rng(seed)).mean for seed in range(8)]
    assert np.ptp(np.stack(means)[:, 0] / np.stack(means)[:, 2]) > 0.05
    first, again = (photo_ground(grey, np.random.default_rng(7)).detail.picture for _ in range(2))
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("shape", [(3000, 4000), (40, 9000), (2600, 2600)])
def test_large_photographs_are_shrunk(tmp_path: Path, shape: tuple[int, int]) -> None:
    ground = photo_ground(_write(tmp_path / "large.png", np.zeros((*shape, 3), np.uint8)))
    assert ground.size_bytes <= 12e6
    assert max(_texels(ground).shape) <= 2048


def test_scikit_images_photographs_are_grounds() -> None:
    pytest.importorskip("skimage")
    photos = load_photos("scikit-image")
    assert [path.stem for path in photos] == ["brick", "grass", "gravel"]
    assert all(photo_ground(path).size_bytes <= 12e6 for path in photos)


def test_absent_scikit_image_is_a_wrong_request(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skimage", None)
    monkeypatch.delitem(sys.modules, "skimage.data", raising=False)
    with pytest.raises(UsageError, match="pip install scikit-image"):
        load_photos("scikit-image")
