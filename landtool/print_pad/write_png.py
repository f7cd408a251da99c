"""A sheet as PNG: square pixels of a stated size, edges where they belong to a fraction of a pixel."""

from __future__ import annotations

import math
from collections.abc import Iterator
from io import BytesIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from landtool.errors import UsageError
from landtool.geometry import Array
from landtool.pad import BLACK, WHITE, Color
from landtool.print_pad.sheet import Disc, Picture, Sheet, Text
from landtool.tone import srgb_decode, srgb_encode

DPI_RANGE = (36, 2400)
MAX_PIXELS = 200_000_000
_STRIP_PX = 128  # rows painted at once, so that the fine picture need not be held whole
_FINE = 4  # samples a pixel, each way; `_averaged` counts on four
_SHIFT = 8  # binary digits of a coordinate behind the point, for OpenCV


def write_png(sheet: Sheet, dpi: int) -> bytes:
    """Return the sheet as an RGB PNG that states its resolution.

    A PNG counts whole pixels a metre; the scale drawn is exactly the one stated. Edges are averaged in linear light.
    Raises UsageError for more than MAX_PIXELS.
    """
    px_per_m = round(dpi / 0.0254)
    scale = px_per_m / 1000.0
    # rounded, not up: a picture one pixel wider than the paper tempts a printer to shrink it
    width, height = round(sheet.width_mm * scale), round(sheet.height_mm * scale)
    if width * height > MAX_PIXELS:
        best = math.floor(dpi * math.sqrt(MAX_PIXELS / (width * height)))
        hint = f"lower --dpi to {best} or write an .svg" if best >= DPI_RANGE[0] else "write an .svg"
        raise UsageError(f"{width} x {height} pixels are too many", hint=hint)
    image = np.empty((height, width, 3), np.uint8)
    shapes = [item for item in (*sheet.picture, *sheet.margin) if not isinstance(item, Text)]
    for top, strip in _strips(shapes, scale, (height, width)):
        image[top : top + strip.shape[0]] = strip
    picture = Image.fromarray(image)
    _write_texts(picture, [item for item in sheet.margin if isinstance(item, Text)], scale)
    file = BytesIO()
    # Pillow turns the exact number of pixels an inch back into whole pixels a metre
    picture.save(file, "png", dpi=(px_per_m * 0.0254, px_per_m * 0.0254))
    return file.getvalue()


def _strips(shapes: list[Picture], scale: float, size: tuple[int, int]) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield the picture in strips (rows, W, 3) RGB with the row they begin at."""
    height, width = size
    palette: list[Color] = [WHITE, BLACK, *{shape.color for shape in shapes} - {WHITE, BLACK}]
    polygons = [(_fine_polygons(shape, scale * _FINE), palette.index(shape.color)) for shape in shapes]
    for top in range(0, height, _STRIP_PX):
        rows = min(_STRIP_PX, height - top)
        fine = np.zeros((rows * _FINE, width * _FINE), np.uint8)
        for parts, index in polygons:
            for points in parts:
                _fill(fine, points - (0.0, top * _FINE), index)
        yield top, _averaged(fine, palette)


def _fine_polygons(shape: Picture, scale: float) -> list[Array]:
    """Return a shape's polygons in samples, whose centres are at whole numbers."""
    if isinstance(shape, Disc):
        # so many sides that a chord leaves the circle by less than 1/100 sample
        sides = max(64, math.ceil(math.pi / math.sqrt(0.02 / (shape.radius * scale))))
        angle = np.arange(sides) * (2.0 * math.pi / sides)
        circle = np.column_stack([np.cos(angle), np.sin(angle)]) * shape.radius + (shape.x, shape.y)
        return [circle * scale - 0.5]
    return [polygon * scale - 0.5 for polygon in shape.polygons]


def _fill(fine: NDArray[np.uint8], points: Array, index: int) -> None:
    low, high = points.min(axis=0)[1], points.max(axis=0)[1]
    if high >= -1 and low <= fine.shape[0]:
        fixed = np.rint(points * 2**_SHIFT).astype(np.int32)
        cv2.fillPoly(fine, [fixed], index, cv2.LINE_8, _SHIFT)


def _averaged(fine: NDArray[np.uint8], palette: list[Color]) -> NDArray[np.uint8]:
    """Return the mean colour of each pixel's samples: a half-covered pixel sends half the light."""
    rows, columns = fine.shape[0] // _FINE, fine.shape[1] // _FINE
    samples = fine.reshape(rows, _FINE, columns, _FINE)
    colors = np.array(palette, np.uint8)
    image: NDArray[np.uint8] = colors[samples[:, 0, :, 0]]
    # four samples side by side read as one number: mixed where one of the four rows is not four times the first one
    fours = fine.view(np.uint32).reshape(rows, _FINE, columns)
    row, column = np.nonzero((fours != samples[:, :1, :, 0] * np.uint32(0x01010101)).any(axis=1))
    light = srgb_decode(colors / 255.0)[samples[row, :, column, :].reshape(len(row), _FINE**2)].mean(axis=1)
    image[row, column] = np.rint(srgb_encode(light) * 255.0).astype(np.uint8)
    return image


def _write_texts(picture: Image.Image, texts: list[Text], scale: float) -> None:
    draw = ImageDraw.Draw(picture)
    for text in texts:
        font = ImageFont.load_default(text.size_mm * scale)
        place = (text.x * scale, text.y * scale)
        draw.text(place, text.text, BLACK, font, anchor="ms" if text.anchor == "middle" else "ls")
