"""Values over a run of any length in bounded memory."""

from __future__ import annotations

import numpy as np

from landtool.geometry import Array

MOST_ROWS = 8192  # of a series: more than a page or a median can tell apart


class Series:
    """Rows of numbers in the order they came. When full, every second one is dropped, and from then on taken.

    columns: their names. worst: those in which a row that is kept takes over the largest value of the dropped ones
    after it, so that what is rare and bad is never lost. every: how many rows that came share one that was kept.
    """

    def __init__(self, columns: tuple[str, ...], *, worst: tuple[str, ...] = (), most: int = MOST_ROWS) -> None:
        if most < 2 or most % 2:
            raise ValueError(f"a series of {most} rows cannot be halved")
        self.columns = columns
        self.every = 1
        self._rows = np.empty((most, len(columns)))
        self._worst = [columns.index(name) for name in worst]
        self._kept = self._came = 0

    def __len__(self) -> int:
        return self._kept

    def add(self, *row: float | None) -> None:
        """Take one row in, a value a column; None is unknown."""
        values = np.array([np.nan if value is None else value for value in row])
        if self._came % self.every == 0:
            if self._kept == len(self._rows):
                self._halve()
            self._rows[self._kept] = values
            self._kept += 1
        else:
            last = self._rows[self._kept - 1]
            last[self._worst] = np.fmax(last[self._worst], values[self._worst])
        self._came += 1

    def column(self, name: str) -> Array:
        """Return the rows' values (N,), NaN where unknown."""
        return self._rows[: self._kept, self.columns.index(name)]

    def _halve(self) -> None:
        # the row that is about to come is the first of a new group: their number is a multiple of `every` and even
        first, second = self._rows[::2].copy(), self._rows[1::2]
        first[:, self._worst] = np.fmax(first[:, self._worst], second[:, self._worst])
        self._kept = len(first)
        self._rows[: self._kept] = first
        self.every *= 2
