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

    # height of the camera over the pad, metres for D = 1 m (others scale), drawn evenly in its logarithm; of a tilted
    # camera times the cosine, so that tilt does not make the pad smaller
    height_m: Range = (0.3, 30.0)
    # angle between the optical axis and straight down
    tilt_deg: Range = (0.0, 45.0)
    # horizontal field of view
    hfov_deg: Range = (50.0, 100.0)
    # share of the pictures taken through a lens that distorts
    distortion: float = 0.6
    # its first coefficient (plumb_bob); below 0 is a barrel
    distortion_k1: Range = (-0.30, 0.08)
    # share of the pictures without the pad
    absent: float = 0.15
    # share of those that show one to four similar signs
    signs_without_pad: float = 0.5
    # share of the others that show one to four similar signs
    signs_with_pad: float = 0.35
    # share of the pads that are cut by the picture's border on purpose
    cut: float = 0.2
    # least share of the ring's disc that is inside the picture
    least_visible: float = 0.2
    # share of the pads that lie on a vehicle; what is left of the three lies on the ground
    on_vehicle: float = 0.45
    # share of the pads that lie on a box
    on_box: float = 0.15
    # share of the pads that lie on a table or on a boat's deck
    on_deck: float = 0.10
    # share of the pads that are a small print: everything around them is larger by a factor
    small_print: float = 0.15
    # that factor, drawn evenly in its logarithm
    small_print_scale: Range = (3.0, 7.0)
    # share of the grounds that are photographs, where `backgrounds` gives any
    photographs: float = 0.35
    # contrast of the ground's texture; 1 is as it was made
    relief: Range = (0.9, 1.8)
    # other bodies in the picture, 0 to 50 on the mean; never more than 14
    things: float = 4.5
    # share of the pads that something on or over them hides in part
    occlusion: float = 0.12
    # how dirty and scratched the print is at most: 0 is clean
    dirt: Range = (0.0, 1.0)
    # share of the sheets on the ground whose corners curl up
    curl: float = 0.2
    # share of the sheets that are glossy: the sun glares on them
    gloss: float = 0.25
    # share of the skies that are overcast, without shadows of the sun
    overcast: float = 0.3
    # height of the sun over the horizon
    sun_elevation_deg: Range = (4.0, 75.0)
    # how bright a white level surface is in the picture, 1 saturates; drawn evenly in its logarithm
    light: Range = (0.25, 2.6)
    # loss of light in the picture's corners
    vignette: Range = (0.0, 0.35)
    # most by which the gains of red and blue are off, 0 to 0.5; 0.12 is 12 % up or down
    white_balance: float = 0.12
    # share of the pictures with the shadow of a tree or a pole on or near the pad
    shadow: float = 0.25
    # share of the pictures with the shadow of the drone itself where the sun throws it
    drone_shadow: float = 0.3
    # share of the pictures in fog
    fog: float = 0.25
    # how far one sees in it (contrast 2 %), metres, drawn evenly in its logarithm
    visibility_m: Range = (15.0, 400.0)
    # share of the fogs that are uneven, in banks
    fog_banks: float = 0.3
    # share of the pictures out of focus
    defocus: float = 0.12
    # radius of the disc a point becomes then, pixels
    defocus_px: Range = (0.5, 2.5)
    # share of the pictures blurred by motion
    motion_blur: float = 0.3
    # how far the median pixel of those moves while the shutter is open, pixels
    motion_blur_px: Range = (0.5, 8.0)
    # share of the pictures whose rows are exposed one after another while the camera moves
    rolling_shutter: float = 0.25
    # noise of a white pixel: standard deviation, white is 1 in linear light
    shot_noise: Range = (0.004, 0.05)
    # noise of a black pixel: the same
    read_noise: Range = (0.0005, 0.008)
    # share of the pictures of one colour a pixel, the others interpolated, as most cameras take them
    bayer: float = 0.7
    # share of the pictures whose tone curve strays from sRGB's: in exponent, contrast and saturation
    tone: float = 0.8
    # share of the pictures that are enlarged from a smaller one
    rescaled: float = 0.12
    # size of that smaller one
    rescale: Range = (0.45, 0.9)
    # how strongly the camera sharpens its edges
    sharpen: Range = (0.0, 1.0)
    # quality of the JPEG compression, 1 to 100
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
