"""From a picture to a network's input, and from boxes in the input back to pixels of the picture.

Edges are continuous: pixel i of the input spans [i, i + 1], and cv2.resize maps edges to edges, so that a scale and
an offset are exact. Pixels of the picture follow OpenCV: they span [-0.5, W - 0.5].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.detect.metadata import Preprocess
from landtool.geometry import Array
from landtool.types import Image


@dataclass(frozen=True)
class InputSpec:
    """How a network wants its pictures.

    preprocess: letterbox keeps the aspect and fills the rest with `grey` (of 255), stretch does not. at: where a
    letterboxed picture lies. order: of the channels. full_range: values 0 to 255, else 0 to 1 (uint8 is always 0 to
    255).
    """

    preprocess: Preprocess = "letterbox"
    at: Literal["centre", "corner"] = "centre"
    grey: int = 114
    order: Literal["rgb", "bgr"] = "rgb"
    full_range: bool = False


@dataclass(frozen=True)
class Placement:
    """Where a picture of width x height pixels lies in the input: its left, top, right and bottom edge there."""

    width: int
    height: int
    left: int
    top: int
    right: int
    bottom: int

    def to_picture(self, boxes: Array) -> Array:
        """Return boxes (N, 4) x_min, y_min, x_max, y_max, from the input's edges to the picture's OpenCV pixels.

        They are clipped to the picture.
        """
        scale_x = self.width / (self.right - self.left)
        scale_y = self.height / (self.bottom - self.top)
        offset = np.array([self.left, self.top, self.left, self.top], dtype=np.float64)
        edges = (boxes - offset) * np.array([scale_x, scale_y, scale_x, scale_y])
        return np.asarray(np.clip(edges, 0.0, [self.width, self.height, self.width, self.height]) - 0.5)


def place(spec: InputSpec, size: tuple[int, int], width: int, height: int) -> Placement:
    """Return where a picture of width x height pixels lies in an input of `size` (width, height)."""
    if spec.preprocess == "stretch":
        return Placement(width, height, 0, 0, *size)
    scale = min(size[0] / width, size[1] / height)
    if spec.at == "corner":
        inner = (max(int(width * scale), 1), max(int(height * scale), 1))
        return Placement(width, height, 0, 0, *inner)
    inner = (max(round(width * scale), 1), max(round(height * scale), 1))
    # of an odd rest the smaller half lies left and above, as Ultralytics has it
    left, top = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    return Placement(width, height, left, top, left + inner[0], top + inner[1])


class Preprocessor:
    """Fills network inputs. Their memory is used again: an input is good until the next one is prepared."""

    def __init__(self, spec: InputSpec, dtype: np.dtype[Any]) -> None:
        self.spec = spec
        self._dtype = dtype
        # values are multiplied in place, one pass a channel: cv2.dnn.blobFromImage takes over ten times as long
        self._unit = None if spec.full_range or dtype == np.uint8 else dtype.type(1.0 / 255.0)
        self._memory: NDArray[Any] = np.empty(0, dtype=dtype)
        self._filled: tuple[tuple[int, int], Placement] | None = None

    def prepare(self, image: Image, size: tuple[int, int]) -> tuple[NDArray[Any], Placement]:
        """Return the input (1, 3, height, width) for a picture (H, W, 3) BGR uint8, and where the picture lies in it.

        size: width and height of the input.
        """
        placement = place(self.spec, size, image.shape[1], image.shape[0])
        tensor = self._tensor(size, placement)
        rows, columns = slice(placement.top, placement.bottom), slice(placement.left, placement.right)
        planes = cv2.split(_resized(image, placement))
        for channel, plane in enumerate(planes if self.spec.order == "bgr" else planes[::-1]):
            part = tensor[0, channel, rows, columns]
            np.copyto(part, plane)
            if self._unit is not None:
                part *= self._unit
        return tensor, placement

    def _tensor(self, size: tuple[int, int], placement: Placement) -> NDArray[Any]:
        """Return an input of this size, its padding filled in."""
        count = 3 * size[0] * size[1]
        if self._memory.size < count:
            self._memory = np.empty(count, dtype=self._dtype)
            self._filled = None
        tensor = self._memory[:count].reshape(1, 3, size[1], size[0])
        covered = (placement.right - placement.left, placement.bottom - placement.top) == size
        if not covered and self._filled != (size, placement):
            tensor.fill(self.spec.grey if self._unit is None else self._dtype.type(self.spec.grey) * self._unit)
        self._filled = (size, placement)
        return tensor


def _resized(image: Image, placement: Placement) -> Image:
    width, height = placement.right - placement.left, placement.bottom - placement.top
    if image.strides[1:] != (3, 1) or image.strides[0] < 0:
        image = np.ascontiguousarray(image)  # OpenCV takes no mirrored views
    if (width, height) == (placement.width, placement.height):
        return image
    # a bilinear reduction skips pixels, and small targets with them
    smaller = width < placement.width and height < placement.height
    how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=how), dtype=np.uint8)
