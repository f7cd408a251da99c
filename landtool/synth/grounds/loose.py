"""Grounds of stones and grains: asphalt, gravel, soil, sand."""

from __future__ import annotations

import numpy as np

from landtool.synth.grounds.noise import blurred, cells, leveled, lit, smoothstep, value_noise
from landtool.synth.grounds.painting import (
    TEXELS,
    Painting,
    mixed,
    patches,
    per_cell,
    per_cell_values,
    pick,
)
from landtool.synth.grounds.texture import Map

# binder, stones
_ASPHALT = (
    ((46, 47, 50), (64, 65, 67), (84, 84, 84), (60, 58, 56)),
    ((66, 66, 68), (92, 92, 92), (118, 116, 112), (84, 80, 76)),
    ((92, 92, 96), (122, 122, 124), (146, 144, 142), (112, 108, 106)),
    ((70, 64, 60), (100, 92, 86), (124, 116, 108), (88, 78, 70)),
)
_GRAVEL = (
    ((196, 180, 150), (168, 146, 112), (208, 198, 178), (126, 102, 78), (152, 134, 112)),
    ((150, 150, 152), (112, 114, 118), (180, 180, 178), (92, 92, 94)),
    ((176, 168, 154), (120, 112, 104), (150, 132, 112), (196, 190, 180), (104, 96, 90)),
    ((128, 118, 110), (98, 88, 82), (154, 144, 136), (84, 80, 80)),
)
# dark, bright, straw
_SOIL = (
    ((70, 56, 44), (126, 106, 86), (158, 144, 118)),
    ((84, 64, 56), (130, 108, 98), (156, 138, 118)),
    ((88, 64, 50), (140, 110, 88), (168, 150, 122)),
    ((62, 52, 44), (108, 94, 80), (142, 128, 100)),
)
# shade, light, dark grain
_SAND = (
    ((146, 128, 98), (188, 172, 140), (106, 90, 68)),
    ((134, 122, 98), (176, 164, 138), (94, 84, 70)),
    ((160, 136, 106), (198, 176, 146), (122, 98, 76)),
)


def asphalt(rng: np.random.Generator, look: int) -> Painting:
    """Paint dark binder with stones of 6 to 12 mm in it, worn bare here and there."""
    binder, *stones = pick(_ASPHALT, look, rng)
    grit = cells(TEXELS, 300, 1.0, rng)
    bare = np.float32(rng.uniform(0.35, 0.75)) + 0.15 * value_noise(TEXELS, 16, 0.7, rng)
    shown = per_cell_values(grit, rng.random(grit.count, np.float32)) < bare
    share = blurred(shown * smoothstep(0.3, 1.6, grit.edge + 0.4), 0.6)
    picture = mixed(binder, per_cell(grit, stones, 0.16, rng), share)
    rough = 0.055 * value_noise(TEXELS, 128, 1.1, rng) + 0.11 * value_noise(TEXELS, 32, 1.1, rng)
    picture *= (1.0 + rough)[:, :, None]
    slow = patches(rng, rng.uniform(0.09, 0.15), (0.66, 0.66, 0.68), rng.uniform(0.2, 0.8))
    return Painting(leveled(picture, 8), rng.uniform(2.4, 3.4), slow * _lanes(rng), 0.16)


def _lanes(rng: np.random.Generator) -> Map:
    """Return (512, 1, 3) factors: strips as the paver laid them, a dark seam between some."""
    strips = 16
    bright = np.repeat(rng.normal(1.0, 0.035, strips), 512 // strips)
    seam = np.ones(512)
    seam[:: 512 // strips] = np.where(rng.random(strips) < 0.5, 0.75, 1.0)
    return (bright * seam).astype(np.float32)[:, None, None]


def gravel(rng: np.random.Generator, look: int) -> Painting:
    """Paint stones that lie on one another, each with its colour, its lit and its shaded side."""
    colors = pick(_GRAVEL, look, rng)
    angle, side = rng.uniform(0.0, 2 * np.pi), int(rng.integers(52, 84))
    below = _stones(side * 2, colors, angle, rng) * np.float32(0.55)
    top = cells(TEXELS, side, 1.0, rng)
    radius = TEXELS / side / 2
    there = per_cell_values(top, rng.random(top.count, np.float32)) < 0.8
    edge = np.where(there, top.edge + 0.8 * value_noise(TEXELS, 128, 0.7, rng), 0.0).astype(np.float32)
    share = smoothstep(0.08 * radius, 0.24 * radius, edge)
    picture = mixed(below, _shaded(top.number, top.count, edge, colors, radius, angle, rng), share)
    picture *= (1.0 + 0.05 * value_noise(TEXELS, 16, 0.8, rng))[:, :, None]
    return Painting(leveled(picture, 8), rng.uniform(1.7, 2.6), patches(rng, 0.10, (0.8, 0.78, 0.74), 0.6), 0.12)


def _stones(side: int, colors: list[Map], angle: float, rng: np.random.Generator) -> Map:
    small = cells(TEXELS, side, 1.0, rng)
    return _shaded(small.number, small.count, small.edge, colors, TEXELS / side / 2, angle, rng)


def _shaded(
    number: np.ndarray[tuple[int, ...], np.dtype[np.int32]],
    count: int,
    edge: Map,
    colors: list[Map],
    radius: float,
    angle: float,
    rng: np.random.Generator,
) -> Map:
    """Return stones (n, n, 3) of a radius in texels: round at the rim, tilted as they lie, dark where they touch."""
    palette = np.stack(colors)
    shades = palette[rng.integers(len(palette), size=count)] * rng.normal(1.0, 0.14, (count, 1)).astype(np.float32)
    height = np.sqrt(np.clip(edge / np.float32(radius), 0.0, 1.0)) * np.float32(0.7 * radius)
    tilt = rng.normal(0.0, 0.22, count).astype(np.float32)[number]
    light = 1.0 + 0.5 * np.clip(lit(blurred(height, 0.8), angle), -1.2, 1.2) + 0.6 * tilt
    light *= 0.4 + 0.6 * smoothstep(0.0, 0.45 * radius, edge)
    light += 0.06 * value_noise(TEXELS, 256, 1.0, rng)
    picture: Map = shades[number] * np.clip(light, 0.15, 1.35)[:, :, None]
    return picture


def soil(rng: np.random.Generator, look: int) -> Painting:
    """Paint crumbs and clods of earth with pebbles and bits of straw."""
    dark, bright, straw = pick(_SOIL, look, rng)
    angle = rng.uniform(0.0, 2 * np.pi)
    height = 5.0 * value_noise(TEXELS, 16, 0.8, rng)
    for side, big in ((90, 2.6), (200, 1.4)):
        clods = cells(TEXELS, side, 1.0, rng)
        size = np.maximum(rng.normal(0.1, 0.6, clods.count), 0.0).astype(np.float32)
        height += big * per_cell_values(clods, size) * np.sqrt(clods.edge)
    slope = np.clip(lit(blurred(height, 0.7), angle), -2.5, 2.5)
    share = 0.5 + 0.16 * value_noise(TEXELS, 16, 0.85, rng) + 0.22 * slope
    picture = mixed(dark, bright, np.clip(share, -0.4, 1.3))
    pebbles = cells(TEXELS, 150, 1.0, rng)
    chosen = per_cell_values(pebbles, rng.random(pebbles.count, np.float32)) < 0.025
    stone = straw * (0.85 + 0.12 * np.clip(lit(2.0 * blurred(np.sqrt(pebbles.edge), 0.7), angle), -2, 2))[:, :, None]
    picture = mixed(picture, stone, 0.8 * chosen * smoothstep(0.5, 2.2, pebbles.edge))
    slow = patches(rng, 0.10, (0.72, 0.70, 0.66), rng.uniform(0.3, 0.9))
    return Painting(leveled(picture, 8), rng.uniform(2.6, 4.0), slow, 0.14)


def sand(rng: np.random.Generator, look: int) -> Painting:
    """Paint fine sand, rippled by wind or trodden, with darker grains."""
    shade, light, grain = pick(_SAND, look, rng)
    angle = rng.uniform(0.0, 2 * np.pi)
    height = 7.0 * value_noise(TEXELS, 16, 0.55, rng)
    if rng.random() < 0.5:
        y = np.arange(TEXELS, dtype=np.float32)[:, None] * np.float32(2 * np.pi * 28 / TEXELS)
        height += (
            3.0 * np.sin(y + 1.6 * value_noise(TEXELS, 8, 0.45, rng)) * (0.6 + 0.3 * value_noise(TEXELS, 8, 0.5, rng))
        )
    share = 0.55 + 0.28 * np.clip(lit(height, angle), -1.5, 1.5) + 0.13 * value_noise(TEXELS, 128, 1.2, rng)
    share += 0.10 * value_noise(TEXELS, 16, 0.9, rng)
    picture = mixed(shade, light, share)
    specks = value_noise(TEXELS, 256, 1.0, rng) + 0.4 * value_noise(TEXELS, 16, 0.7, rng)
    picture = mixed(picture, grain, 0.6 * smoothstep(1.5, 2.6, specks))
    slow = patches(rng, 0.09, (0.86, 0.84, 0.80), rng.uniform(0.2, 0.6))
    return Painting(leveled(picture, 8), rng.uniform(2.4, 3.6), slow, 0.10)
