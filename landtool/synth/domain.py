"""What generated pictures vary in: every range and every share, as a user may set them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import get_type_hints

import numpy as np

from landtool.errors import UsageError

Range = tuple[float, float]
"""Least and greatest value."""


@dataclass(frozen=True)
class Domain:
    """Ranges (least, greatest) and shares of the pictures in [0, 1]; a share of 0 switches its subject off.

    Raises UsageError for a range that is reversed or holds what cannot be, and for a share outside [0, 1].
    """

    # height of the camera over the pad, metres for D = 1 m, drawn evenly in its logarithm
    height_m: Range = (0.3, 30.0)
    # optical axis against straight down
    tilt_deg: Range = (0.0, 45.0)
    hfov_deg: Range = (50.0, 100.0)
    # pictures with lens distortion, and its first coefficient
    distortion: float = 0.6
    distortion_k1: Range = (-0.30, 0.08)
    # pictures without the pad; those of them, and of the others, that show similar signs
    absent: float = 0.15
    signs_without_pad: float = 0.5
    signs_with_pad: float = 0.35
    # pads cut by the border on purpose, and the least share of a pad that is in the picture
    cut: float = 0.2
    least_visible: float = 0.2
    # pads that lie on a vehicle, on a box, on a table or deck; the rest lies on the ground
    on_vehicle: float = 0.45
    on_box: float = 0.15
    on_deck: float = 0.10
    # pads that are a small print: all around them is larger by a factor
    small_print: float = 0.15
    small_print_scale: Range = (3.0, 7.0)
    # grounds that are photographs, of pictures made with any
    photographs: float = 0.35
    # contrast of the ground's texture, 1 as it was made
    relief: Range = (0.9, 1.8)
    # other things in the picture, bodies on the mean
    things: float = 4.5
    # something on or over the pad that hides a part of it
    occlusion: float = 0.12
    # state of the print: 0 is new
    dirt: Range = (0.0, 1.0)
    curl: float = 0.2
    gloss: float = 0.25
    # light: overcast skies, the sun's height, and how bright a white level surface is in the picture (1 saturates)
    overcast: float = 0.3
    sun_elevation_deg: Range = (4.0, 75.0)
    light: Range = (0.25, 2.6)
    vignette: Range = (0.0, 0.35)
    white_balance: float = 0.12
    # shadows of trees and poles that fall across the pad, and of the drone
    shadow: float = 0.25
    drone_shadow: float = 0.3
    # fog: its pictures, visibility (drawn evenly in its logarithm), and those with banks
    fog: float = 0.25
    visibility_m: Range = (8.0, 400.0)
    fog_banks: float = 0.3
    # camera: defocused pictures and the radius, moved ones and the length of the blur, rolling shutters
    defocus: float = 0.12
    defocus_px: Range = (0.5, 2.5)
    motion_blur: float = 0.3
    motion_blur_px: Range = (0.5, 8.0)
    rolling_shutter: float = 0.25
    # noise of a white pixel and of a black one, standard deviations of linear light
    shot_noise: Range = (0.004, 0.05)
    read_noise: Range = (0.0005, 0.008)
    bayer: float = 0.7
    # pictures whose tone curve strays from sRGB's, in exponent, contrast and saturation
    tone: float = 0.8
    # pictures enlarged from a smaller one, and how much smaller that was
    rescaled: float = 0.12
    rescale: Range = (0.45, 0.9)
    sharpen: Range = (0.0, 1.0)
    jpeg_quality: Range = (55.0, 97.0)

    def __post_init__(self) -> None:
        hints = get_type_hints(type(self), include_extras=True)
        for field in fields(self):
            value = getattr(self, field.name)
            if hints[field.name] == Range:
                _check_range(field.name, value)
            elif field.name not in ("things", "white_balance") and not 0.0 <= value <= 1.0:
                raise UsageError(f"{field.name} = {value:g} is no share", hint="give 0 to 1")
        if not 0.0 <= self.things <= 50.0:
            raise UsageError(f"things = {self.things:g} is impossible", hint="give 0 to 50")
        if not 0.0 <= self.white_balance <= 0.5:
            raise UsageError(f"white_balance = {self.white_balance:g} is impossible", hint="give 0 to 0.5")
        if self.on_vehicle + self.on_box + self.on_deck > 1.0 + 1e-9:
            raise UsageError("on_vehicle, on_box and on_deck add up to more than 1", hint="the rest is on the ground")
        if self.least_visible < 0.05:
            raise UsageError(f"least_visible = {self.least_visible:g} is too little to be a pad", hint="give 0.05 to 1")


# what the ends of a range may be, where more than its order matters
_BOUNDS: dict[str, Range] = {
    "height_m": (0.05, 1000.0),
    "tilt_deg": (0.0, 60.0),
    "hfov_deg": (10.0, 120.0),
    "distortion_k1": (-0.5, 0.5),
    "small_print_scale": (1.0, 20.0),
    "dirt": (0.0, 1.0),
    "sun_elevation_deg": (1.0, 90.0),
    "relief": (0.1, 5.0),
    "light": (0.01, 10.0),
    "vignette": (0.0, 0.9),
    "visibility_m": (1.0, 1e5),
    "defocus_px": (0.0, 10.0),
    "motion_blur_px": (0.0, 40.0),
    "shot_noise": (0.0, 0.2),
    "read_noise": (0.0, 0.1),
    "rescale": (0.1, 1.0),
    "sharpen": (0.0, 3.0),
    "jpeg_quality": (1.0, 100.0),
}


def _check_range(name: str, value: Range) -> None:
    low, high = value
    if not (math.isfinite(low) and math.isfinite(high)):
        raise UsageError(f"{name} = {low:g} to {high:g} is not finite")
    if low > high:
        raise UsageError(f"{name} = {low:g} to {high:g} is reversed", hint=f"write [{high:g}, {low:g}]")
    least, most = _BOUNDS[name]
    if low < least or high > most:
        raise UsageError(f"{name} = {low:g} to {high:g} is impossible", hint=f"stay within {least:g} to {most:g}")


def uniform(rng: np.random.Generator, range_: Range) -> float:
    """Return a value drawn evenly."""
    return float(rng.uniform(*range_))


def log_uniform(rng: np.random.Generator, range_: Range) -> float:
    """Return a positive value drawn evenly in its logarithm."""
    return float(np.exp(rng.uniform(math.log(range_[0]), math.log(range_[1]))))


def chance(rng: np.random.Generator, share: float) -> bool:
    """Return whether something that happens in this share of the pictures happens in this one."""
    return bool(rng.random() < share)
