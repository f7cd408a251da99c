"""What all painters of grounds share: the picture they hand over, colours, slow patches, grain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.synth.grounds.noise import Cells, smoothstep, value_noise
from landtool.synth.grounds.texture import GroundTexture, Map, color_atlas, factor_atlas

TEXELS = 1024
PATCH_TEXELS = 512
_GRAINS = 512
_GRAIN_TILE_M = 0.256
# an odd share of a tile, so that patches and tiles do not repeat together
_PATCH_TILES = 21.37
_MIDDLE = 0.5

Rgb = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Painting:
    """A ground as painted.

    picture: (1024, 1024, 3) sRGB albedo in [0, 1], blue first, tileable. tile_m: its side. patches: (512, 512, 3)
    factors on light. patch_tiles: tiles that the patches span. roughness: standard deviation of the grain.
    """

    picture: Map
    tile_m: float
    patches: Map
    roughness: float
    patch_tiles: float = _PATCH_TILES

    def texture(self, kind: str, rng: np.random.Generator) -> GroundTexture:
        """Return the ground made of it."""
        encoded = np.asarray(np.clip(self.picture, 0.0, 1.0) * 255.0 + 0.5, dtype=np.uint8)
        grain = 1.0 + np.float32(self.roughness) * value_noise(_GRAINS, 64, 0.85, rng)
        return GroundTexture(
            kind=kind,
            detail=color_atlas(encoded),
            patches=factor_atlas(self.patches),
            grain=factor_atlas(grain),
            tile_m=self.tile_m,
            patch_tiles=self.patch_tiles,
            grain_tile_m=_GRAIN_TILE_M,
        )


def color(rgb: Rgb) -> Map:
    """Return (3,) float32 in [0, 1], blue first, of red, green, blue in 0 to 255."""
    return np.array(rgb[::-1], np.float32) / np.float32(255.0)


def pick(palettes: tuple[tuple[Rgb, ...], ...], look: int, rng: np.random.Generator) -> list[Map]:
    """Return the colours of palette `look`, counted round, a little brighter or warmer than written, or less."""
    chosen = palettes[look % len(palettes)]
    warmth = rng.normal(0.0, 0.02)
    shift = rng.normal(1.0, 0.06) * np.array([1 - warmth, 1.0, 1 + warmth])
    return [color(rgb) * shift.astype(np.float32) for rgb in chosen]


def mixed(first: Map, second: Map, share: Map) -> Map:
    """Return colours between two, (3,) or (n, n, 3), by a share (n, n), which may run beyond 0 and 1."""
    mix: Map = first + (second - first) * share[:, :, None]
    return mix


def per_cell(stones: Cells, colors: list[Map], spread: float, rng: np.random.Generator) -> Map:
    """Return (n, n, 3): every stone in one of the colours or between two, `spread` brighter or darker."""
    palette = np.stack(colors)
    one, other = (palette[rng.integers(len(palette), size=stones.count)] for _ in range(2))
    share = rng.random((stones.count, 1), np.float32)
    bright = 1.0 + spread * rng.standard_normal((stones.count, 1), np.float32)
    shades = (one + (other - one) * share) * np.maximum(bright, 0.2)
    cell: Map = shades.astype(np.float32)[stones.number]
    return cell


def per_cell_values(stones: Cells, values: Map) -> Map:
    """Return (n, n) of values (count,)."""
    spread: Map = values.astype(np.float32)[stones.number]
    return spread


def patches(
    rng: np.random.Generator, strength: float, tint: Rgb = (1.0, 1.0, 1.0), amount: float = 0.0, first: int = 16
) -> Map:
    """Return (512, 512, 3) slow factors on light: brightness by `strength`, and blotches `amount` of the way to `tint`.

    first: the largest of them, a side of the whole.
    """
    bright = 1.0 + np.float32(strength) * value_noise(PATCH_TEXELS, first, 0.8, rng)
    # what is too wide for a tile and too small for the blotches
    bright += np.float32(_MIDDLE * strength) * value_noise(PATCH_TEXELS, 128, 1.0, rng)
    blotch = smoothstep(0.0, 1.8, value_noise(PATCH_TEXELS, first, 0.8, rng)) * np.float32(amount)
    tinted = mixed(np.ones(3, np.float32), np.array(tint[::-1], np.float32), blotch)
    factors: Map = np.clip(tinted * bright[:, :, None], 0.25, 1.95)
    return factors
