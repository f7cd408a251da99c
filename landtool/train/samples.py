"""Pictures to learn from: of a labelled folder, or drawn by the generator as they are needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from landtool.errors import InputError
from landtool.geometry import Array
from landtool.io.images import PictureError, read_picture
from landtool.io.labels import LabelledImage
from landtool.types import Image


@dataclass(frozen=True, eq=False)
class Example:
    """A picture and what is in it.

    image: (H, W, 3) BGR uint8. boxes: (N, 4) float64 x_min, y_min, x_max, y_max, edges of the picture at 0 and W.
    labels: (N,) int64. ignored: (N,) bool, targets too small or too far cut to be learnt.
    """

    image: Image
    boxes: Array
    labels: np.ndarray[tuple[int], np.dtype[np.int64]]
    ignored: np.ndarray[tuple[int], np.dtype[np.bool_]]

    @classmethod
    def of(cls, image: Image, boxes: Array, labels: Sequence[int]) -> Example:
        """Return an example none of whose targets is ignored."""
        count = len(labels)
        return cls(image, boxes.reshape(count, 4), np.array(labels, np.int64), np.zeros(count, np.bool_))


class Samples(Protocol):
    """Pictures by number, the same one for the same number; they are asked for by several threads at once."""

    def pool(self, iteration: int) -> range:
        """Return the numbers that the step of an iteration draws from: never empty, and by the iteration alone."""
        ...

    def example(self, index: int) -> Example:
        """Return one. Raises InputError for a picture that cannot be read."""
        ...


class FolderSamples:
    """The pictures of a labelled folder."""

    def __init__(self, images: Sequence[LabelledImage]) -> None:
        self._images = images

    def pool(self, iteration: int) -> range:  # noqa: ARG002
        """Return the numbers of all pictures."""
        return range(len(self._images))

    def example(self, index: int) -> Example:
        """Read a picture."""
        labelled = self._images[index]
        try:
            picture = read_picture(labelled.path)
        except PictureError as error:
            raise InputError(str(error), file=labelled.path, hint="remove it from the data set") from error
        if picture.damage:
            raise InputError(picture.damage, file=labelled.path, hint="remove it from the data set")
        boxes = np.array([[b.x_min_px, b.y_min_px, b.x_max_px, b.y_max_px] for b in labelled.boxes]).reshape(-1, 4)
        return Example.of(picture.image, boxes + 0.5, [b.class_id for b in labelled.boxes])
