"""Photographs as grounds: from a folder, or those that come with scikit-image."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from landtool.errors import InputError, UsageError
from landtool.synth.grounds.noise import value_noise
from landtool.synth.grounds.texture import Bytes, GroundTexture, color_atlas, factor_atlas

SCIKIT_IMAGE = "scikit-image"
_TYPES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")
_SHIPPED = ("brick.png", "grass.png", "gravel.png")
_LONGEST_PX = 2048
_AREA_PX = 2.0e6  # with its halvings and their places 9 MB
_SMALLEST_PX = 16
_PATCHES = 512
_GRAINS = 512
_TILE_M = 5.0


def load_photos(folder: str | Path) -> tuple[Path, ...]:
    """Return the photographs in a folder, by name; `scikit-image` stands for the grounds among those it ships.

    Raises UsageError when there is no such folder, no photograph in it, or no scikit-image.
    """
    if str(folder) == SCIKIT_IMAGE:
        return _shipped()
    where = Path(folder)
    if not where.is_dir():
        raise UsageError("no such folder", file=where, hint=f"give a folder of photographs, or {SCIKIT_IMAGE}")
    photos = tuple(sorted(path for path in where.iterdir() if path.is_file() and path.suffix.lower() in _TYPES))
    if not photos:
        raise UsageError("no photographs in this folder", file=where, hint=f"put in {', '.join(_TYPES)}")
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
        from skimage import data
    except ImportError:
        raise UsageError(f"{SCIKIT_IMAGE} is not installed", hint=f"pip install {SCIKIT_IMAGE}") from None
    photos = tuple(Path(data.data_dir) / name for name in _SHIPPED)
    return tuple(path for path in photos if path.is_file())


def _read(path: Path) -> Bytes:
    try:
        content = np.fromfile(path, np.uint8)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path) from None
    try:
        picture = cv2.imdecode(content, cv2.IMREAD_COLOR) if content.size else None
    except cv2.error:
        picture = None
    if picture is None:
        raise InputError("is no picture, or a broken one", file=path, hint="take it out of the folder")
    if min(picture.shape[:2]) < _SMALLEST_PX:
        raise InputError(f"has less than {_SMALLEST_PX} pixels a side", file=path, hint="take it out of the folder")
    return np.asarray(picture, dtype=np.uint8)


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
