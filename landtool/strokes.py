"""Anti-aliased lines and text on pictures: what the overlay is drawn with.

Colours are BGR, after Okabe and Ito, so that people with any colour vision tell them apart. Every line and letter
has a dark edge, so it is seen on white paper as well as on asphalt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.types import Image

Color = tuple[int, int, int]

WHITE: Color = (255, 255, 255)
GREY: Color = (170, 170, 170)
DARK: Color = (20, 20, 20)
GREEN: Color = (115, 158, 0)  # bluish green
SKY: Color = (233, 180, 86)
BLUE: Color = (178, 114, 0)
YELLOW: Color = (66, 228, 240)
ORANGE: Color = (0, 159, 230)
VERMILLION: Color = (0, 94, 213)
PURPLE: Color = (167, 121, 204)  # reddish purple

_SHIFT = 4  # OpenCV draws at sixteenths of a pixel
_FLAT_PX = 0.1  # what lies this near to a straight line is drawn as one: each corner costs as much as its edges
_REACH = 8.0  # points farther out than this many image sides are not drawn: their integers would overflow
Side = Literal["left", "right", "centre"]


@dataclass(frozen=True)
class Pen:
    """Sizes that suit one size of image, and its typeface.

    line_px: width of a line. text_px: height of the letters' body.
    """

    width: int
    height: int
    line_px: int
    text_px: int
    face: cv2.FontFace

    @classmethod
    def of_image(cls, width: int, height: int) -> Pen:
        """Choose sizes that are legible on an image of this size without covering it."""
        # grows slower than the picture: a large picture is seen larger, too
        scale = (min(width, height) / 480.0) ** 0.75
        return cls(width, height, max(1, round(1.6 * scale)), max(9, round(13 * scale)), cv2.FontFace("sans"))

    def line(self, image: Image, points_px: Array, color: Color, *, closed: bool = False) -> None:
        """Draw a line through points (N, 2) in place; it is broken where a point is NaN or far outside."""
        for run in _drawable_runs(points_px, self.width, self.height, closed):
            whole = closed and len(run) == len(points_px)
            points = [_fixed_point(run, closed=whole)]
            for paint, width_px in ((DARK, self.line_px + 1 + self.line_px // 2), (color, self.line_px)):
                cv2.polylines(image, points, whole, paint, width_px, cv2.LINE_AA, _SHIFT)

    def disc(self, image: Image, centre_px: Array, radius_px: float, color: Color) -> None:
        """Draw a filled disc about a point (2,) in place, or nothing where it is not visible."""
        if self.sees(centre_px):
            centre = [int(v) for v in np.round(centre_px * (1 << _SHIFT))]
            for paint, radius in ((DARK, radius_px + 1.0), (color, radius_px)):
                cv2.circle(image, centre, round(radius * (1 << _SHIFT)), paint, cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def sees(self, point_px: Array) -> bool:
        """Whether a point (2,) lies in the image."""
        x, y = point_px
        return bool(-0.5 <= x <= self.width - 0.5 and -0.5 <= y <= self.height - 0.5)

    def text_width(self, text: str) -> int:
        """Width of a text in pixels."""
        return _text_width(self.face, self.text_px, text)

    def fitted(self, text: str, width_px: int) -> str:
        """Return the text, its end cut off with dots where it is wider than `width_px`."""
        if self.text_width(text) <= width_px:
            return text
        while text and self.text_width(text + "...") > width_px:
            text = text[:-1]
        return text + "..." if text else ""

    def text(self, image: Image, text: str, left: int, baseline: int, color: Color = WHITE) -> None:
        """Write plain text in place, as on a panel. Characters outside ASCII become question marks."""
        cv2.putText(image, ascii_only(text), (left, baseline), color, self.face, self.text_px, 400)

    def label(self, image: Image, text: str, x_px: float, y_px: float, color: Color, side: Side = "right") -> None:
        """Write a small label on a ground of `color` beside a point, moved as far as needed to lie in the image."""
        text = self.fitted(ascii_only(text), self.width - 6)
        width, height = self.text_width(text) + 6, self.text_px + 3
        if not text or not np.isfinite([x_px, y_px]).all() or height > self.height:
            return
        left = x_px - {"right": 0.0, "left": width, "centre": width / 2.0}[side]
        left = int(np.clip(round(left), 0, self.width - width))
        top = int(np.clip(round(y_px) - height, 0, self.height - height))
        image[top : top + height, left : left + width] = color
        light = sum(w * c for w, c in zip((0.114, 0.587, 0.299), color, strict=True))
        self.text(image, text, left + 3, top + self.text_px, DARK if light > 115 else WHITE)


@lru_cache(maxsize=4096)
def _text_width(face: cv2.FontFace, text_px: int, text: str) -> int:
    # the size of the picture is used where text is to be wrapped only
    return int(cv2.getTextSize((1, 1), text, (0, 0), face, text_px, 400)[2])


def ascii_only(text: str) -> str:
    """Return the text on one line, with a question mark for every character outside printable ASCII."""
    text = " ".join(text.split())
    if text.isascii() and text.isprintable():
        return text
    return "".join(c if " " <= c <= "~" else "?" for c in text)


def shade(image: Image, left: int, top: int, width: int, height: int, light: float = 0.27) -> None:
    """Darken a rectangle to `light` of its brightness, in place."""
    part = image[top : top + height, left : left + width]
    cv2.convertScaleAbs(part, dst=part, alpha=light)


def _fixed_point(run: NDArray[np.float64], *, closed: bool) -> NDArray[np.int32]:
    """Return a run of points (N, 2) as OpenCV draws it, without those that change nothing to be seen."""
    if len(run) > 4:
        run = np.asarray(cv2.approxPolyDP(run.astype(np.float32), _FLAT_PX, closed)[:, 0], np.float64)
    return np.asarray(np.round(run * (1 << _SHIFT)), np.int32)


def _drawable_runs(points_px: Array, width: int, height: int, closed: bool) -> list[NDArray[np.float64]]:
    """Split a line into its runs of at least two points that can be drawn."""
    near = (np.abs(points_px) < _REACH * max(width, height)).all(axis=1)  # False for NaN
    if near.all():
        return [points_px] if len(points_px) > 1 else []
    if closed and near.any():  # start after a gap, and come back to it
        first = int(np.flatnonzero(~near)[0])
        points_px, near = np.roll(points_px, -first, axis=0), np.roll(near, -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(np.int8)))
    return [points_px[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 1]
