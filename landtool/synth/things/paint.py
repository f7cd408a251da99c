"""Colours of things, as albedos: linear light, blue first."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from landtool.synth.mesh import Albedo

Rgb = tuple[int, int, int]

# how often cars have a colour, and what it is in sRGB: half of all are white, grey or black
_CARS: tuple[tuple[float, Rgb], ...] = (
    (0.20, (232, 232, 228)), (0.10, (176, 178, 180)), (0.12, (98, 102, 106)), (0.14, (26, 27, 29)),
    (0.12, (36, 62, 138)), (0.05, (72, 118, 168)), (0.09, (168, 26, 28)), (0.05, (52, 84, 58)),
    (0.05, (222, 108, 30)), (0.03, (206, 176, 44)), (0.05, (196, 182, 150)),
)  # fmt: skip
_CLOTHES: tuple[Rgb, ...] = (
    (230, 230, 228), (30, 32, 38), (48, 62, 100), (90, 92, 96), (168, 30, 40), (40, 110, 70), (120, 40, 130),
    (226, 180, 30), (210, 236, 60), (240, 110, 30), (140, 110, 84), (90, 140, 190), (220, 150, 170),
)  # fmt: skip
_SKIN: tuple[Rgb, ...] = ((238, 204, 180), (214, 168, 136), (170, 120, 86), (110, 74, 52), (70, 48, 36))
_HAIR: tuple[Rgb, ...] = ((24, 20, 18), (58, 40, 28), (104, 72, 40), (196, 160, 96), (150, 148, 146))
_WOOD: tuple[Rgb, ...] = (
    (206, 164, 106),
    (176, 128, 78),
    (146, 104, 66),
    (120, 96, 74),
    (226, 200, 150),
    (136, 128, 118),
)
_SIGNAL: tuple[Rgb, ...] = ((232, 92, 24), (214, 36, 30), (236, 190, 30), (40, 84, 170), (34, 120, 70), (240, 240, 236))
_PLAIN: tuple[Rgb, ...] = ((150, 152, 152), (92, 94, 96), (46, 48, 50), (220, 220, 216), (128, 120, 104), (70, 78, 60))


def srgb(rgb: Rgb, gain: float = 1.0) -> Albedo:
    """Return the albedo of an sRGB colour (0 to 255, red first), times a gain."""
    r, g, b = (min(gain * _linear(c / 255.0), 0.92) for c in rgb)
    return (b, g, r)


def dimmed(albedo: Albedo, gain: float) -> Albedo:
    """Return the albedo times a gain, at most 0.92."""
    b, g, r = (min(gain * a, 0.92) for a in albedo)
    return (b, g, r)


def car_paint(rng: Generator) -> Albedo:
    """Return a car's colour, as often as cars have it."""
    shares = np.array([share for share, _ in _CARS])
    return _vary(rng, _CARS[int(rng.choice(len(_CARS), p=shares / shares.sum()))][1])


def clothes(rng: Generator) -> Albedo:
    """Return the colour of a garment."""
    return _vary(rng, _CLOTHES[int(rng.integers(len(_CLOTHES)))])


def skin(rng: Generator) -> Albedo:
    """Return a colour of skin."""
    return _vary(rng, _SKIN[int(rng.integers(len(_SKIN)))])


def hair(rng: Generator) -> Albedo:
    """Return a colour of hair."""
    return _vary(rng, _HAIR[int(rng.integers(len(_HAIR)))])


def wood(rng: Generator) -> Albedo:
    """Return the colour of a board, fresh or weathered."""
    return _vary(rng, _WOOD[int(rng.integers(len(_WOOD)))])


def signal(rng: Generator) -> Albedo:
    """Return a loud colour, as of cones, barrels and machines."""
    return _vary(rng, _SIGNAL[int(rng.integers(len(_SIGNAL)))])


def plain(rng: Generator) -> Albedo:
    """Return the colour of metal, plastic or concrete."""
    return _vary(rng, _PLAIN[int(rng.integers(len(_PLAIN)))])


def glass(rng: Generator) -> Albedo:
    """Return the colour of a car's window: dark, more or less of the sky in it."""
    return srgb((44, 54, 62), float(rng.uniform(0.3, 2.5)))


def rubber(rng: Generator) -> Albedo:
    """Return the colour of a tyre, clean or dusty."""
    return srgb((38, 37, 36), float(rng.uniform(0.5, 2.0)))


def _vary(rng: Generator, rgb: Rgb) -> Albedo:
    gain = float(rng.uniform(0.75, 1.2))
    b, g, r = srgb(rgb)
    tint = rng.uniform(0.93, 1.07, 3)
    return (min(gain * tint[0] * b, 0.92), min(gain * tint[1] * g, 0.92), min(gain * tint[2] * r, 0.92))


def _linear(value: float) -> float:
    return float(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4)
