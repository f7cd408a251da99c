"""Rows of a picture taken in bands: what is made on the way then stays in the processor's cache."""

from __future__ import annotations

from collections.abc import Iterator

_BAND_PX = 40_000


def bands(height: int, width: int) -> Iterator[slice]:
    """Yield the rows of a picture, from the top, in bands of some ten thousand pixels."""
    rows = max(_BAND_PX // width, 1)
    for top in range(0, height, rows):
        yield slice(top, top + rows)
