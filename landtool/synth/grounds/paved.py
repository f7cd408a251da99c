"""Grounds laid by hand or cast: concrete, tiles, cobbles, brick."""

from __future__ import annotations

import numpy as np

from landtool.synth.grounds.noise import blurred, cells, leveled, lit, paving, smoothstep, value_noise
from landtool.synth.grounds.painting import (
    PATCH_TEXELS,
    TEXELS,
    Painting,
    mixed,
    patches,
    per_cell,
    per_cell_values,
    pick,
)
from landtool.synth.grounds.texture import Map

# dark, bright, joint
_CONCRETE = (
    ((120, 120, 118), (168, 166, 160), (58, 56, 54)),
    ((96, 98, 100), (140, 142, 142), (42, 42, 44)),
    ((142, 136, 124), (190, 184, 170), (80, 74, 66)),
    ((136, 142, 146), (184, 188, 190), (66, 70, 74)),
)
# grout, then tiles
_TILES = (
    ((150, 142, 134), (190, 182, 168), (180, 170, 156)),
    ((112, 90, 84), (174, 126, 114), (164, 116, 106)),
    ((92, 92, 92), (150, 150, 150), (138, 138, 140)),
    ((176, 174, 168), (122, 128, 136), (130, 136, 142)),
    ((110, 100, 88), (178, 132, 92), (164, 116, 80)),
)
# joint, then stones
_COBBLES = (
    ((62, 58, 52), (112, 108, 106), (128, 112, 98), (98, 98, 104), (142, 128, 116), (116, 96, 86)),
    ((74, 72, 68), (126, 126, 128), (108, 108, 112), (144, 142, 140)),
    ((84, 76, 64), (150, 132, 110), (130, 110, 92), (164, 150, 132), (112, 104, 100)),
)
_BRICK = (
    ((86, 74, 66), (148, 86, 68), (132, 74, 60), (164, 102, 80), (118, 68, 58)),
    ((120, 112, 102), (148, 92, 72), (128, 78, 66), (170, 116, 92)),
    ((70, 66, 64), (128, 78, 66), (104, 68, 62), (142, 94, 78)),
    ((132, 122, 108), (178, 146, 108), (164, 128, 92), (192, 164, 128)),
)
_SLABS = 2  # a side of the tile
_SLAB_PATCH = 8  # texels of the patches that a slab covers, so that each has its own tone


def concrete(rng: np.random.Generator, look: int) -> Painting:
    """Paint cast slabs: cloudy, porous, stained, with joints between them."""
    dark, bright, joint = pick(_CONCRETE, look, rng)
    cloud = 0.12 * value_noise(TEXELS, 8, 0.8, rng) + 0.10 * value_noise(TEXELS, 64, 1.0, rng)
    picture = mixed(dark, bright, np.clip(0.55 + cloud, -0.3, 1.4))
    pores = value_noise(TEXELS, 256, 1.1, rng) + 0.3 * value_noise(TEXELS, 16, 0.7, rng)
    picture = mixed(picture, joint, 0.45 * smoothstep(2.2, 3.2, pores))
    streaks = smoothstep(1.0, 2.6, value_noise(TEXELS, 16, 0.8, rng))
    picture *= (1.0 - 0.18 * streaks)[:, :, None]
    slabs = paving(TEXELS, _SLABS, _SLABS, 0.0, rng, shift=0.0)
    edge = slabs.edge + 0.5 * value_noise(TEXELS, 128, 0.8, rng)
    picture *= (1.0 - 0.12 * (1.0 - smoothstep(1.0, 14.0, slabs.edge)))[:, :, None]
    picture = mixed(picture, joint, 0.9 * (1.0 - smoothstep(0.7, 1.9, edge)))
    slow = patches(rng, 0.07, (0.74, 0.73, 0.71), rng.uniform(0.4, 0.9)) * _slab_tones(rng)
    return Painting(leveled(picture, 4), rng.uniform(4.0, 7.0), slow, 0.07, PATCH_TEXELS / (_SLAB_PATCH * _SLABS))


def _slab_tones(rng: np.random.Generator) -> Map:
    """Return (512, 512, 1) factors, one a slab."""
    tones = rng.normal(1.0, 0.05, (PATCH_TEXELS // _SLAB_PATCH,) * 2).astype(np.float32)
    slabs: Map = np.kron(tones, np.ones((_SLAB_PATCH, _SLAB_PATCH), np.float32))[:, :, None]
    return slabs


def tiles(rng: np.random.Generator, look: int) -> Painting:
    """Paint square flags in a grid or in half-shifted courses, hardly apart in colour."""
    grout, *shades = pick(_TILES, look, rng)
    side = int(rng.choice((8, 10, 12)))
    flags = paving(TEXELS, side, side, 0.0, rng, shift=float(rng.choice((0.0, 0.0, 0.5))))
    picture = per_cell(flags, shades, 0.025, rng)
    vein = 0.05 * value_noise(TEXELS, 32, 0.8, rng) + 0.04 * value_noise(TEXELS, 128, 1.0, rng)
    picture *= (1.0 + vein)[:, :, None]
    gap = rng.uniform(0.8, 1.6)
    worn = flags.edge + 0.3 * value_noise(TEXELS, 128, 0.8, rng)
    picture *= (1.0 - 0.15 * (1.0 - smoothstep(gap, gap + 3.5, flags.edge)))[:, :, None]
    dirt = (0.9 + 0.1 * value_noise(TEXELS, 16, 0.7, rng))[:, :, None]
    picture = mixed(picture, grout * dirt, 1.0 - smoothstep(gap, gap + 1.2, worn))
    slow = patches(rng, 0.05, (0.8, 0.78, 0.75), rng.uniform(0.2, 0.8))
    return Painting(leveled(picture, 4), rng.uniform(3.2, 5.0), slow, 0.05)


def cobbles(rng: np.random.Generator, look: int) -> Painting:
    """Paint hewn stones in courses, each of its own colour and its own slope."""
    joint, *shades = pick(_COBBLES, look, rng)
    rows = int(rng.choice((24, 28, 32)))
    stones = paving(TEXELS, rows, rows - 4 * int(rng.integers(0, 2)), 2.6, rng)
    picture = per_cell(stones, shades, 0.08, rng)
    return _laid(picture, stones.edge, joint, (1.6, 3.8), TEXELS / rows * 0.14, rng, rng.uniform(2.8, 3.8))


def brick(rng: np.random.Generator, look: int) -> Painting:
    """Paint bricks in running bond, mortar or sand between them."""
    joint, *shades = pick(_BRICK, look, rng)
    rows, columns = ((32, 16), (36, 18), (28, 14))[int(rng.integers(3))]
    bricks = paving(TEXELS, rows, columns, 0.6, rng)
    picture = per_cell(bricks, shades, 0.07, rng)
    return _laid(picture, bricks.edge, joint, (1.0, 2.6), 3.0, rng, rng.uniform(2.8, 3.8))


def _laid(
    picture: Map,
    edge: Map,
    joint: Map,
    gap: tuple[float, float],
    round_px: float,
    rng: np.random.Generator,
    tile_m: float,
) -> Painting:
    """Return stones (n, n, 3) with worn rims, lit from a side, and joints where `edge` is below the gap, texels."""
    angle = rng.uniform(0.0, 2 * np.pi)
    rough = value_noise(TEXELS, 128, 0.9, rng)
    worn = edge + 0.35 * rough
    height = round_px * smoothstep(gap[0] - 1.0, gap[0] + 2.0 * round_px, blurred(worn, 0.7)) + 0.35 * rough
    light = 1.0 + 0.35 * np.clip(lit(height, angle), -1.2, 1.2) + 0.06 * value_noise(TEXELS, 64, 0.9, rng)
    picture = picture * light[:, :, None]
    soil = joint * (0.9 + 0.18 * value_noise(TEXELS, 64, 1.0, rng))[:, :, None]
    pits = cells(TEXELS, 128, 1.0, rng)
    chips = per_cell_values(pits, rng.random(pits.count, np.float32)) < 0.02
    picture *= (1.0 - 0.25 * chips)[:, :, None]
    picture = mixed(picture, soil, 1.0 - smoothstep(gap[0] - 0.6, gap[1] - 0.6, worn))
    slow = patches(rng, 0.07, (0.78, 0.76, 0.70), rng.uniform(0.3, 1.0))
    return Painting(leveled(picture, 8), tile_m, slow, 0.09)
