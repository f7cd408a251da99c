"""Tone curves: between light as it adds up on the sensor and the numbers stored in a picture."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landtool.errors import UsageError

Values = NDArray[np.floating[Any]]
Tone = Literal["srgb", "none"] | float
"""The curve of a picture: sRGB's, none (the numbers are light), or the exponent of encoded = linear ** (1 / gamma)."""


def srgb_encode(linear: ArrayLike) -> Values:
    """Return sRGB values of linear light, both in [0, 1], any shape; float32 stays float32.

    Light outside [0, 1] is clipped.
    """
    x = np.clip(_floating(linear), 0.0, 1.0)
    # IEC 61966-2-1: 12.92 x below 0.0031308, else 1.055 x^(1/2.4) - 0.055
    encoded: Values = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055).astype(x.dtype)
    return encoded


def srgb_decode(encoded: ArrayLike) -> Values:
    """Return the linear light of sRGB values, both in [0, 1], any shape; the inverse of `srgb_encode`."""
    y = np.clip(_floating(encoded), 0.0, 1.0)
    linear: Values = np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4).astype(y.dtype)
    return linear


def encode(linear: ArrayLike, tone: Tone) -> Values:
    """Return linear light in [0, 1] encoded by `tone`, in [0, 1]. Raises UsageError for a gamma that is no exponent."""
    if tone == "srgb":
        return srgb_encode(linear)
    x: Values = np.clip(_floating(linear), 0.0, 1.0)
    return x if tone == "none" else x ** (1.0 / _gamma(tone))


def decode(encoded: ArrayLike, tone: Tone) -> Values:
    """Return encoded values in [0, 1] as linear light in [0, 1]; the inverse of `encode`, same errors."""
    if tone == "srgb":
        return srgb_decode(encoded)
    y: Values = np.clip(_floating(encoded), 0.0, 1.0)
    return y if tone == "none" else y ** _gamma(tone)


def linear_lut(tone: Tone) -> NDArray[np.float32]:
    """Return the table (256,) float32 from 8-bit values to linear light in [0, 1]. Errors as `encode`."""
    return decode(np.arange(256) / 255.0, tone).astype(np.float32)


def _gamma(tone: str | float) -> float:
    if isinstance(tone, str) or not (math.isfinite(tone) and 0.1 <= tone <= 10.0):
        raise UsageError(f"'{tone}' is no tone curve", hint="give srgb, none or a gamma from 0.1 to 10")
    return float(tone)


def _floating(values: ArrayLike) -> Values:
    array = np.asarray(values)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)


def parse_tone(text: str) -> Tone:
    """Read `srgb`, `none` or a number. Raises UsageError for anything else."""
    if text == "srgb":
        return "srgb"
    if text == "none":
        return "none"
    try:
        gamma = float(text)
    except ValueError:
        return _gamma(text)
    return _gamma(gamma)


def encode_with_slope(linear: NDArray[np.float64], tone: Tone) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return linear light (N,) encoded by `tone`, and the slope of the curve there.

    For fitting: beyond white the value is 1 and the slope 0, as a sensor saturates; into the dark the curve goes on
    as a straight line, where a power law would be infinitely steep.
    """
    if tone == "none":
        encoded, slope = linear, np.ones_like(linear)
    else:
        start, exponent = (0.0031308, 1.0 / 2.4) if tone == "srgb" else (1e-3, 1.0 / _gamma(tone))
        gain, offset = (1.055, 0.055) if tone == "srgb" else (1.0, 0.0)
        base = np.maximum(linear, start)
        power = gain * base**exponent
        slope = exponent * power / base
        encoded = power - offset + slope * (linear - base)
        if tone == "srgb":
            dark = linear < start
            encoded, slope = np.where(dark, 12.92 * linear, encoded), np.where(dark, 12.92, slope)
    return np.minimum(encoded, 1.0), np.where(encoded < 1.0, slope, 0.0)
