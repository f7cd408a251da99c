"""Grounds that are no mineral: grass, water, snow."""

from __future__ import annotations

import cv2
import numpy as np

from landtool.synth.grounds.noise import enlarged, leveled, lit, smoothstep, value_noise
from landtool.synth.grounds.painting import TEXELS, Painting, mixed, patches, pick
from landtool.synth.grounds.texture import Bytes, Map

# earth below, then blades from the shade up
_GRASS = (
    ((28, 30, 16), (48, 66, 24), (78, 104, 38), (108, 132, 54), (146, 154, 86)),
    ((28, 36, 18), (48, 78, 32), (72, 108, 44), (98, 136, 62), (130, 156, 88)),
    ((40, 36, 22), (74, 76, 38), (106, 106, 56), (136, 130, 76), (170, 158, 108)),
    ((22, 34, 16), (36, 70, 28), (58, 100, 40), (84, 126, 54), (116, 148, 72)),
)
# deep, sky in it, glint
_WATER = (
    ((18, 44, 50), (96, 128, 140), (226, 234, 238)),
    ((28, 52, 42), (104, 128, 116), (220, 228, 222)),
    ((14, 36, 62), (90, 126, 162), (228, 236, 244)),
    ((58, 60, 46), (128, 132, 116), (224, 224, 214)),
)
# shade, light
_SNOW = (((176, 190, 212), (240, 242, 244)), ((186, 194, 204), (234, 234, 232)), ((168, 182, 206), (230, 236, 242)))
_LAYERS = 10
_SHADES = 14
_BLADES = 230  # a shade and layer
_FRACTION_BITS = 3


def grass(rng: np.random.Generator, look: int) -> Painting:
    """Paint blade over blade, the upper ones brighter, in clumps that lean together."""
    earth, *shades = pick(_GRASS, look, rng)
    canvas = np.empty((TEXELS, TEXELS, 3), np.uint8)
    canvas[:] = np.clip(earth * 255, 0, 255)
    lean = value_noise(64, 8, 0.6, rng) * 1.3 + rng.uniform(0, 2 * np.pi)
    length = rng.uniform(14.0, 34.0)
    for layer in range(_LAYERS):
        for color in _layer_colors(shades, layer / (_LAYERS - 1), rng):
            _draw_blades(canvas, color, lean, length, rng)
    picture = canvas.astype(np.float32) / 255.0
    clumps = 0.08 * value_noise(TEXELS, 32, 0.9, rng)
    picture *= (1.0 + clumps)[:, :, None]
    dry = patches(rng, rng.uniform(0.10, 0.16), (1.32, 1.14, 0.98), rng.uniform(0.2, 1.0), first=32)
    return Painting(leveled(picture, 8), rng.uniform(2.0, 3.2), dry, 0.10)


def _layer_colors(shades: list[Map], up: float, rng: np.random.Generator) -> Map:
    """Return (_SHADES, 3) in 0 to 255 for a layer, 0 at the ground to 1 on top."""
    at = np.clip(up * (len(shades) - 1.6) + rng.normal(0.0, 0.55, _SHADES), 0, len(shades) - 1.001)
    lower = at.astype(np.int64)
    palette = np.stack(shades)
    colors = palette[lower] + (palette[lower + 1] - palette[lower]) * (at - lower)[:, None]
    return (255.0 * colors * rng.normal(1.0, 0.05, (_SHADES, 3))).astype(np.float32)


def _draw_blades(canvas: Bytes, color: Map, lean: Map, length: float, rng: np.random.Generator) -> None:
    """Draw bent strokes of one colour; those over an edge go on at the other side."""
    root = rng.uniform(0, TEXELS, (_BLADES, 2))
    cell = (root * (len(lean) / TEXELS)).astype(np.int64)
    angle = lean[cell[:, 1], cell[:, 0]] + rng.normal(0.0, 0.9, _BLADES)
    reach = length * rng.uniform(0.4, 1.3, _BLADES)
    bend = rng.normal(0.0, 0.5, _BLADES)
    points = [root]
    for turn in (-0.5, 0.5):
        direction = np.stack([np.cos(angle + turn * bend), np.sin(angle + turn * bend)], axis=1)
        points.append(points[-1] + direction * (reach / 2)[:, None])
    strokes = np.stack(points, axis=1)
    fixed = np.round(strokes * (1 << _FRACTION_BITS)).astype(np.int32)
    wrap = np.concatenate([fixed, *_over_the_edge(fixed)])
    paint = tuple(float(value) for value in color)
    cv2.polylines(canvas, list(wrap), False, paint, int(rng.integers(1, 3)), cv2.LINE_AA, _FRACTION_BITS)


def _over_the_edge(
    strokes: np.ndarray[tuple[int, ...], np.dtype[np.int32]],
) -> list[np.ndarray[tuple[int, ...], np.dtype[np.int32]]]:
    size = TEXELS << _FRACTION_BITS
    copies = []
    for axis in (0, 1):
        shift = np.zeros(2, np.int32)
        shift[axis] = size
        copies.append(strokes[strokes[:, :, axis].min(axis=1) < 16] + shift)
        copies.append(strokes[strokes[:, :, axis].max(axis=1) > size - 16] - shift)
    return copies


def water(rng: np.random.Generator, look: int) -> Painting:
    """Paint waves of many lengths that mirror the sky on one side and glint here and there."""
    deep, sky, glint = pick(_WATER, look, rng)
    slope = _waves(rng)
    share = 0.35 + 0.20 * slope + 0.05 * value_noise(TEXELS, 64, 0.8, rng)
    picture = mixed(deep, sky, np.clip(share, 0.0, 1.2))
    picture = mixed(picture, glint, rng.uniform(0.3, 1.0) * smoothstep(1.9, 3.6, slope))
    slow = patches(rng, 0.10, (0.82, 0.86, 0.88), rng.uniform(0.3, 1.0), first=8)
    return Painting(leveled(picture, 4), rng.uniform(5.0, 9.0), slow, 0.02)


def _waves(rng: np.random.Generator) -> Map:
    """Return the slope towards the light of waves about one direction, standard deviation 1."""
    frequency = np.fft.fftfreq(TEXELS, 1.0 / TEXELS).astype(np.float32)
    kx, ky = frequency[None, : TEXELS // 2 + 1], frequency[:, None]
    k = np.hypot(kx, ky)
    k[0, 0] = 1.0
    wind = rng.uniform(0.0, np.pi)
    along = np.abs(kx * np.float32(np.cos(wind)) + ky * np.float32(np.sin(wind))) / k
    # slopes of waves between a peak length and one that capillaries smooth
    peak = rng.uniform(7.0, 14.0)
    strength = k ** np.float32(-1.5) * np.exp(-((peak / k) ** 2) - (k / 150.0) ** 2) * (0.15 + along**2)
    noise = np.fft.rfft2(rng.standard_normal((TEXELS, TEXELS), np.float32))
    slope = np.fft.irfft2(noise * strength * (kx * np.cos(wind) + ky * np.sin(wind)) * 1j, s=(TEXELS, TEXELS))
    # crests are sharper than troughs
    sharp = np.float32(slope / slope.std())
    sharp += 0.25 * (sharp * sharp - 1.0)
    waves: Map = sharp / sharp.std()
    return waves


def snow(rng: np.random.Generator, look: int) -> Painting:
    """Paint soft drifts, bluish on the side away from the light, and the sparkle of crystals."""
    shade, light = pick(_SNOW, look, rng)
    angle = rng.uniform(0.0, 2 * np.pi)
    height = enlarged(14.0 * value_noise(TEXELS // 4, 8, 0.56, rng), TEXELS)
    crust = 1.2 * value_noise(TEXELS, 64, 0.75, rng)
    share = 0.64 + 0.34 * np.clip(lit(height, angle), -2, 2) + 0.16 * np.clip(lit(crust, angle), -2, 2)
    share += 0.04 * value_noise(TEXELS, 256, 1.0, rng)
    picture = mixed(shade, light, share)
    slow = patches(rng, 0.05, (0.86, 0.90, 0.96), rng.uniform(0.3, 1.0))
    return Painting(leveled(picture, 8), rng.uniform(3.0, 5.0), slow, 0.03)
