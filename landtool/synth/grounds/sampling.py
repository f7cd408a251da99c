"""What each pixel sees of a ground: neither aliased far away nor blurred close by."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.synth.grounds.texture import Atlas, Bytes, GroundTexture, Map
from landtool.tone import linear_lut

_FAR_M = 1e5  # float32 knows a point this far away to a centimetre; nothing is told apart there
_SHARPER = 0.25  # levels finer than a texel a pixel: the blend of two levels is softer than a lens
_STEP = 4  # the patches are slow, so one pixel of 4 x 4 is enough
_FACTORS = (np.arange(256) / 128.0).astype(np.float32)
_GREY = np.array([[0.114, 0.587, 0.299]], np.float32)


def ground_albedo(ground: GroundTexture, x_m: Map, y_m: Map, footprint_m: Map) -> Map:
    """Return the albedo (H, W, 3) float32 of a ground, linear light, blue first.

    x_m, y_m: (H, W) float32, what each pixel sees, in the ground's own plane; inf and NaN are allowed where it sees
    none. footprint_m: width of a pixel on the ground, of the whole picture in any resolution (h, w), stretched to it.
    """
    height, width = x_m.shape
    x, y = (_finite(values) for values in (x_m, y_m))
    levels = _levels(footprint_m)
    full = _enlarged(levels, width, height)
    detail = _lod(full, ground.texel_m)
    u, v = _cycles(ground.detail, x, y, ground.tile_m)
    albedo = _blended(ground.detail, u, v, detail, _table(ground))
    albedo *= _patches(ground, x, y, levels)
    if float(full.min()) < np.log2(ground.texel_m):
        grain = _grain(ground, x, y, full)
        albedo *= cv2.merge([grain, grain, grain])
    return albedo


def relative_detail(ground: GroundTexture, albedo: Map) -> Map:
    """Return (H, W) how bright each pixel of `ground_albedo` is beside the ground's mean, 1 on average."""
    weights = _GREY / float(_GREY[0] @ ground.mean)
    return np.asarray(cv2.transform(albedo, weights), dtype=np.float32)


def _finite(values: Map) -> Map:
    finite = np.clip(values, np.float32(-_FAR_M), np.float32(_FAR_M))
    return np.asarray(cv2.patchNaNs(finite, 0.0), dtype=np.float32)


def _levels(footprint_m: Map) -> Map:
    """Return log2 of the footprint in metres, finite."""
    kept = np.clip(np.asarray(footprint_m, np.float32), np.float32(1e-5), np.float32(_FAR_M))
    return np.log2(np.asarray(cv2.patchNaNs(kept, _FAR_M), np.float32))


def _lod(levels: Map, texel_m: float) -> Map:
    lod: Map = levels - np.float32(np.log2(texel_m) + _SHARPER)
    return lod


def _enlarged(picture: Map, width: int, height: int) -> Map:
    if picture.shape[:2] == (height, width):
        return picture
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32)


def _cycles(atlas: Atlas, x: Map, y: Map, tile_m: float) -> tuple[Map, Map]:
    """Return where in the tile each pixel looks, both in [0, 1]."""
    tall_m = tile_m * float(atlas.places[1, 0] / atlas.places[0, 0])
    return _cycle(x, tile_m, atlas.mirrored), _cycle(y, tall_m, atlas.mirrored)


def _cycle(values: Map, tile_m: float, mirrored: bool) -> Map:
    turns: Map = values * np.float32((0.5 if mirrored else 1.0) / tile_m)
    turns -= np.floor(turns)
    if mirrored:
        turns = np.float32(1.0) - np.abs(np.float32(2.0) * turns - np.float32(1.0))
    return turns


def _table(ground: GroundTexture) -> Map:
    """Return (1, 256, 3): linear light of a byte, tinted."""
    return np.asarray(linear_lut("srgb")[:, None] * np.array(ground.tint, np.float32), np.float32)[None]


def _blended(atlas: Atlas, u: Map, v: Map, lod: Map, table: Map) -> Map:
    """Return the picture at fractional levels `lod` (H, W), blended between the two next to each.

    The levels are averages of light, and so is the blend of two; only from texel to texel it is bytes that are
    blended, which is four times as fast and darkens the hardest edges a little.
    """
    last = np.float32(atlas.levels - 1)
    lod = np.clip(lod, np.float32(0.0), last)
    lower = lod.astype(np.uint8)
    first = np.asarray(cv2.LUT(_looked_up(atlas, u, v, lower), table), dtype=np.float32)
    share = lod - lower
    if float(share.max()) < 0.02:
        return first
    upper = np.minimum(lower + np.uint8(1), np.uint8(last))
    second = np.asarray(cv2.LUT(_looked_up(atlas, u, v, upper), table), dtype=np.float32)
    second -= first
    second *= cv2.merge([share, share, share])
    first += second
    return first


def _looked_up(atlas: Atlas, u: Map, v: Map, level: NDArray[np.uint8]) -> Bytes:
    """Return the picture's bytes at (u, v), each pixel from its own level."""
    lowest = int(level.min())
    width, height, left, top = (
        atlas.places[:, lowest, None, None] if lowest == level.max() else (cv2.LUT(level, row) for row in atlas.places)
    )
    # the centre of the first texel is half a texel from the edge
    where = cv2.merge([u * width + (left - np.float32(0.5)), v * height + (top - np.float32(0.5))])
    found = cv2.remap(atlas.picture, where, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    return np.asarray(found if found.ndim == 2 else cv2.cvtColor(found, cv2.COLOR_BGRA2BGR), dtype=np.uint8)


def _patches(ground: GroundTexture, x: Map, y: Map, levels: Map) -> Map:
    height, width = x.shape
    small = max(1, width // _STEP), max(1, height // _STEP)
    x, y = (np.asarray(cv2.resize(values, small, interpolation=cv2.INTER_NEAREST), np.float32) for values in (x, y))
    tile_m = ground.tile_m * ground.patch_tiles
    texel_m = tile_m / float(ground.patches.places[0, 0]) / _STEP
    lod = _lod(_enlarged(levels, *small), texel_m)
    u, v = _cycles(ground.patches, x, y, tile_m)
    return _enlarged(_blended(ground.patches, u, v, lod, _FACTORS), width, height)


def _grain(ground: GroundTexture, x: Map, y: Map, levels: Map) -> Map:
    atlas = ground.grain
    lod = _lod(levels, ground.grain_tile_m / float(atlas.places[0, 0]))
    # nobody sees a step between two levels of grain
    level = np.clip(lod + np.float32(0.5), 0, atlas.levels - 1).astype(np.uint8)
    u, v = _cycles(atlas, x, y, ground.grain_tile_m)
    return np.asarray(cv2.LUT(_looked_up(atlas, u, v, level), _FACTORS), dtype=np.float32)
