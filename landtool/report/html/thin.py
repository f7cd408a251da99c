"""Curves with fewer points that look the same: of every stretch the lowest and the highest stay, so no peak is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array

MOST_POINTS = 600  # of a curve: more than a chart has pixels


def thinned(y: Array, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Return which points of y (N,) to draw, ascending: all, or the lowest and highest of most / 3 stretches.

    An unknown (NaN) point of a stretch stays too, so that a line is broken where it was; so do the ends.
    """
    count = len(y)
    if count <= most:
        return np.arange(count)
    chosen = {0, count - 1}
    for part in np.array_split(np.arange(count), max(1, most // 3 - 1)):
        known = part[np.isfinite(y[part])]
        if len(known):
            chosen |= {int(known[y[known].argmin()]), int(known[y[known].argmax()])}
        if len(known) < len(part):
            chosen.add(int(part[~np.isfinite(y[part])][0]))
    return np.array(sorted(chosen), dtype=np.intp)
