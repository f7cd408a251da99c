"""The air before a scene: what a dehazer estimates of a picture, and what it takes off with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from landtool.types import Image

Map = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Air:
    """I = J t + A (1 - t). airlight: (3,) float64 A, blue first, in [0, 1] of the values the recipe works in.

    transmission: (h, w) float32 t in (0, 1], of a picture made smaller, or of its full size.
    """

    airlight: NDArray[np.float64]
    transmission: Map


class Recipe(Protocol):
    """A way to dehaze: what is estimated of a picture, and the picture without it. Pictures (H, W, 3) BGR uint8."""

    def estimate(self, image: Image) -> Air:
        """Return the air before a picture."""
        ...

    def recover(self, image: Image, air: Air) -> Image:
        """Return the picture as it would be in clear air; a new array."""
        ...
