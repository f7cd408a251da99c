"""Scenes of patches, and fog put before them in linear light."""

from __future__ import annotations

import numpy as np

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.tone import srgb_encode
from landtool.types import Image

AIR = np.array([0.42, 0.40, 0.38])


def patches(seed: int, height: int = 120, width: int = 160) -> Array:
    """Linear light (height, width, 3): overlapping rectangles of all brightnesses and tints, with some texture."""
    rng = np.random.default_rng(seed)
    light = np.full((height, width, 3), 0.15)
    for _ in range(40):
        top, left = rng.integers(0, height), rng.integers(0, width)
        down, across = rng.integers(4, height // 3), rng.integers(4, width // 3)
        albedo = np.exp(rng.uniform(np.log(0.01), np.log(0.8))) * rng.uniform(0.6, 1.0, 3)
        light[top : top + down, left : left + across] = albedo
    return np.asarray(np.clip(light * np.exp(0.15 * rng.standard_normal((height, width, 1))), 0.0, 1.0))


def fogged(light: Array, transmission: float) -> Array:
    """I = J t + A (1 - t)."""
    return np.asarray(light * transmission + AIR * (1.0 - transmission))


def developed(light: Array, noise: float = 0.0, rng: np.random.Generator | None = None) -> Image:
    """The sRGB picture of a light, with noise of so many grey levels in each colour."""
    values = 255.0 * srgb_encode(light)
    if rng is not None:
        values = values + noise * rng.standard_normal(values.shape)
    return np.asarray(np.rint(np.clip(values, 0.0, 255.0)), np.uint8)


def hazy_picture(seed: int, transmission: float = 0.5, height: int = 120, width: int = 160) -> Image:
    return developed(fogged(patches(seed, height, width), transmission))


def drawn_fog(count: int, size: tuple[int, int] = (160, 120)) -> list[Image]:
    """Pictures of the generator, all with fog. It lets thick fog underflow to nothing."""
    with np.errstate(under="ignore"):
        return [make_sample(Domain(fog=1.0), PadSpec(), size, 7, index).image for index in range(count)]
