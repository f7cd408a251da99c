"""Which pictures of a recording are searched for the board: sharp ones, well apart, not too many."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.calibrate.corners import grey_of
from landtool.types import Frame, Image

MOST_LOOKED_AT = 200  # pictures searched in a recording whose length is known
_SMALL = 96, 72
_ALIKE = 0.7  # mean difference in grey levels below which two pictures show the same
_SHARP_WIDTH = 480


class FrameChoice:
    """Gives on one picture of every `step`, the sharpest, unless it is like the last one given on.

    alike: how many were left out for that.
    """

    def __init__(self, frames_declared: int | None) -> None:
        self.step = max(1, -(-(frames_declared or 0) // MOST_LOOKED_AT))
        self.alike = 0
        self._best: tuple[float, Frame] | None = None
        self._count = 0
        self._last: NDArray[np.float32] | None = None

    def take(self, frame: Frame) -> Iterator[Frame]:
        """Take a picture in; give on what is to be searched."""
        sharpness = _sharpness(frame.image) if self.step > 1 else 0.0
        if self._best is None or sharpness > self._best[0]:
            self._best = sharpness, frame
        self._count += 1
        if self._count % self.step == 0:
            yield from self.rest()

    def rest(self) -> Iterator[Frame]:
        """Give on the best of the pictures since the last one."""
        if self._best is None:
            return
        (_, frame), self._best = self._best, None
        small = cv2.resize(grey_of(frame.image), _SMALL, interpolation=cv2.INTER_AREA).astype(np.float32)
        if self._last is not None and float(np.abs(small - self._last).mean()) < _ALIKE:
            self.alike += 1
            return
        self._last = small
        yield frame


def _sharpness(image: Image) -> float:
    """Return how much fine detail a picture has: the variance of its Laplacian."""
    width = min(_SHARP_WIDTH, image.shape[1])
    height = max(1, round(image.shape[0] * width / image.shape[1]))
    small = cv2.resize(grey_of(image), (width, height), interpolation=cv2.INTER_NEAREST)
    return float(cv2.Laplacian(small, cv2.CV_32F).var())
