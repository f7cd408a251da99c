"""Fog by the haze model: what is far fades into the airlight, in linear light, by the true distance of every pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.errors import UsageError

Map = NDArray[np.float32]

KOSCHMIEDER = 3.912  # -ln 0.02: what stands at the visibility keeps 2 % of its contrast
_CELLS = 4  # of the coarsest octave, a side of the tile of the banks
_TEXELS = 128
_OCTAVES = (1.0, 0.5, 0.25)
_SAMPLES = 5  # along a line of sight
_STRIP = 32  # rows taken at a time, so that what is in between stays in the processor's cache
_STEP = 4  # banks are wide: their mean along the sight is found for every 4th pixel and interpolated


@dataclass(frozen=True)
class Fog:
    """A fog over a level world, thick as the air is over each place (x, y), at any height the same.

    beta_per_m: mean extinction. airlight: linear light of endless fog, blue first. bank_strength: 0 is uniform, at 1
    the density goes from 0 to about 2 times its mean. bank_scale_m: width of a bank. bank_offset_m: (x, y) by which
    the banks have drifted. bank_seed: which banks.

    Raises UsageError for values no fog has.
    """

    beta_per_m: float
    airlight: tuple[float, float, float] = (0.80, 0.80, 0.80)
    bank_strength: float = 0.0
    bank_scale_m: float = 20.0
    bank_offset_m: tuple[float, float] = (0.0, 0.0)
    bank_seed: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.beta_per_m) and self.beta_per_m >= 0.0):
            raise UsageError(f"fog of {self.beta_per_m:g} a metre is not 0 or more")
        if not 0.0 <= self.bank_strength <= 1.0:
            raise UsageError(f"fog banks of strength {self.bank_strength:g} are outside 0 to 1")
        if not (math.isfinite(self.bank_scale_m) and self.bank_scale_m > 0.0):
            raise UsageError(f"fog banks {self.bank_scale_m:g} m wide are not positive")
        if not all(math.isfinite(light) and light >= 0.0 for light in self.airlight):
            raise UsageError(f"airlight {self.airlight} is no light")

    @classmethod
    def of_visibility(
        cls,
        visibility_m: float,
        airlight: tuple[float, float, float] = (0.80, 0.80, 0.80),
        *,
        bank_strength: float = 0.0,
        bank_scale_m: float = 20.0,
        bank_offset_m: tuple[float, float] = (0.0, 0.0),
        bank_seed: int = 0,
    ) -> Fog:
        """Return the fog one can see `visibility_m` far in (Koschmieder); inf is clear air. Errors as the class."""
        if not visibility_m > 0.0:
            raise UsageError(f"a visibility of {visibility_m:g} m is not positive")
        # V = 3.912 / beta
        return cls(KOSCHMIEDER / visibility_m, airlight, bank_strength, bank_scale_m, bank_offset_m, bank_seed)

    @property
    def visibility_m(self) -> float:
        """How far one can see, in metres; inf in clear air."""
        return KOSCHMIEDER / self.beta_per_m if self.beta_per_m else math.inf

    def transmission(
        self,
        distance_m: Map,
        x_m: Map | None = None,
        y_m: Map | None = None,
        camera_xy_m: tuple[float, float] = (0.0, 0.0),
    ) -> Map:
        """Return the share of light (H, W) that gets through: 1 at no distance, 0 at an infinite one.

        distance_m: (H, W) along the sight, inf where there is nothing. x_m, y_m: (H, W) world place of what is seen,
        and camera_xy_m that of the camera: needed for banks, without them the fog is uniform.
        """
        if self.beta_per_m == 0.0:
            return np.isfinite(distance_m).astype(np.float32)
        depth: Map = np.multiply(distance_m, np.float32(-self.beta_per_m), dtype=np.float32)
        if self.bank_strength and x_m is not None and y_m is not None:
            depth *= self._mean_density(x_m, y_m, camera_xy_m)
        # t = exp(-beta d)
        return np.exp(depth, out=depth)

    def apply(self, linear: Map, t: Map) -> Map:
        """Put fog before linear light (H, W, 3), blue first, IN PLACE, and return it.

        t: (H, W) transmission. linear must be contiguous in memory.

        Raises ValueError for light that is not.
        """
        height, width = t.shape
        if not linear.flags.c_contiguous:
            raise ValueError("light in a strided array would be changed in a copy")
        # numpy is fast along long rows only, so three channels are taken as one row of 3 W values
        flat = linear.reshape(height, 3 * width)
        light = np.tile(np.array(self.airlight, np.float32), width)
        for start in range(0, height, _STRIP):
            strip = flat[start : start + _STRIP]
            # I = J t + A (1 - t) = A + (J - A) t
            strip -= light
            strip *= _thrice(t[start : start + _STRIP])
            strip += light
        return linear

    def invert(self, linear: Map, t: Map) -> Map:
        """Return linear light (H, W, 3) without its fog: the inverse of `apply`. Where t is 0 the airlight stays.

        Exact for unrounded light. A picture's rounding error is divided by t.
        """
        height, width = t.shape
        light = np.tile(np.array(self.airlight, np.float32), width)
        with np.errstate(divide="ignore"):
            gain = np.where(t > 0.0, np.float32(1.0) / t, np.float32(0.0))
        # J = A + (I - A) / t
        flat = linear.reshape(height, 3 * width) - light
        flat *= _thrice(gain)
        flat += light
        return flat.reshape(height, width, 3)

    def density(self, x_m: Map, y_m: Map) -> Map:
        """Return the density at world places, (H, W) each, as a multiple of the mean."""
        texel_m = self.bank_scale_m * _CELLS / _TEXELS
        across, down = (
            np.asarray(np.mod((place - offset) / texel_m, _TEXELS), np.float32)
            for place, offset in zip((x_m, y_m), self.bank_offset_m, strict=True)
        )
        waves = cv2.remap(_banks(self.bank_seed), across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        return np.float32(1.0) + np.float32(self.bank_strength) * np.asarray(waves, np.float32)

    def _mean_density(self, x_m: Map, y_m: Map, camera_xy_m: tuple[float, float]) -> Map:
        """Return the mean density (H, W) between the camera and each place."""
        height, width = x_m.shape
        every = slice(min(_STEP // 2, height - 1, width - 1), None, _STEP)
        # what is nowhere is not seen through any fog: any place will do
        x, y = (np.nan_to_num(place[every, every], posinf=0.0, neginf=0.0) for place in (x_m, y_m))
        total = np.zeros_like(x)
        for share in (np.arange(_SAMPLES, dtype=np.float32) + np.float32(0.5)) / np.float32(_SAMPLES):
            from_x, from_y = (np.float32(c) for c in camera_xy_m)
            total += self.density(from_x + share * (x - from_x), from_y + share * (y - from_y))
        mean = cv2.resize(total / np.float32(_SAMPLES), (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(mean, np.float32)


def _thrice(values: Map) -> Map:
    """Return values (H, W) as (H, 3 W), each one three times."""
    height, width = values.shape
    return np.asarray(cv2.merge((values, values, values)), np.float32).reshape(height, 3 * width)


@lru_cache(maxsize=8)
def _banks(seed: int) -> Map:
    """Return smooth noise (texels, texels) in [-1, 1], of mean 0, that tiles the plane."""
    rng = np.random.default_rng(seed)
    total = np.zeros((_TEXELS, _TEXELS), np.float32)
    for octave, strength in enumerate(_OCTAVES):
        cells = _CELLS * 2**octave
        values = np.pad(rng.uniform(-1.0, 1.0, (cells, cells)).astype(np.float32), 3, mode="wrap")
        texels = _TEXELS // cells
        size = (cells + 6) * texels
        smooth = np.asarray(cv2.resize(values, (size, size), interpolation=cv2.INTER_CUBIC), np.float32)
        total += np.float32(strength) * smooth[3 * texels : -3 * texels, 3 * texels : -3 * texels]
    total -= total.mean()
    total /= np.abs(total).max()
    total.setflags(write=False)
    return total
