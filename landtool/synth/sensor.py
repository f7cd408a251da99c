"""From light on the lens to the numbers of a picture: blur, noise, mosaic and tone of a camera.

Every stage is a function of its own that leaves its input alone; `Sensor.picture` calls them in the order of the light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool import tone
from landtool.errors import OutputError, UsageError
from landtool.types import Image

Linear = NDArray[np.float32]
Raw = NDArray[np.uint16]

WHITE = 65535  # of the 16 bits light is counted in before the tone curve
_BLACK = 2048  # of the mosaic: noise goes below black, and must not be cut off before neighbours are averaged
_BANK = 1 << 20
_NOISY_ROWS = 4  # taken from the same place of it
# luma of linear light, blue first (ITU-R BT.709)
_LUMA = (0.0722, 0.7152, 0.2126)


@dataclass(frozen=True)
class Sensor:
    """A camera's way to make a picture. The default is ideal: the exact sRGB curve and nothing else.

    exposure: gain on light; above 1 the noon burns out. white_balance: gain a channel, blue first. vignette: share of
    light lost in the corners. psf_sigma_px: Gaussian blur of a sharp lens. defocus_radius_px: disc of one out of focus.
    shot_variance, read_variance: noise of variance shot * light + read, light in [0, 1]. bayer: one colour a pixel,
    the others from its neighbours. saturation: 0 is grey, 1 as it was. gamma: exponent on top of sRGB's curve; above 1
    is darker. contrast: share of an S-curve on top of that, in [-1, 1]. sharpen: share of the detail that is added
    again. rescale: factor by which the picture was made small, and enlarged again. jpeg_quality: for the writer, and
    for `jpeg_round_trip`; None keeps every value.

    Raises UsageError for values no camera has.
    """

    exposure: float = 1.0
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignette: float = 0.0
    psf_sigma_px: float = 0.0
    defocus_radius_px: float = 0.0
    shot_variance: float = 0.0
    read_variance: float = 0.0
    bayer: bool = False
    saturation: float = 1.0
    gamma: float = 1.0
    contrast: float = 0.0
    sharpen: float = 0.0
    rescale: float = 1.0
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        for name, low, high in _BOUNDS:
            if not low <= getattr(self, name) <= high:
                raise UsageError(f"{name} = {getattr(self, name):g} of a sensor is outside {low:g} to {high:g}")
        if not all(0.0 < gain < 100.0 for gain in self.white_balance):
            raise UsageError(f"white_balance = {self.white_balance} of a sensor is not positive")
        if self.jpeg_quality is not None and not 1 <= self.jpeg_quality <= 100:
            raise UsageError(f"jpeg_quality = {self.jpeg_quality} is outside 1 to 100")

    def picture(self, linear: Linear, rng: np.random.Generator) -> Image:
        """Return the picture (H, W, 3) BGR uint8 of linear light (H, W, 3), blue first, white at 1."""
        light = lens_blur(linear, self.psf_sigma_px, self.defocus_radius_px)
        light = expose(light, self.exposure, self.white_balance, self.vignette)
        if self.bayer:
            raw = mosaic(light)
            light = demosaic(noisy(raw, self.shot_variance, self.read_variance, rng))
        else:
            light = noisy(light, self.shot_variance, self.read_variance, rng)
        image = develop(saturate(light, self.saturation), self.gamma, self.contrast)
        return rescale(sharpen(image, self.sharpen), self.rescale)


_BOUNDS = (
    ("exposure", 1e-6, 1e6),
    ("vignette", 0.0, 0.99),
    ("psf_sigma_px", 0.0, 20.0),
    ("defocus_radius_px", 0.0, 50.0),
    ("shot_variance", 0.0, 1.0),
    ("read_variance", 0.0, 1.0),
    ("saturation", 0.0, 4.0),
    ("gamma", 0.1, 10.0),
    ("contrast", -1.0, 1.0),
    ("sharpen", 0.0, 5.0),
    ("rescale", 0.05, 1.0),
)


def lens_blur(linear: Linear, psf_sigma_px: float, defocus_radius_px: float) -> Linear:
    """Return light (H, W, 3) as a lens spreads it: a Gaussian, and a disc when it is out of focus."""
    light = linear
    if defocus_radius_px > 0.0:
        light = np.asarray(cv2.filter2D(light, -1, disc(defocus_radius_px), borderType=cv2.BORDER_REFLECT), np.float32)
    if psf_sigma_px > 0.0:
        side = 2 * max(1, math.ceil(3.0 * psf_sigma_px)) + 1
        blurred = cv2.GaussianBlur(light, (side, side), psf_sigma_px, borderType=cv2.BORDER_REFLECT)
        light = np.asarray(blurred, np.float32)
    return light


@lru_cache(maxsize=8)
def disc(radius_px: float) -> Linear:
    """Return the kernel (n, n) of sum 1 of a disc, each value by the share of its pixel inside."""
    reach, fine = math.ceil(radius_px), 8
    steps = (np.arange((2 * reach + 1) * fine) + 0.5) / fine - reach - 0.5
    inside = np.hypot(steps[:, None], steps[None, :]) <= radius_px
    share = inside.reshape(2 * reach + 1, fine, 2 * reach + 1, fine).mean(axis=(1, 3))
    if not share.any():
        share[reach, reach] = 1.0  # a disc smaller than a sample is a point
    return np.asarray(share / share.sum(), np.float32)


def expose(linear: Linear, gain: float, white_balance: tuple[float, float, float], vignette: float) -> Linear:
    """Return light (H, W, 3) times the exposure, each channel's gain, and the fall of light to the corners."""
    if gain == 1.0 and white_balance == (1.0, 1.0, 1.0) and vignette == 0.0:
        return linear
    height, width = linear.shape[:2]
    # numpy is fast along long rows only, so three channels are taken as one row of 3 W values
    gains = np.tile(np.array(white_balance, np.float32) * np.float32(gain), width)
    flat: Linear = linear.reshape(height, 3 * width) * gains
    if vignette > 0.0:
        # cos^4 of an angle whose tangent grows with the distance r from the middle: 1 / (1 + k r^2)^2
        k = 1.0 / math.sqrt(1.0 - vignette) - 1.0
        x, y = (((np.arange(n) + 0.5) / n * 2.0 - 1.0) ** 2 / 2.0 * k for n in (width, height))
        fall = np.repeat(x, 3).astype(np.float32) + (1.0 + y).astype(np.float32)[:, None]
        fall *= fall
        flat /= fall
    return flat.reshape(height, width, 3)


def mosaic(linear: Linear) -> Linear:
    """Return what a sensor of one colour a pixel sees (H, W) of light (H, W, 3): blue at (0, 0), red at (1, 1)."""
    raw = linear[:, :, 1].copy()
    raw[0::2, 0::2] = linear[0::2, 0::2, 0]
    raw[1::2, 1::2] = linear[1::2, 1::2, 2]
    return raw


def demosaic(raw: Linear) -> Linear:
    """Return light (H, W, 3) of a mosaic (H, W) as `mosaic` makes it, the missing colours along the edges."""
    scale = np.float32(WHITE - _BLACK)
    counts = np.clip(raw * scale + np.float32(_BLACK + 0.5), 0.0, WHITE).astype(np.uint16)
    # OpenCV names a mosaic by its second row's second and third pixel: ours, blue first, is its RG
    light: Linear = cv2.cvtColor(counts, cv2.COLOR_BayerRG2BGR_EA).astype(np.float32)
    light -= np.float32(_BLACK)
    light /= scale
    return light


def noisy(light: Linear, shot_variance: float, read_variance: float, rng: np.random.Generator) -> Linear:
    """Return light, any shape from (H, W), as a sensor counts it: full at 1, Gaussian noise of a Poisson's variance."""
    full: Linear = np.minimum(light, np.float32(1.0))
    if shot_variance == 0.0 and read_variance == 0.0:
        return full
    flat = full.reshape(len(full), -1)
    # sigma^2 = a I + b
    sigma = np.maximum(flat, np.float32(0.0))
    sigma *= np.float32(shot_variance)
    sigma += np.float32(read_variance)
    np.sqrt(sigma, out=sigma)
    bank = _noise_bank()
    # to draw a million values costs more than all other stages: rows are taken from random places of a stock of them
    rows = np.array_split(sigma.ravel(), -(-len(sigma) // _NOISY_ROWS))
    starts = rng.integers(0, len(bank) - len(rows[0]), len(rows)).tolist()
    for part, start in zip(rows, starts, strict=True):
        part *= bank[start : start + len(part)]
    sigma += flat
    return sigma.reshape(light.shape)


@lru_cache(maxsize=1)
def _noise_bank() -> Linear:
    """Return many normal values (N,), always the same."""
    values: Linear = np.random.default_rng(20240229).standard_normal(_BANK, np.float32)
    values.setflags(write=False)
    return values


def saturate(linear: Linear, saturation: float) -> Linear:
    """Return light (H, W, 3) with its colours drawn to grey (0), left (1), or made stronger."""
    if saturation == 1.0:
        return linear
    # I' = L + s (I - L), with the luma L
    matrix = saturation * np.eye(3) + (1.0 - saturation) * np.array(_LUMA)
    return np.asarray(cv2.transform(linear, matrix), np.float32)


def develop(linear: Linear, gamma: float = 1.0, contrast: float = 0.0) -> Image:
    """Return the 8-bit picture (H, W, 3) of light, by sRGB's curve and what a camera adds to it.

    Light is first rounded to 16 bits, so a value within 1e-5 of the middle of two grey levels may take either.
    """
    counts = np.clip(linear, 0.0, 1.0)
    counts *= np.float32(WHITE)
    counts += np.float32(0.5)
    return np.asarray(cv2.LUT(counts.astype(np.uint16), tone_table(gamma, contrast)), np.uint8)


@lru_cache(maxsize=8)
def tone_table(gamma: float = 1.0, contrast: float = 0.0) -> Image:
    """Return the grey levels (65536,) uint8 of light in 16 bits."""
    encoded = tone.srgb_encode(np.arange(WHITE + 1) / WHITE) ** gamma
    s_curve = encoded * encoded * (3.0 - 2.0 * encoded)
    table: Image = np.round(255.0 * (encoded + contrast * (s_curve - encoded))).astype(np.uint8)
    table.setflags(write=False)
    return table


def sharpen(image: Image, amount: float) -> Image:
    """Return the picture with `amount` times its fine detail added, as cameras do, halos included."""
    if amount == 0.0:
        return image
    smooth = cv2.GaussianBlur(image, (5, 5), 1.0)
    return np.asarray(cv2.addWeighted(image, 1.0 + amount, smooth, -amount, 0.0), np.uint8)


def rescale(image: Image, factor: float) -> Image:
    """Return the picture made smaller by `factor` and enlarged again to its size."""
    height, width = image.shape[:2]
    small = (max(1, round(width * factor)), max(1, round(height * factor)))
    if small == (width, height):
        return image
    fewer = cv2.resize(image, small, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(fewer, (width, height), interpolation=cv2.INTER_CUBIC), np.uint8)


def jpeg_round_trip(image: Image, quality: int | None) -> Image:
    """Return the picture (H, W, 3) BGR uint8 as JPEG keeps it; None keeps it whole. Raises OutputError."""
    if quality is None:
        return image
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise OutputError(f"a picture of shape {image.shape} cannot be encoded as JPEG")
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)
