"""How a printed pad looks: its colours, what soils it, how it shines, and how its paper bends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from landtool.geometry import Array
from landtool.pad import BLACK, WHITE, Color, PadSpec
from landtool.synth.grime import grime
from landtool.synth.mesh import Albedo
from landtool.tone import srgb_decode

Map = NDArray[np.float32]
Rays = Sequence[Map]
_STEEPEST = math.tan(math.radians(12.0))
_SMALLEST = 8  # texels a side of the coarsest level of the dirt
_NEVER_SEEN = 60.0  # exponents of the glare below minus this are no light


@dataclass(frozen=True)
class Curl:
    """How a sheet lies: bent about a line through its middle, and its corners lifted; never below the board.

    half_m: half its side. bend: slope that the bending reaches half a side away from the middle. along_rad: from the
    pad's x to the direction in which it bends. lifts: slopes that the corners at (+x, +y), (-x, +y), (-x, -y) and
    (+x, -y) reach. reach: where a corner begins to lift, as a share of the way to it, at least 0.5.
    """

    half_m: float
    bend: float = 0.0
    along_rad: float = 0.0
    lifts: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    reach: float = 0.6

    def height_m(self, x_m: ArrayLike, y_m: ArrayLike) -> NDArray[np.floating]:
        """Return the height over the board at places (any shape) of the pad frame, metres."""
        x, y = np.asarray(x_m), np.asarray(y_m)
        along = math.cos(self.along_rad) * x + math.sin(self.along_rad) * y
        height = along * along * (self.bend / (2.0 * self.half_m))
        for lift, past in self._lifted(x, y):
            height += past * past * (lift / (2.0 * (1.0 - self.reach) * self._corner_m))
        return np.asarray(height)

    def slopes(self, x_m: ArrayLike, y_m: ArrayLike) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return how the height changes along the pad's x and its y, at places (any shape) in metres."""
        x, y = np.asarray(x_m), np.asarray(y_m)
        c, s = math.cos(self.along_rad), math.sin(self.along_rad)
        slope = (c * x + s * y) * (self.bend / self.half_m)
        dx, dy = c * slope, s * slope
        for i, (lift, past) in enumerate(self._lifted(x, y)):
            steep = past * (lift / ((1.0 - self.reach) * self._corner_m * math.sqrt(2.0)))
            sx, sy = _CORNERS[i]
            dx, dy = dx + sx * steep, dy + sy * steep
        return dx, dy

    @property
    def _corner_m(self) -> float:
        return self.half_m * math.sqrt(2.0)

    def _lifted(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> list[tuple[float, NDArray[np.floating]]]:
        """Return each corner's lift and how far towards it a place lies past the line where it begins, metres."""
        start = self.reach * self._corner_m
        towards = [(sx * x + sy * y) * (1.0 / math.sqrt(2.0)) - start for sx, sy in _CORNERS]
        return [(lift, np.maximum(past, 0.0)) for lift, past in zip(self.lifts, towards, strict=True)]


_CORNERS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))


@dataclass(frozen=True, eq=False)
class Sheet:
    """How a printed pad looks.

    paper, ring, ink, black: albedos of the board, the ring, the H and the tag, linear light, blue first. dirt:
    (512, 512, 4) float32 as `grime` gives it, its columns along the pad's -y, its rows along -x; None on a clean one.
    gloss: share of light that is mirrored, 0.04 on a lacquered print. roughness: 0.1 mirrors the sun as a spot, 0.6
    as a veil. curl: None lies flat.
    """

    paper: Albedo
    ring: Albedo
    ink: Albedo
    black: Albedo
    dirt: Map | None = None
    gloss: float = 0.0
    roughness: float = 0.4
    curl: Curl | None = None

    @property
    def bent(self) -> bool:
        """Whether the sheet does not lie flat."""
        return self.curl is not None

    def height_m(self, x_m: ArrayLike, y_m: ArrayLike) -> NDArray[np.floating]:
        """Return z of the sheet at places x, y (any shape) of the pad frame, metres; 0 where it lies flat."""
        if self.curl is None:
            return np.zeros(np.broadcast(x_m, y_m).shape, np.result_type(x_m, y_m, np.float32))
        return self.curl.height_m(x_m, y_m)

    def blend(self, color: Map, u: Map, v: Map, footprint: float) -> Map:
        """Lay the dirt over colours (h, w, 3) float32, linear light, in place, and return them.

        u, v: (h, w) float32 across the board, 0 to 1 along its columns and its rows. footprint: share of the board's
        side that one pixel spans.
        """
        if self.dirt is None:
            return color
        level = math.floor(math.log2(max(footprint * self.dirt.shape[0], 1.0)) + 0.5)
        texels = self._levels[min(level, len(self._levels) - 1)]
        n, half = np.float32(texels.shape[0]), np.float32(0.5)
        dirt = cv2.remap(texels, u * n - half, v * n - half, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        shows = np.float32(1.0) - np.asarray(cv2.extractChannel(dirt, 3))
        cv2.multiply(color, cv2.merge((shows, shows, shows)), dst=color)
        cv2.add(color, cv2.cvtColor(dirt, cv2.COLOR_BGRA2BGR), dst=color)
        return color

    @cached_property
    def _levels(self) -> tuple[Map, ...]:
        """The dirt, and it averaged over ever more texels."""
        assert self.dirt is not None  # asked for by `blend` only
        levels = [self.dirt]
        while (n := levels[-1].shape[0]) > _SMALLEST:
            half = cv2.resize(levels[-1], (n // 2, n // 2), interpolation=cv2.INTER_AREA)
            levels.append(np.asarray(half, dtype=np.float32))
        return tuple(levels)


def clean_sheet(pad: PadSpec) -> Sheet:
    """Return the pad as it is drawn: its exact colours, nothing on it, flat."""
    return Sheet(*_drawn(pad))


def random_sheet(
    rng: Generator, pad: PadSpec, *, dirtiness: float, curled: bool = False, glossy: bool = False
) -> Sheet:
    """Return a print as a printer, the sun and the street leave it. dirtiness: 0 to 1, how much of it at most."""
    drawn = [np.array(color) for color in _drawn(pad)]
    white = rng.uniform(0.55, 0.9) * np.array([rng.uniform(0.86, 1.04), 1.0, rng.uniform(0.97, 1.05)])
    black = rng.uniform(0.02, 0.07) * rng.uniform(0.9, 1.1, 3)
    # ink is never quite black, paper never quite white
    paper, ring, ink, tag = (black + color * (np.minimum(white, 0.95) - black) for color in drawn)
    ring = _faded_ink(rng, drawn[1] * rng.uniform(0.7, 1.15) * white + 0.2 * black, paper)
    return Sheet(
        _albedo(paper), _albedo(ring), _albedo(ink), _albedo(tag * rng.uniform(0.8, 1.0)),
        dirt=grime(rng, dirtiness * rng.uniform(0.15, 1.0)) if dirtiness > 0.0 else None,
        gloss=float(rng.uniform(0.015, 0.05)) if glossy else float(rng.uniform(0.0, 0.01)),
        roughness=float(rng.uniform(0.12, 0.4)) if glossy else float(rng.uniform(0.4, 0.6)),
        curl=random_curl(rng, pad.extent_m / 2.0) if curled else None,
    )  # fmt: skip


def random_curl(rng: Generator, half_m: float) -> Curl:
    """Return how a sheet of half a side `half_m` may lie; nowhere on it is it steeper than 12 degrees."""
    along = float(rng.uniform(0.0, math.pi))
    # the corner farthest along the bend is this many half sides away
    farthest = abs(math.cos(along)) + abs(math.sin(along))
    bend = float(_STEEPEST * rng.uniform(0.0, 0.6) / farthest)
    left = _STEEPEST - bend * farthest
    lifts = left * rng.uniform(0.0, 1.0, 4) * (rng.random(4) < 0.5)
    one, two, three, four = (float(lift) for lift in lifts)
    return Curl(half_m, bend, along, (one, two, three, four), float(rng.uniform(0.52, 0.8)))


def glare(normal: ArrayLike, rays: Rays, sun_direction: ArrayLike, roughness: float) -> Map:
    """Return how brightly the sun shines back from a surface of gloss 1 (h, w); a white one facing the sun has 1.

    normal: (3,) of the surface. rays: (h, w) x 3 from the camera, of any length, as `View.rays`. sun_direction: (3,)
    to the sun, unit. All in one frame.
    """
    n, sun = np.asarray(normal, dtype=np.float64), np.asarray(sun_direction, dtype=np.float64)
    facing = float(n @ sun)
    if facing <= 0.0:
        return np.zeros(rays[0].shape, np.float32)
    shininess = 2.0 / roughness**4
    hx, hy, hz = _halfway(rays, sun)
    above = np.float32(n[0]) * hx + np.float32(n[1]) * hy + np.float32(n[2]) * hz
    above /= np.asarray(cv2.sqrt(hx * hx + hy * hy + hz * hz))
    # Blinn-Phong: (p + 8) / 8 (n h)^p (n s); (n h)^p is about exp(-p (1 - n h)) where it is not nothing
    lobe = cv2.exp(np.maximum(np.float32(shininess) * (above - np.float32(1.0)), np.float32(-_NEVER_SEEN)))
    return np.asarray(lobe, dtype=np.float32) * np.float32((shininess + 8.0) / 8.0 * facing)


def _halfway(rays: Rays, sun: Array) -> tuple[Map, ...]:
    """Return directions (h, w) x 3 halfway between the sun and the camera, not of unit length."""
    dx, dy, dz = rays
    inverse = np.float32(1.0) / np.asarray(cv2.sqrt(dx * dx + dy * dy + dz * dz))
    return tuple(np.asarray(np.float32(s) - d * inverse, dtype=np.float32) for s, d in zip(sun, rays, strict=True))


def _drawn(pad: PadSpec) -> tuple[Albedo, Albedo, Albedo, Albedo]:
    """Return the albedos of board, ring, H and tag as the pad states them."""
    parts = (pad.board, pad.ring, pad.letter)
    board, ring, letter = (_decoded(part.color if part else WHITE) for part in parts)
    return board, ring, letter, _decoded(BLACK)


def _decoded(color: Color) -> Albedo:
    return _albedo(srgb_decode(np.array(color[::-1]) / 255.0))


def _faded_ink(rng: Generator, ink: Array, paper: Array) -> Array:
    """Return an ink bleached towards the paper, and turned in hue as pigments go at different rates."""
    leak = rng.uniform(0.0, 1.0, 3) ** 2 * [0.05, 0.06, 0.0] * float(ink.max())
    fade = 0.35 * rng.random() ** 3
    faded: Array = (ink + leak) * (1.0 - fade) + paper * fade
    return faded


def _albedo(values: ArrayLike) -> Albedo:
    blue, green, red = (float(v) for v in np.clip(np.asarray(values, dtype=np.float64), 0.0, 1.0))
    return blue, green, red
