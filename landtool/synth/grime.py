"""Grime, stains, scratches and folds on flat things, as a colour and a coverage for every place."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Field = NDArray[np.float32]

_SIDE = 512
# amplitude of a noise field falls with frequency to this power
_CLOUDY, _PATCHY, _GRAINY = 2.6, 1.5, 0.9
_VARIANTS = 2
_FIELD_SIDE = 1024
_TREAD, _TREAD_LONG = 64, 896  # texels of a tyre's print before it is enlarged, longer than any diagonal then

# albedos, linear light, blue first: what soils a print
_DUST = np.array([0.17, 0.21, 0.24])
_RUST = np.array([0.03, 0.07, 0.14])
_RUBBER = np.array([0.035, 0.035, 0.036])
_METAL = np.array([0.42, 0.41, 0.40])
_DARK = np.array([0.06, 0.065, 0.07])


def grime(rng: Generator, dirtiness: float) -> Field:
    """Return what lies on a surface that is clean at dirtiness 0 and filthy at 1.

    (512, 512, 4) float32, linear light: albedo times coverage, blue first, and the coverage.
    """
    layers = [_mottled(rng, dirtiness)]
    for chance, layer in ((0.5, _water_stain), (0.25, _tyre_mark), (0.4, _smudges)):
        if rng.random() < chance * dirtiness * 1.5:
            layers.append(layer(rng))
    painted = _stacked(layers)
    _draw_lines(painted, rng, dirtiness)
    return painted


def soil_picture(picture: NDArray[np.uint8], rng: Generator, dirtiness: float) -> None:
    """Dirty and scratch a picture (n, n, 4) uint8 of at most 512 a side, sRGB blue first and coverage, in place."""
    n = picture.shape[0]
    cover = _ramp(noise(rng, _PATCHY, 0.8, n), 1.0 - 0.65 * dirtiness, float(rng.uniform(0.05, 0.3)))
    cover *= np.float32(rng.uniform(0.15, 0.55) * math.sqrt(dirtiness))
    cover += noise(rng, _GRAINY, 0.8, n) * np.float32(0.12 * dirtiness)
    dirt = np.empty((n, n, 3), np.float32)
    cv2.rectangle(
        dirt, (0, 0), (n, n), tuple(rng.uniform(70, 130) * rng.uniform((0.8, 0.93, 1.0), (1.0, 1.0, 1.07))), cv2.FILLED
    )
    colors = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGRA2BGR), dtype=np.float32)
    colors = np.asarray(cv2.blendLinear(colors, dirt, 1.0 - cover, cover))
    soiled = np.asarray(colors, dtype=np.uint8)
    for _ in range(rng.poisson(2.0 * dirtiness)):
        line = np.rint(_scratch(rng) * 8.0).astype(np.int32)
        cv2.polylines(soiled, [line], False, (float(rng.uniform(40, 220)),) * 3, 1, cv2.LINE_AA, 4)
    picture[:, :, :3] = soiled


def wear_off(picture: NDArray[np.uint8], rng: Generator) -> None:
    """Rub paint off in patches: lower the coverage of a picture (n, n, 4) of at most 512 a side, in place."""
    n = picture.shape[0]
    left = _ramp(noise(rng, _GRAINY, 0.8, n), float(rng.uniform(-0.3, 0.45)), 0.25)
    cover = picture[:, :, 3] * left
    picture[:, :, 3] = cover


def noise(rng: Generator, falloff: float, zoom: float, size: int = _SIDE) -> Field:
    """Return a (size, size) float32 field, about evenly spread between 0 and 1.

    falloff: power with which its detail gets weaker with frequency. zoom: size of its features, 0.6 or more.
    """
    field = _noise_field(falloff, int(rng.integers(_VARIANTS)))
    side = min(round(size / zoom), _FIELD_SIDE)
    x, y = rng.integers(0, _FIELD_SIDE - side + 1, 2)
    window = field[y : y + side, x : x + side]
    turned = cv2.flip(cv2.transpose(window), 0) if rng.random() < 0.5 else window
    return np.asarray(cv2.resize(turned, (size, size), interpolation=cv2.INTER_LINEAR), dtype=np.float32)


@lru_cache(maxsize=16)
def _noise_field(falloff: float, variant: int) -> Field:
    """Return Gaussian noise of this spectrum, its values spread evenly over 0 to 1."""
    rng = np.random.default_rng([variant, round(falloff * 100)])
    n = _FIELD_SIDE
    frequency = np.hypot(np.fft.rfftfreq(n)[None, :], np.fft.fftfreq(n)[:, None])
    frequency = np.maximum(frequency, 3.0 / n)
    values = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * frequency**-falloff)
    values = (values - values.mean()) / values.std()
    # the logistic function is within 0.01 of the normal distribution's
    field: Field = (1.0 / (1.0 + np.exp(-1.702 * values))).astype(np.float32)
    return field


Layer = tuple[Field, NDArray[np.float64]]


def _mottled(rng: Generator, dirtiness: float) -> Layer:
    """Ragged patches of dust over a faint veil."""
    patches = noise(rng, _PATCHY, float(rng.uniform(0.6, 1.5)))
    start = 1.0 - dirtiness * rng.uniform(0.25, 0.7)
    cover = _ramp(patches, start, float(rng.uniform(0.04, 0.3)))
    cover *= np.float32(rng.uniform(0.15, 0.5) * math.sqrt(dirtiness))
    cover += noise(rng, _GRAINY, 1.0) * np.float32(0.10 * dirtiness)
    if rng.random() < 0.4:
        cover += noise(rng, _CLOUDY, 1.0) * np.float32(0.2 * dirtiness * rng.random())
    return cover, _tinted(rng, _DUST) * rng.uniform(0.15, 1.0)


def _water_stain(rng: Generator) -> Layer:
    """What dried: a tinted pool with a darker rim."""
    pool = noise(rng, _CLOUDY, float(rng.uniform(0.8, 1.6)))
    level = float(rng.uniform(0.6, 0.85))
    cover = _ramp(pool, level, 0.01) * np.float32(rng.uniform(0.02, 0.10))
    off = (pool - np.float32(level + 0.006)) * np.float32(140.0)
    # no rim beyond four widths; smaller values would be denormal, and slow
    cover += np.asarray(cv2.exp(np.maximum(-off * off, np.float32(-16.0)))) * np.float32(rng.uniform(0.1, 0.3))
    return cover, _tinted(rng, _RUST if rng.random() < 0.5 else _DUST)


def _tyre_mark(rng: Generator) -> Layer:
    """The print of a tyre's tread, worn in patches."""
    tread = np.zeros((_TREAD, _TREAD_LONG), np.float32)
    pitch, lean = int(rng.integers(14, 26)), int(rng.integers(-10, 11))
    for x in range(-40, _TREAD_LONG + 40, pitch):
        for top in range(2, _TREAD, 16):
            slope = lean if (top // 16) % 2 else -lean
            corners = np.array(
                [[x, top], [x + pitch - 4, top], [x + pitch - 4 + slope, top + 12], [x + slope, top + 12]]
            )
            cv2.fillConvexPoly(tread, corners.astype(np.int32), (1.0,), cv2.LINE_AA)
    turn, size = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(1.1, 1.9)
    c, s = size * math.cos(turn), size * math.sin(turn)
    centre, target = np.array([_TREAD_LONG / 2.0, _TREAD / 2.0]), rng.uniform(0.2, 0.8, 2) * _SIDE
    linear = np.array([[c, -s], [s, c]])
    matrix = np.column_stack([linear, target - linear @ centre])
    cover = np.asarray(cv2.warpAffine(tread, matrix, (_SIDE, _SIDE)), dtype=np.float32)
    cover *= _ramp(noise(rng, _PATCHY, 1.0), float(rng.uniform(0.1, 0.5)), 0.5) * np.float32(rng.uniform(0.15, 0.55))
    return cover, _tinted(rng, _RUBBER)


def _smudges(rng: Generator) -> Layer:
    """A few dark drops and rubbed spots."""
    spots = np.zeros((_SIDE, _SIDE), np.float32)
    for _ in range(int(rng.integers(3, 30))):
        radius = min(1.0 + rng.exponential(4.0), 30.0)
        value = float(rng.uniform(0.2, 0.7))
        axes = (max(1, round(radius)), max(1, round(radius * rng.uniform(0.4, 1.0))))
        cv2.ellipse(spots, _point(rng.uniform(0, _SIDE, 2)), axes, float(rng.uniform(0, 180)), 0, 360, (value,), -1)
    return np.asarray(cv2.blur(spots, (3, 3)), dtype=np.float32), _tinted(rng, _DARK)


def _stacked(layers: list[Layer]) -> Field:
    """Return the layers, the first at the bottom, as one (512, 512, 4)."""
    shown = [np.clip(cover, 0.0, 0.95) for cover, _ in layers]
    for i in range(len(shown) - 1):
        for upper in shown[i + 1 :]:
            shown[i] = shown[i] * (1.0 - upper)
    channels = [shown[0] * np.float32(weight) for weight in (*layers[0][1], 1.0)]
    for cover, (_, color) in zip(shown[1:], layers[1:], strict=True):
        for channel, weight in zip(channels, (*color, 1.0), strict=True):
            channel += cover * np.float32(weight)
    return np.asarray(cv2.merge(channels), dtype=np.float32)


def _draw_lines(painted: Field, rng: Generator, dirtiness: float) -> None:
    """Scratch and fold the surface, in place."""
    for _ in range(rng.poisson(5.0 * dirtiness)):
        bare = rng.random() < 0.35
        cover = float(rng.uniform(0.2, 0.75))
        _stroke(painted, _scratch(rng), _tinted(rng, _METAL if bare else _DARK), cover, 1)
    if rng.random() < 0.35 * dirtiness:
        for _ in range(int(rng.integers(1, 4))):
            _fold(painted, rng)


def _fold(painted: Field, rng: Generator) -> None:
    """A crease from side to side: a dark line beside a bright one."""
    middle, along = rng.uniform(0.15, 0.85, 2) * _SIDE, rng.choice([0.0, math.pi / 2.0]) + rng.normal(0.0, 0.06)
    way = np.array([math.cos(along), math.sin(along)])
    line = middle + np.array([[-2.0], [2.0]]) * _SIDE * way
    cover = float(rng.uniform(0.1, 0.35))
    _stroke(painted, line, _DARK, cover, 1)
    _stroke(painted, line + [-1.5 * way[1], 1.5 * way[0]], np.full(3, 0.9), cover, 1)


def _scratch(rng: Generator) -> NDArray[np.float64]:
    """Return a nearly straight line (4, 2)."""
    start, along = rng.uniform(0, _SIDE, 2), rng.uniform(0.0, 2.0 * math.pi)
    bends = along + np.cumsum(rng.normal(0.0, 0.08, 3))
    steps = min(float(rng.exponential(90.0)) + 15.0, 500.0) / 3.0 * np.column_stack([np.cos(bends), np.sin(bends)])
    line: NDArray[np.float64] = np.concatenate([start[None], start + np.cumsum(steps, axis=0)])
    return line


def _stroke(painted: Field, line: NDArray[np.float64], albedo: NDArray[np.float64], cover: float, width: int) -> None:
    # anti-aliased drawing needs 8 bits, so the line is drawn as a mask where it runs
    low = np.clip(np.floor(line.min(axis=0)).astype(int) - 2, 0, _SIDE)
    high = np.clip(np.ceil(line.max(axis=0)).astype(int) + 3, 0, _SIDE)
    if (high <= low).any():
        return
    mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
    cv2.polylines(mask, [np.rint((line - low) * 16.0).astype(np.int32)], False, (255,), width, cv2.LINE_AA, 4)
    rows, columns = np.nonzero(mask)
    share = mask[rows, columns, None] * np.float32(cover / 255.0)
    rows, columns = rows + low[1], columns + low[0]
    painted[rows, columns] += share * (np.append(albedo, 1.0).astype(np.float32) - painted[rows, columns])


def _ramp(field: Field, start: float, width: float) -> Field:
    """Return 0 below `start`, 1 above `start + width`, and a straight slope between."""
    ramp = (field - np.float32(start)) * np.float32(1.0 / width)
    return np.clip(ramp, 0.0, 1.0, out=ramp)


def _tinted(rng: Generator, albedo: NDArray[np.float64]) -> NDArray[np.float64]:
    tinted: NDArray[np.float64] = albedo * rng.uniform(0.7, 1.35) * rng.uniform(0.92, 1.08, 3)
    return tinted


def _point(xy: NDArray[np.float64] | NDArray[np.int64]) -> tuple[int, int]:
    return round(float(xy[0])), round(float(xy[1]))
