"""A square to paint signs on: flat shapes with smooth edges, in coordinates from -1 to 1."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

Picture = NDArray[np.uint8]
"""(256, 256, 4) uint8: sRGB albedo, blue first, and coverage."""
Color = tuple[int, int, int]
"""sRGB, blue first."""

SIDE = 256
_FINE = 512  # drawn anti-aliased at twice the size
_SHIFT = 4

WHITE: Color = (238, 240, 240)
BLACK: Color = (24, 22, 22)
RED: Color = (34, 28, 200)
BLUE: Color = (165, 75, 20)
YELLOW: Color = (30, 190, 240)
GREEN: Color = (70, 130, 20)
ORANGE: Color = (25, 105, 235)
GREY: Color = (120, 120, 120)
PURPLE: Color = (120, 40, 95)


class Canvas:
    """A picture in the making. x runs right, y down, the picture spans -1 to 1; nothing covers it at first."""

    def __init__(self, around: Color = WHITE) -> None:
        """around: what mixes into the colours at the outer edges of what will be painted."""
        self._fine: Picture = np.zeros((_FINE, _FINE, 4), np.uint8)
        cv2.rectangle(self._fine, (0, 0), (_FINE, _FINE), (*around, 0), cv2.FILLED)

    def picture(self) -> Picture:
        """Return what was painted."""
        return np.asarray(cv2.resize(self._fine, (SIDE, SIDE), interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def disc(self, x: float, y: float, radius: float, color: Color) -> None:
        """Fill a circle."""
        centre = _fixed(np.array([[x, y]]))[0]
        size = round(radius * _FINE / 2.0 * (1 << _SHIFT))
        cv2.circle(self._fine, (int(centre[0]), int(centre[1])), size, (*color, 255), cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def ring(self, outer: float, inner: float, color: Color, inside: Color) -> None:
        """Fill a circle about the middle, and another inside it."""
        self.disc(0.0, 0.0, outer, color)
        self.disc(0.0, 0.0, inner, inside)

    def arc(self, outer: float, inner: float, start_rad: float, end_rad: float, color: Color) -> None:
        """Fill the part of a ring about the middle between two angles, clockwise from the right."""
        angle = np.linspace(start_rad, end_rad, max(4, math.ceil(abs(end_rad - start_rad) * 12)))
        way = np.column_stack([np.cos(angle), np.sin(angle)])
        self.polygon(np.concatenate([outer * way, inner * way[::-1]]), color)

    def polygon(self, points: ArrayLike, color: Color) -> None:
        """Fill a polygon (N, 2)."""
        cv2.fillPoly(self._fine, [_fixed(np.asarray(points, dtype=np.float64))], (*color, 255), cv2.LINE_AA, _SHIFT)

    def rect(self, left: float, top: float, right: float, bottom: float, color: Color) -> None:
        """Fill an upright rectangle."""
        self.polygon([[left, top], [right, top], [right, bottom], [left, bottom]], color)

    def square(self, half: float, color: Color) -> None:
        """Fill a square about the middle."""
        self.rect(-half, -half, half, half, color)

    def bar(self, start: Sequence[float], end: Sequence[float], width: float, color: Color) -> None:
        """Draw a straight bar with square ends."""
        a, b = np.array(start, dtype=np.float64), np.array(end, dtype=np.float64)
        across = np.array([a[1] - b[1], b[0] - a[0]]) * (width / 2.0 / float(np.hypot(*(b - a))))
        self.polygon([a + across, b + across, b - across, a - across], color)

    def line(self, points: ArrayLike, width: float, color: Color) -> None:
        """Draw a line with round corners through points (N, 2)."""
        fixed = _fixed(np.asarray(points, dtype=np.float64))
        thick = max(1, round(width * _FINE / 2.0))
        cv2.polylines(self._fine, [fixed], False, (*color, 255), thick, cv2.LINE_AA, _SHIFT)

    def text(self, text: str, x: float, y: float, height: float, color: Color, *, weight: int = 600) -> None:
        """Write a line of capitals or digits `height` tall, its middle at (x, y), no wider than the picture."""
        face = cv2.FontFace("sans")
        # capitals stand 0.71 of the size asked for
        size = max(6, round(height * _FINE / 2.0 / 0.71))
        width = _text_width(text, face, size, weight)
        if width > 0.92 * _FINE:
            size = max(6, int(size * 0.92 * _FINE / width))
            width = _text_width(text, face, size, weight)
        left = round((x + 1.0) * _FINE / 2.0 - width / 2.0)
        base = round((y + 1.0) * _FINE / 2.0 + 0.71 * size / 2.0)
        cv2.putText(self._fine, text, (left, base), (*color, 255), face, size, weight)

    def modules(self, white: NDArray[np.bool_], x: float, y: float, half: float, dark: Color, light: Color) -> None:
        """Draw a square of modules (n, n), True where light, about (x, y)."""
        low = [round((v - half + 1.0) * _FINE / 2.0) for v in (x, y)]
        side = round(half * _FINE)
        colors = np.where(white[:, :, None], np.array([*light, 255]), np.array([*dark, 255])).astype(np.uint8)
        large = cv2.resize(colors, (side, side), interpolation=cv2.INTER_NEAREST)
        part = self._fine[max(low[1], 0) : low[1] + side, max(low[0], 0) : low[0] + side]
        part[:] = large[: part.shape[0], : part.shape[1]]

    def letter_h(self, height: float, width: float, stroke: float, color: Color) -> None:
        """Draw an H of these sizes about the middle."""
        for side in (-1.0, 1.0):
            x = side * (width - stroke) / 2.0
            self.rect(x - stroke / 2.0, -height / 2.0, x + stroke / 2.0, height / 2.0, color)
        self.rect(-width / 2.0 + stroke / 2.0, -stroke / 2.0, width / 2.0 - stroke / 2.0, stroke / 2.0, color)

    def arrow(self, points: ArrayLike, width: float, color: Color) -> None:
        """Draw an arrow along a line (N, 2), its head at the end."""
        line = np.asarray(points, dtype=np.float64)
        tip, before = line[-1], line[-2]
        way = (tip - before) / float(np.hypot(*(tip - before)))
        across = np.array([-way[1], way[0]])
        neck = tip - 2.0 * width * way
        for a, b in zip(line[:-1], [*line[1:-1], neck + 0.05 * way], strict=True):
            self.bar(a, b, width, color)
        self.polygon([tip, neck + 1.5 * width * across, neck - 1.5 * width * across], color)


def regular(sides: int, radius: float, turn_rad: float = 0.0) -> NDArray[np.float64]:
    """Return the corners (sides, 2) of a regular polygon about the middle; one points up at no turn."""
    angle = np.arange(sides) * (2.0 * math.pi / sides) + turn_rad - math.pi / 2.0
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def shade_of(rng: Generator, color: Color, spread: float = 0.12) -> Color:
    """Return a colour near `color`: brighter or darker, paler, another batch of paint."""
    base = np.array(color) / 255.0
    pale = 0.25 * rng.random() ** 2
    varied = base * rng.uniform(1.0 - spread, 1.0 + spread / 2.0) * rng.uniform(1.0 - spread / 3, 1.0 + spread / 3, 3)
    varied = varied * (1.0 - pale) + pale * (0.6 * varied.mean() + 0.25)
    blue, green, red = (int(v) for v in np.clip(np.rint(255.0 * varied), 8, 250))
    return blue, green, red


def times(color: Color, factor: float) -> Color:
    """Return a colour brighter or darker by a factor."""
    blue, green, red = (min(round(v * factor), 250) for v in color)
    return blue, green, red


def _fixed(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return points (N, 2) as OpenCV's fixed-point pixels."""
    pixels = (points + 1.0) * (_FINE / 2.0) - 0.5
    return np.rint(pixels * (1 << _SHIFT)).astype(np.int32)


def _text_width(text: str, face: cv2.FontFace, size: int, weight: int) -> int:
    return int(cv2.getTextSize((_FINE, _FINE), text, (0, 0), face, size, weight)[2])
