"""Photographs as grounds: from a folder, or those that come with scikit-image."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import cv2
import numpy as np

from landtool.errors import InputError, UsageError
from landtool.io.images import SUFFIXES, PictureError, natural_key, read_picture
from landtool.synth.grounds.noise import value_noise
from landtool.synth.grounds.texture import Bytes, GroundTexture, color_atlas, factor_atlas

SCIKIT_IMAGE = "scikit-image"
_HINT = "take it out of the folder or copy it again"
_SHIPPED = ("brick.png", "grass.png", "gravel.png")
_LONGEST_PX = 2048
_AREA_PX = 1.5e6  # with its halvings and the places between them 9 MB
_SMALLEST_PX = 16
_PATCHES = 512
_GRAINS = 512
_TILE_M = 5.0


def load_photos(folder: str | Path) -> tuple[Path, ...]:
    """Return the photographs in a folder, in the natural order of their names.

    `scikit-image` stands for the grounds among the photographs that it ships.

    Raises UsageError when there is no such folder, no photograph in it, or no scikit-image.
    """
    if str(folder) == SCIKIT_IMAGE:
        return _shipped()
    where = Path(folder)
    if not where.is_dir():
        raise UsageError("no such folder", file=where, hint=f"give a folder of photographs, or {SCIKIT_IMAGE}")
    named = (path for path in where.iterdir() if path.suffix.lower() in SUFFIXES and not path.name.startswith("."))
    photos = tuple(sorted((path for path in named if path.is_file()), key=lambda path: natural_key(path.name)))
    if not photos:
        raise UsageError("no photographs in this folder", file=where, hint=f"put in {', '.join(SUFFIXES)}")
    return photos


def photo_ground(path: str | Path, rng: np.random.Generator | None = None) -> GroundTexture:
    """Return a ground that a photograph covers, again and again in mirror images.

    Its width is 5 m: only the caller knows better, and replaces `tile_m`. rng: draws the colour of a grey photograph,
    and slow patches. Raises InputError for a file that is no picture, is broken, or has less than 16 pixels a side.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    picture = _colored(_shrunk(_read(Path(path))), rng)
    slow = 1.0 + 0.06 * value_noise(_PATCHES, 8, 0.6, rng)
    fine = 1.0 + 0.08 * value_noise(_GRAINS, 64, 0.8, rng)
    return GroundTexture(
        kind=f"photo {Path(path).name}",
        detail=color_atlas(picture, mirrored=True),
        patches=factor_atlas(np.repeat(slow[:, :, None], 3, axis=2)),
        grain=factor_atlas(fine),
        tile_m=_TILE_M,
        patch_tiles=17.3,
        grain_tile_m=0.256,
    )


def _shipped() -> tuple[Path, ...]:
    try:
        data = import_module("skimage.data")
    except ImportError:
        raise UsageError(f"{SCIKIT_IMAGE} is not installed", hint=f"pip install {SCIKIT_IMAGE}") from None
    photos = tuple(Path(data.data_dir) / name for name in _SHIPPED)
    return tuple(path for path in photos if path.is_file())


def _read(path: Path) -> Bytes:
    try:
        found = read_picture(path)
    except PictureError as error:
        raise InputError(str(error), file=path, hint=_HINT) from None
    if found.damage:
        raise InputError(found.damage, file=path, hint=_HINT)
    if min(found.image.shape[:2]) < _SMALLEST_PX:
        raise InputError(f"has less than {_SMALLEST_PX} pixels a side", file=path, hint=_HINT)
    return found.image


def _shrunk(picture: Bytes) -> Bytes:
    height, width = picture.shape[:2]
    scale = min(1.0, _LONGEST_PX / max(height, width), (_AREA_PX / (height * width)) ** 0.5)
    if scale == 1.0:
        return picture
    # an extremely long one stays no thinner than the smallest
    size = max(_SMALLEST_PX, round(width * scale)), max(_SMALLEST_PX, round(height * scale))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _colored(picture: Bytes, rng: np.random.Generator) -> Bytes:
    """Return a grey picture in a tint, from bluish to brown or green, and a coloured one as it is."""
    warm, green = rng.uniform(-0.06, 0.22), rng.uniform(-0.03, 0.10)
    if np.ptp(picture.astype(np.int16), axis=2).max() > 8:
        return picture
    factors = np.array([1.0 - warm, 1.0 + green, 1.0 + 0.5 * warm]) * rng.uniform(0.8, 1.1)
    return np.clip(picture * factors + 0.5, 0, 255).astype(np.uint8)
