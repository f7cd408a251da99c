"""The air before a scene: what a dehazer estimates of a picture, and what it takes off with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from landtool.dehaze.veil import Veil
from landtool.types import Image

Map = NDArray[np.float32]
Airlight = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Air:
    """I = J t + A (1 - t). airlight: (3,) float64 A, blue first, of the values the recipe works in, 1 is white.

    transmission: (h, w) float32 t in (0, 1], of the picture's size or smaller.
    """

    airlight: Airlight
    transmission: Map

    def thinned(self, strength: float) -> Air:
        """Return air that takes only this share of the light away: all of it at 1, none at 0."""
        if strength >= 1.0:
            return self
        # 1 - t' = s (1 - t)
        return Air(self.airlight, np.float32(1.0) - np.float32(strength) * (np.float32(1.0) - self.transmission))


class Recipe(Protocol):
    """A way to dehaze: what is estimated of a picture, and the picture without it. Pictures (H, W, 3) BGR uint8."""

    def estimate(self, image: Image, veil: Veil, steady: Callable[[Airlight], Airlight]) -> Air:
        """Return the air before a picture.

        veil: what the statistics say, smoothed in time. steady: smooths in time an airlight of the recipe's own.
        """
        ...

    def recover(self, image: Image, air: Air) -> Image:
        """Return the picture as it would be in clear air; a new array."""
        ...
