"""The pad as a camera sees it, exactly: every pixel is the mean of the light over its area.

The slow reference: tests and benchmarks measure the generator and the tag reader against it, and the pictures of the
pages are drawn with it. The generator itself draws by `compose`.

Images here are (H, W, 3) float32 linear light in [0, 1], blue first, until `encode` makes 8-bit pictures of them.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool import tone
from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.synth.texture import PadTexture, pad_texture
from landtool.synth.truth import sees_upper_side
from landtool.types import Image

Linear = NDArray[np.float32]
Box = tuple[int, int, int, int]
"""First column, first row, and the column and row after the last."""

# samples a pixel: few enough to be quick where the pad is large, enough for its edges where it is small
_FIBONACCI = (1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233, 377)
_SAMPLES_LARGE, _SAMPLES_SMALL, _SMALL_PX = 55, 89, 160
# at once: what the processor keeps near; a row of cv2.remap ends before 32767
_CHUNK_SAMPLES, _CHUNK_PIXELS = 1 << 16, 1 << 14


def render_pad(
    camera: Camera,
    camera_T_pad: Pose,
    pad: PadSpec | PadTexture,
    *,
    background: Linear | None = None,
    supersample: int | None = None,
    light: float = 1.0,
) -> Linear:
    """Return the pad over `background` (H, W, 3) linear light, black when None; the background is not changed.

    supersample: k * k samples a pixel at least, chosen by the pad's size when None. light: factor on the pad's own
    light. From behind, outside the image or behind the camera nothing is drawn.
    Raises UsageError for a background that is not of the camera's size.
    """
    shape = (camera.height, camera.width, 3)
    if background is not None and background.shape != shape:
        raise UsageError(f"a background of shape {background.shape} is not the camera's {shape}")
    image = np.zeros(shape, np.float32) if background is None else background.astype(np.float32)
    texture = pad if isinstance(pad, PadTexture) else pad_texture(pad)
    box = _texture_box(camera, camera_T_pad, texture.extent_m / 2.0)
    if box is None:
        return image
    samples = _sample_count(box, supersample)
    layer = _sample_pad(camera, camera_T_pad, texture, box, samples)
    x0, y0, x1, y1 = box
    window = image[y0:y1, x0:x1]
    window *= 1.0 - layer[:, :, 3:]
    window += light * layer[:, :, :3]
    return np.clip(image, 0.0, 1.0, out=image)


def encode(
    linear: Linear,
    *,
    blur_sigma_px: float = 0.0,
    noise_sigma: float = 0.0,
    rng: np.random.Generator | None = None,
    curve: Literal["srgb", "linear"] | float = "srgb",
) -> Image:
    """Return the 8-bit picture (H, W, 3) of linear light: lens blur, tone curve, noise, rounding, in this order.

    blur_sigma_px: of a Gaussian on the light. noise_sigma: of Gaussian noise on the encoded values, grey levels,
    independent in each pixel and channel, drawn from `rng`. curve: sRGB, none, or a gamma.
    Raises UsageError for noise without a generator.
    """
    if blur_sigma_px > 0.0:
        linear = np.asarray(cv2.GaussianBlur(linear, (0, 0), blur_sigma_px, borderType=cv2.BORDER_REPLICATE))
    grey = 255.0 * tone.encode(linear, "none" if curve == "linear" else curve)
    if noise_sigma > 0.0:
        if rng is None:
            raise UsageError("noise needs a random generator", hint="pass rng=numpy.random.default_rng(seed)")
        grey = grey + noise_sigma * rng.standard_normal(grey.shape, dtype=np.float32)
    picture: Image = np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)
    return picture


def _sample_pad(camera: Camera, camera_T_pad: Pose, texture: PadTexture, box: Box, samples: int) -> Linear:
    """Return what the camera sees of a pad's upper side, inside a box of the image.

    samples: a pixel, one of the Fibonacci numbers. Returns (h, w, 4) float32 premultiplied light and coverage, zero
    where it is not seen.
    """
    x0, y0, x1, y1 = box
    out = np.zeros((y1 - y0, x1 - x0, texture.levels[0].shape[2]), np.float32)
    if not sees_upper_side(camera_T_pad):
        return out
    flat_out = out.reshape(-1, out.shape[2])
    at, corners = _pixels_seeing(camera, camera_T_pad, texture, box)
    flat = _fill_flat(flat_out, texture, at, corners)
    at, corners = at[~flat], np.compress(~flat, corners, axis=2)
    # texels about as wide as the samples are apart: finer ones would alias, coarser ones blur
    spacing = _footprint(corners) / math.sqrt(samples)
    level = np.clip(np.floor(np.log2(np.maximum(spacing, 1e-9))), 0, len(texture.levels) - 1).astype(int)
    step = min(_CHUNK_SAMPLES // samples, _CHUNK_PIXELS)
    for one in np.unique(level):
        places = np.flatnonzero(level == one)
        for first in range(0, len(places), step):
            part = places[first : first + step]
            flat_out[at[part]] = _mean_light(texture, int(one), np.take(corners, part, axis=2), samples)
    return out


@lru_cache(maxsize=4)
def pixel_corner_rays(camera: Camera) -> Array:
    """Return x/z, y/z (H + 1, W + 1, 2) at the corners of all pixels, NaN where the lens model has no ray there."""
    x, y = np.meshgrid(np.arange(camera.width + 1) - 0.5, np.arange(camera.height + 1) - 0.5)
    pixels = np.column_stack([x.ravel(), y.ravel()])
    flat = camera.normalize(pixels)
    if camera.has_distortion:
        # outside its valid circle a polynomial lens has no inverse and the search ends anywhere
        back = camera.project(np.column_stack([flat, np.ones(len(flat))]))
        flat[~(np.abs(back - pixels) < 1e-3).all(axis=1)] = np.nan
    rays = flat.reshape(camera.height + 1, camera.width + 1, 2)
    rays.setflags(write=False)
    return rays


@lru_cache(maxsize=16)
def sample_weights(samples: int) -> Linear:
    """Return the bilinear weights (n, 4) of n sample places in a pixel, n the Fibonacci number `samples`.

    Columns: the pixel's corners, left to right, top to bottom. The places are a Fibonacci lattice, even in every
    direction, shifted so that it is symmetric about the pixel's centre: an edge is never displaced.
    """
    previous = _FIBONACCI[max(_FIBONACCI.index(samples) - 1, 0)]
    # point i is ((i + 1/2) / n, (g i + c + 1/2) / n mod 1); its mirror image is a point when 2 c = g - 1 mod n
    doubled = previous - 1 if previous % 2 else previous - 1 + samples
    i = np.arange(samples)
    x = (i + 0.5) / samples
    y = (previous * i + doubled / 2.0 + 0.5) / samples % 1.0
    return np.column_stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y]).astype(np.float32)


def _sample_count(box: Box, supersample: int | None) -> int:
    if supersample is None:
        size = max(box[2] - box[0], box[3] - box[1])
        return _SAMPLES_SMALL if size <= _SMALL_PX else _SAMPLES_LARGE
    if not 1 <= supersample <= math.isqrt(_FIBONACCI[-1]):
        raise UsageError(f"supersample = {supersample} is outside 1 to {math.isqrt(_FIBONACCI[-1])}")
    return next(n for n in _FIBONACCI if n >= supersample**2)


def _texture_box(camera: Camera, camera_T_pad: Pose, half_m: float) -> Box | None:
    """Return the part of the image that may show the centred square of side 2 half_m, None for none."""
    if not sees_upper_side(camera_T_pad):
        return None
    along = np.linspace(-half_m, half_m, 33)
    side = np.full_like(along, half_m)
    edges = [(along, side), (along, -side), (side, along), (-side, along)]
    rim = camera_T_pad.apply(np.concatenate([np.column_stack([x, y, 0.0 * x]) for x, y in edges]))
    if (rim[:, 2] <= 1e-6).all():
        return None
    whole = (0, 0, camera.width, camera.height)
    if (rim[:, 2] <= 1e-6).any() or np.hypot(*(rim[:, :2] / rim[:, 2:]).T).max() > _widest(camera):
        # partly behind the camera or where the lens model does not hold: its projection says nothing
        return whole
    pixels = camera.project(rim)
    low, high = np.floor(pixels.min(axis=0) - 1.0).astype(int), np.ceil(pixels.max(axis=0) + 2.0).astype(int)
    x0, y0, x1, y1 = max(low[0], 0), max(low[1], 0), min(high[0], camera.width), min(high[1], camera.height)
    return (int(x0), int(y0), int(x1), int(y1)) if x0 < x1 and y0 < y1 else None


@lru_cache(maxsize=16)
def _widest(camera: Camera) -> float:
    """Return the largest distance of a ray from the optical axis at z = 1 that the image shows."""
    return float(np.sqrt(np.nanmax((pixel_corner_rays(camera) ** 2).sum(axis=2))))


def _pixels_seeing(camera: Camera, camera_T_pad: Pose, texture: PadTexture, box: Box) -> tuple[NDArray[np.intp], Array]:
    """Return the P pixels of a box that see the texture, as places in the flattened box, and their corners.

    The corners (4, 2, P), left to right, top to bottom, are columns and rows of level 0.
    """
    x0, y0, x1, y1 = box
    rays = pixel_corner_rays(camera)[y0 : y1 + 1, x0 : x1 + 1]
    # (x/z, y/z, 1) ~ [r1 r2 t] (X, Y, 1), so its inverse gives (X, Y, 1) / depth: positive in front of the camera
    rotation, t = camera_T_pad.rotation, camera_T_pad.translation
    texel_H_ray = texture.texel_T_pad @ np.linalg.inv(np.column_stack([rotation[:, :2], t]))
    x, y = rays[:, :, 0], rays[:, :, 1]
    column, row, inverse_depth = (h[0] * x + h[1] * y + h[2] for h in texel_H_ray)
    front = inverse_depth > 1e-9
    with np.errstate(invalid="ignore", divide="ignore"):
        nodes = np.stack([column, row]) / np.where(front, inverse_depth, np.nan)
    four = np.stack([nodes[:, :-1, :-1], nodes[:, :-1, 1:], nodes[:, 1:, :-1], nodes[:, 1:, 1:]]).reshape(4, 2, -1)
    low, high = four.min(axis=0), four.max(axis=0)  # NaN where a corner sees nothing
    at = np.flatnonzero(((high > -1.0) & (low < texture.levels[0].shape[0])).all(axis=0))
    return at, np.take(four, at, axis=2)


def _footprint(corners: Array) -> Array:
    """Return the side (P,) of a square with the area of each pixel, corners as above."""
    (along_x, along_y), (across_x, across_y) = corners[3] - corners[0], corners[2] - corners[1]
    footprint: Array = np.sqrt(0.5 * np.abs(along_x * across_y - along_y * across_x))
    return footprint


def _fill_flat(flat_out: Linear, texture: PadTexture, at: NDArray[np.intp], corners: Array) -> NDArray[np.bool_]:
    """Fill the pixels that see one colour only, and return which (P,): most of a large pad needs no sampling."""
    reach = (corners.max(axis=0) - corners.min(axis=0)).max(axis=0)
    centre = corners.mean(axis=0)
    flat = np.zeros(len(at), np.bool_)
    # a pixel no larger than a texel of this level lies within that texel and its neighbours
    level = np.ceil(np.log2(np.maximum(reach, 1.0))).astype(int)
    for one in np.unique(level[level < len(texture.levels)]):
        here = np.flatnonzero(level == one)
        place = np.rint((centre[:, here] + 0.5) / 2.0**one - 0.5).astype(int)
        column, row = np.clip(place, 0, texture.levels[one].shape[0] - 1)
        calm = ~texture.busy[one][row, column]
        flat_out[at[here[calm]]] = texture.levels[one][row[calm], column[calm]] / np.float32(65535.0)
        flat[here[calm]] = True
    return flat


def _mean_light(texture: PadTexture, level: int, corners: Array, samples: int) -> Linear:
    """Return the mean light (P, C) over pixels given by their corners (4, 2, P) in texels of level 0."""
    picture = texture.levels[level]
    corners = (corners + 0.5) / 2.0**level - 0.5
    column, row = (sample_weights(samples) @ corners[:, i].astype(np.float32) for i in (0, 1))
    light = cv2.remap(picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    mean = np.asarray(cv2.reduce(light, 0, cv2.REDUCE_AVG, dtype=cv2.CV_32F), dtype=np.float32)
    return mean.reshape(-1, picture.shape[2]) / np.float32(65535.0)
