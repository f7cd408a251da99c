"""Pictures made different before they are learnt from: parts, sizes, mirror images, mosaics, colours, bad weather.

Everything draws from the generator of random numbers it is handed, so that a picture can be made again.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from landtool.geometry import Array
from landtool.synth.motion_blur import line_kernel
from landtool.synth.sensor import Linear, develop, jpeg_round_trip, lens_blur, noisy
from landtool.tone import linear_lut
from landtool.train.samples import Example
from landtool.train.settings import TrainSettings
from landtool.types import Image

GREY = 114  # of borders, as letterboxing has it
# A target with less than this share of its box left in the picture, or smaller than this, is not learnt
_LEAST_SHARE = 0.5
_LEAST_SIDE_PX = 7.0
# The deepest cells see 318 pixels: a target beyond that is left to the look at half size
_MOST_SIDE_PX, _FOR_HALF_SIZE_PX = 330.0, 400.0
_INSIDE = 0.35  # share of those that are shown at full size all the same: what is seen inside of a pad is no pad
_TOWARDS_TARGET = 0.75  # share of the parts that show a target, where there is one
_MOST_OF_SIDE = 0.9  # of the part's side that a target may take before the part is shown smaller


def whole(example: Example, width: int, height: int, settings: TrainSettings, rng: np.random.Generator) -> Example:
    """Return the whole picture at a network's size, shrunk or moved a little, borders grey."""
    rows, columns = example.image.shape[:2]
    fit = min(width / columns, height / rows)
    scale = fit * math.exp(rng.uniform(-1.0, 0.2) * math.log(settings.zoom)) if rng.random() < 0.5 else fit
    room = width / scale - columns, height / scale - rows
    x, y = (-free * (rng.random() if scale != fit else 0.5) for free in room)
    return mirrored(_window(example, x, y, scale, (width, height), settings.pyramid), settings.flip, rng)


def part(example: Example, width: int, height: int, settings: TrainSettings, rng: np.random.Generator) -> Example:
    """Return a part of the picture at about its own scale, with a target in it more often than not."""
    rows, columns = example.image.shape[:2]
    scale = math.exp(rng.normal(0.0, 0.5 * math.log(settings.zoom)))
    towards = len(example.boxes) > 0 and rng.random() < _TOWARDS_TARGET
    box = example.boxes[rng.integers(len(example.boxes))] if towards else None
    if box is not None:
        side = float(max(box[2] - box[0], box[3] - box[1]))
        is_inside = settings.pyramid and scale * side > _FOR_HALF_SIZE_PX and rng.random() < _INSIDE
        scale = scale if is_inside else min(scale, _MOST_OF_SIDE * min(width, height) / side)
    scale = max(scale, min(width / columns, height / rows))  # no more border than one way
    across, down = width / scale, height / scale
    x = _start(columns, across, None if box is None else (box[0], box[2]), rng)
    y = _start(rows, down, None if box is None else (box[1], box[3]), rng)
    return mirrored(_window(example, x, y, scale, (width, height), settings.pyramid), settings.flip, rng)


def four(examples: list[Example], width: int, height: int, rng: np.random.Generator) -> Example:
    """Return four pictures of that size in one, each the corner of its own place, met at a random point."""
    middle_x, middle_y = (round(side * rng.uniform(0.3, 0.7)) for side in (width, height))
    image = np.empty((height, width, 3), np.uint8)
    parts = []
    for index, example in enumerate(examples):
        left, top = (0, middle_x)[index % 2], (0, middle_y)[index // 2]
        right, bottom = (middle_x, width)[index % 2], (middle_y, height)[index // 2]
        x, y = (
            int(rng.integers(0, side - (high - low) + 1))
            for side, low, high in ((width, left, right), (height, top, bottom))
        )
        image[top:bottom, left:right] = example.image[y : y + bottom - top, x : x + right - left]
        cut = clipped(example, (x, y, x + right - left, y + bottom - top))
        parts.append(Example(image, cut.boxes + np.array([left - x, top - y] * 2), cut.labels, cut.ignored))
    joined = [np.concatenate([getattr(p, name) for p in parts]) for name in ("boxes", "labels", "ignored")]
    return Example(image, *joined)


def clipped(example: Example, window: tuple[float, float, float, float]) -> Example:
    """Return the same picture with its boxes cut to a window; what is hardly left is ignored, what is gone is gone."""
    low, high = np.array(window[:2] * 2), np.array(window[2:] * 2)
    boxes = np.clip(example.boxes, low, high)
    size, old = boxes[:, 2:] - boxes[:, :2], example.boxes[:, 2:] - example.boxes[:, :2]
    share = size.prod(axis=1) / np.maximum(old.prod(axis=1), 1e-9)
    ignored = example.ignored | (share < _LEAST_SHARE) | (size.max(axis=1, initial=0.0) < _LEAST_SIDE_PX)
    there = (size > 0.5).all(axis=1)
    return Example(example.image, boxes[there], example.labels[there], ignored[there])


def without_largest(example: Example) -> Example:
    """Return the example for a network that sees the largest targets at half size: in full they are none.

    In between either answer is right, so they are ignored. Call it before targets are cut by a window.
    """
    side = (example.boxes[:, 2:] - example.boxes[:, :2]).max(axis=1, initial=0.0)
    kept = side <= _FOR_HALF_SIZE_PX
    ignored = example.ignored | (side > _MOST_SIDE_PX)
    return Example(example.image, example.boxes[kept], example.labels[kept], ignored[kept])


def mirrored(example: Example, share: float, rng: np.random.Generator) -> Example:
    """Return the picture mirrored left to right, top to bottom, both or not at all."""
    image, boxes = example.image, example.boxes.copy()
    for axis, side in ((1, image.shape[1]), (0, image.shape[0])):
        if rng.random() < share:
            image = np.asarray(cv2.flip(image, axis), np.uint8)
            low, high = (0, 2) if axis == 1 else (1, 3)
            boxes[:, [low, high]] = side - boxes[:, [high, low]]
    return Example(image, boxes, example.labels, example.ignored)


def recoloured(image: Image, settings: TrainSettings, rng: np.random.Generator) -> Image:
    """Return the picture with hue, saturation and exposure changed at random, as darknet does."""
    turn = rng.uniform(-settings.hue, settings.hue) * 180.0
    saturation, exposure = (
        math.exp(rng.uniform(-math.log(most), math.log(most))) for most in (settings.saturation, settings.exposure)
    )
    steps = np.arange(256)
    table = np.empty((256, 1, 3), np.uint8)
    table[:, 0, 0] = (steps + turn) % 180.0  # OpenCV counts hue to 180
    table[:, 0, 1] = np.clip(steps * saturation, 0, 255)
    table[:, 0, 2] = np.clip(steps * exposure, 0, 255)
    changed = cv2.LUT(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), table)
    return np.asarray(cv2.cvtColor(changed, cv2.COLOR_HSV2BGR), np.uint8)


def degraded(image: Image, rng: np.random.Generator) -> Image:
    """Return the picture in fog, blurred, noisy or badly compressed: what the generator does, done to a picture."""
    light: Linear = np.asarray(cv2.LUT(image, linear_lut("srgb")), np.float32)
    if rng.random() < 0.35:
        # I = J t + A (1 - t)
        t = rng.uniform(0.15, 0.8)
        light *= np.float32(t)
        light += ((1.0 - t) * rng.uniform(0.25, 0.9) * np.exp(rng.normal(0.0, 0.06, 3))).astype(np.float32)
    if rng.random() < 0.35:
        angle, length = rng.uniform(0.0, math.pi), rng.uniform(1.0, 7.0)
        kernel = line_kernel((length * math.cos(angle), length * math.sin(angle)))
        light = np.asarray(cv2.filter2D(light, -1, kernel), np.float32)
    elif rng.random() < 0.3:
        light = lens_blur(light, rng.uniform(0.4, 1.3), 0.0)
    if rng.random() < 0.6:
        light = noisy(light, rng.uniform(0.005, 0.05) ** 2, rng.uniform(0.001, 0.01) ** 2, rng)
    worse = develop(light)
    return jpeg_round_trip(worse, int(rng.integers(35, 95))) if rng.random() < 0.6 else worse


def _start(length: int, window: float, span: Array | tuple[float, float] | None, rng: np.random.Generator) -> float:
    """Return where a window begins: within the picture if it fits, over the span if one is given."""
    low, high = min(0.0, length - window), max(0.0, length - window)
    if span is not None:
        # all of the target: from its end at the window's end to its start at the window's start
        low, high = (min(max(edge, low), high) for edge in (span[1] - window, span[0]))
    return float(rng.uniform(min(low, high), max(low, high)))


def _window(example: Example, x: float, y: float, scale: float, size: tuple[int, int], pyramid: bool) -> Example:
    """Return the window that begins at (x, y) of the picture, shown `scale` times as large, of that size in pixels."""
    image = example.image
    if scale < 0.8:
        # averaged over the pixels that fall into one, as a camera farther away would
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        fx, fy = small.shape[1] / image.shape[1], small.shape[0] / image.shape[0]
    else:
        small, fx, fy = image, 1.0, 1.0
    # continuous edges: u = (x' - x) scale; pixel centres lie half a pixel inside
    sx, sy = scale / fx, scale / fy
    matrix = np.array([[sx, 0.0, 0.5 * sx - 0.5 - x * scale], [0.0, sy, 0.5 * sy - 0.5 - y * scale]])
    grey = (GREY, GREY, GREY)
    shown = cv2.warpAffine(small, matrix, size, flags=cv2.INTER_LINEAR, borderValue=grey)
    boxes = (example.boxes - np.array([x, y, x, y])) * scale
    moved = Example(np.asarray(shown, np.uint8), boxes, example.labels, example.ignored)
    moved = without_largest(moved) if pyramid else moved
    return clipped(moved, (0.0, 0.0, float(size[0]), float(size[1])))
