"""What the whole run says of a track, put beside what was known at each moment."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from landtool.io.atomic import atomic_path
from landtool.io.tables import SMOOTHED, Cell, Row, format_cell, read_rows
from landtool.tracking.kalman import KalmanState


def add_smoothed(folder: Path, states: Mapping[tuple[int, int], KalmanState]) -> None:
    """Add the smoothed columns to the tracks.csv of a run's folder.

    states: of all its rows, by (place of the frame in frames.csv, number of the track). Raises as the tables do.
    """
    frames = [row["frame"] for row in read_rows(folder / "frames.csv", {"frame": int})]
    known: dict[tuple[Cell, Cell], KalmanState] = {
        (frames[place], track_id): state for (place, track_id), state in states.items()
    }
    path = folder / "tracks.csv"
    keys = read_rows(path, {"frame": int, "track_id": int})
    with ExitStack() as stack:
        temporary = stack.enter_context(atomic_path(path, overwrite=True))
        file = stack.enter_context(temporary.open("w", encoding="utf-8", newline=""))
        lines = stack.enter_context(path.open(encoding="utf-8"))  # no cell of a track is quoted: a line is a row
        file.write(",".join([next(lines).rstrip("\n"), *SMOOTHED]) + "\n")
        for line, key in zip(lines, keys, strict=True):
            cells = _cells(known.get((key["frame"], key["track_id"])))
            file.write(",".join([line.rstrip("\n"), *map(format_cell, cells)]) + "\n")


def _cells(state: KalmanState | None) -> Row:
    if state is None:
        return (None,) * len(SMOOTHED)
    return tuple(float(value) for value in (*state.mean, *np.diag(state.covariance)))
