"""Which views of a board to calibrate with: few that together show all of the picture, near and far, from all sides."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.calibrate.board import Board
from landtool.calibrate.corners import BoardView
from landtool.geometry import Array

CELLS = 10, 8  # columns and rows the picture is divided in
MOST_VIEWS = 40
_SPREAD_WEIGHT = 1.5  # of a view unlike all others, against new cells


def cells_of(pixels: Array, size: tuple[int, int]) -> NDArray[np.int64]:
    """Return how many corners (N, 2) lie in each cell (rows, columns) of a picture of `size` (width, height)."""
    columns, rows = CELLS
    place = ((pixels + 0.5) / size * CELLS).astype(np.int64).clip(0, (columns - 1, rows - 1))
    count = np.bincount(place[:, 1] * columns + place[:, 0], minlength=columns * rows)
    return count.reshape(rows, columns)


def coverage(views: Sequence[BoardView], size: tuple[int, int]) -> NDArray[np.int64]:
    """Return how many corners of all views lie in each cell (rows, columns)."""
    total = np.zeros(CELLS[::-1], np.int64)
    for view in views:
        total += cells_of(view.pixels, size)
    return total


def choose_views(
    board: Board, views: Sequence[BoardView], size: tuple[int, int], most: int = MOST_VIEWS
) -> NDArray[np.intp]:
    """Return the indices, in order, of at most `most` views, each the one that adds most to those before it.

    What a view adds: cells of the picture seen rarely so far, and how unlike the others it is in place, size and tilt.
    """
    if len(views) <= most:
        return np.arange(len(views))
    seen = np.array([cells_of(view.pixels, size) > 0 for view in views])
    features = np.array([_features(board, view, size) for view in views])
    features /= np.maximum(features.std(axis=0), 1e-9)
    chosen = [int(seen.sum(axis=(1, 2)).argmax())]
    count = seen[chosen[0]].astype(np.float64)
    nearest = np.linalg.norm(features - features[chosen[0]], axis=1)
    while len(chosen) < most:
        gain = (seen / (1.0 + count)).sum(axis=(1, 2)) + _SPREAD_WEIGHT * nearest
        gain[chosen] = -np.inf
        best = int(gain.argmax())
        chosen.append(best)
        count += seen[best]
        nearest = np.minimum(nearest, np.linalg.norm(features - features[best], axis=1))
    return np.sort(np.array(chosen, np.intp))


def _features(board: Board, view: BoardView, size: tuple[int, int]) -> Array:
    """Return place, size, turn and foreshortening (7,) of a view, from the board's picture as a plane."""
    points = board.points_m[view.ids, :2] / board.square_m
    middle = view.pixels.mean(axis=0)
    spread = float(np.sqrt(((view.pixels - middle) ** 2).sum(axis=1).mean()))
    homography, _ = cv2.findHomography(points - points.mean(axis=0), (view.pixels - middle) / size[0], 0)
    if homography is None:
        return np.zeros(7)
    h = homography / homography[2, 2]
    scale = np.sqrt(abs(np.linalg.det(h[:2, :2])))
    # h31 and h32 over the scale are how fast the board recedes: its tilt
    tilt = np.linalg.pinv(h[:2, :2]) @ np.eye(2) * scale
    turn = np.arctan2(h[1, 0], h[0, 0])
    recedes = h[2, :2] @ tilt
    return np.array(
        [*(middle / size[0]), np.log(spread / size[0]), *(6.0 * recedes / scale), np.cos(turn), np.sin(turn)]
    )
