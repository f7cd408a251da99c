"""What pictures show when they do not show the board that was said, and whether a board found is the one said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from landtool.calibrate.board import BORDER_MODULES, DICTIONARIES, Board
from landtool.calibrate.corners import (
    Grey,
    Markers,
    find_in_grey,
    fit_neighbours,
    place_markers,
    read_markers,
    reduced,
)
from landtool.errors import UsageError

_ENOUGH = 4  # markers that are no accident
_MOST_COLUMNS = 24
_LEAST_SQUARES = 5  # each way, of a chessboard nobody spoke of
_MEASURED = 0.8  # of its crossings
_RATIO = 0.05  # relative difference of sizes that is said
# What people say instead of a chessboard's columns and rows of squares, and a row or column miscounted
_NEIGHBOURS = ((1, 1), (-1, -1), (1, 0), (0, 1), (-1, 0), (0, -1), (1, -1), (-1, 1))
_APRILTAG = cv2.aruco.DICT_APRILTAG_36h11


def why_not_found(board: Board, pictures: Sequence[Grey]) -> str:
    """Return what the pictures show instead of the board, or empty when no two of them agree on something known."""
    for look in (_other_layout, _mirrored, _other_kind, _other_chessboard, _any_chessboard):
        said = _agreed([look(board, grey) for grey in pictures])
        if said:
            return said
    return ""


def _agreed(sayings: Sequence[str]) -> str:
    """Return what most pictures say, and two at least where there are two: one alone may be chance."""
    counts = Counter(said for said in sayings if said)
    said, count = counts.most_common(1)[0] if counts else ("", 0)
    return said if count >= min(2, len(sayings)) else ""


def _other_layout(board: Board, grey: Grey) -> str:
    if board.kind == "chessboard":
        return ""
    markers = _all_markers(board, grey)
    other = fitting_board(board, markers) if len(markers.ids) >= _ENOUGH else None
    if other is None:
        return ""
    if other.white_first == board.white_first or other.columns != board.columns:
        first = " --white-first" if other.white_first else ""
        # how many rows it has is seen only where it has more than was said
        rows = str(board.rows) if other.rows <= board.rows else "ROWS"
        return f"the markers fit a board {other.columns} wide; say --squares {other.columns}x{rows}{first}"
    if board.white_first:
        return "the markers fit a board whose first square is black; leave out --white-first"
    rows = "" if board.rows % 2 == 0 else f" and --squares {board.columns}xROWS with an even number of rows"
    return f"the markers fit a board whose first square is white, as older OpenCV drew them; say --white-first{rows}"


def _other_chessboard(board: Board, grey: Grey) -> str:
    size = _neighbouring_size(board, grey) if board.kind == "chessboard" else None
    if size is None:
        return ""
    said = f"a chessboard of {size[0]}x{size[1]} squares is seen"
    if sorted(size) == sorted((board.columns + 1, board.rows + 1)):
        return f"{said}; --squares counts squares, not inner corners"
    return f"{said}; say --squares {size[0]}x{size[1]}"


def _neighbouring_size(board: Board, grey: Grey) -> tuple[int, int] | None:
    """Return the size near the one that was said with which a chessboard is found; inner corners counted first."""
    for more_columns, more_rows in _NEIGHBOURS:
        columns, rows = board.columns + more_columns, board.rows + more_rows
        if _is_chessboard(grey, columns, rows):
            return columns, rows
    return None


def _is_chessboard(grey: Grey, columns: int, rows: int) -> bool:
    """Whether a picture shows for sure a chessboard of so many squares: its crossings are crossings.

    OpenCV finds grids of 3x3 to 7x3 inner corners in any texture, in noise too.
    """
    if min(columns, rows) < _LEAST_SQUARES:
        return False
    tried = Board("chessboard", columns, rows)
    view = find_in_grey(grey, tried).view
    return view is not None and len(view.ids) >= _MEASURED * len(tried.points_m)


def chessboard_size(grey: Grey) -> tuple[int, int] | None:
    """Return columns and rows of squares of the largest chessboard in a picture, None without one."""
    small, _ = reduced(grey)
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
    found, _, meta = cv2.findChessboardCornersSBWithMeta(small, (3, 3), flags=flags)
    if not found or meta is None:
        return None
    return int(meta.shape[1]) + 1, int(meta.shape[0]) + 1


def _all_markers(board: Board, grey: Grey) -> Markers:
    if board.kind == "aprilgrid":
        return read_markers(grey, _APRILTAG, BORDER_MODULES)
    return read_markers(grey, DICTIONARIES[board.dictionary], 1)


def fitting_board(board: Board, markers: Markers) -> Board | None:
    """Return the board of another size, or of the other first square, that markers lie on; None without one.

    As many rows as the largest id needs.
    """
    best: tuple[int, Board] | None = None
    firsts = (False, True) if board.kind == "charuco" else (False,)
    for columns in range(3, _MOST_COLUMNS + 1):
        for white_first in firsts:
            per_row = columns if board.kind == "aprilgrid" else columns / 2.0
            rows = max(3, int(np.ceil((int(markers.ids.max()) + 1) / per_row)))
            rows += rows % 2 if white_first else 0
            try:
                tried = replace(board, columns=columns, rows=rows, white_first=white_first)
            except UsageError:
                continue
            placed = place_markers(tried, markers)
            if placed is None:
                continue
            inside, _ = fit_neighbours(*placed)
            count = int(inside.sum())
            if count >= _ENOUGH and (best is None or count > best[0]):
                best = count, tried
    return best[1] if best is not None else None


def _other_kind(board: Board, grey: Grey) -> str:
    # tables of few bits are matched by chance: the one that explains most is meant
    counts = {bits: len(read_markers(grey, table, 1).ids) for bits, table in DICTIONARIES.items()}
    bits = max(counts, key=lambda name: counts[name])
    grid, plain = (len(read_markers(grey, _APRILTAG, border).ids) for border in (BORDER_MODULES, 1))
    count = max(counts[bits], grid, plain)
    if count < _ENOUGH:
        return ""
    if count == grid:
        return "" if board.kind == "aprilgrid" else "tags of an AprilGrid are seen; is it --board aprilgrid?"
    if count == plain:
        return "plain tag36h11 tags are seen, with one black module around them where an AprilGrid has two"
    if board.kind != "charuco":
        return f"ArUco markers of {bits} bits are seen; is it --board charuco?"
    return "" if board.dictionary == bits else f"markers of {bits} bits are seen; say --dictionary {bits}"


def _any_chessboard(board: Board, grey: Grey) -> str:
    size = chessboard_size(grey)
    if size is None or sorted(size) == sorted((board.columns, board.rows)) or not _is_chessboard(grey, *size):
        return ""
    said = f"--squares {min(size)}x{max(size)}" if board.kind == "chessboard" else "--board chessboard"
    return f"a chessboard of about {min(size)}x{max(size)} squares is seen; is it {said}?"


def _mirrored(board: Board, grey: Grey) -> str:
    if board.kind == "chessboard":
        return ""
    markers = _all_markers(board, np.ascontiguousarray(grey[:, ::-1]))
    placed = place_markers(board, markers) if len(markers.ids) >= _ENOUGH else None
    return "" if placed is None or len(placed[0]) < _ENOUGH else "the pictures are mirrored; record without"


def what_differs(board: Board, pictures: Sequence[Grey], without: Sequence[Grey] = ()) -> list[str]:
    """Return how the board in pictures that show it differs from what was said. without: some where it is not found."""
    if board.kind == "chessboard":
        kind = _agreed([_other_kind(board, grey) for grey in (*pictures, *without)])
        return [kind] if kind else _chessboard_differs(board, pictures)
    largest, sides = -1, []
    for grey in pictures:
        markers = _all_markers(board, grey)
        if not len(markers.ids):
            continue
        largest = max(largest, int(markers.ids.max()))
        placed = place_markers(board, markers)
        if placed is None or len(placed[0]) < _ENOUGH:
            continue
        corners, seen = placed
        # the middles tell the plane whatever the side is
        homography, _ = cv2.findHomography(seen.mean(axis=1), corners.mean(axis=1), 0)
        if homography is None:
            continue
        there = cv2.perspectiveTransform(seen.reshape(1, -1, 2), homography).reshape(-1, 4, 2)
        # a marker's outline is found on its outermost black pixels: a pixel too small
        outline = np.linalg.norm(seen - np.roll(seen, 1, axis=1), axis=2)
        edges = np.linalg.norm(there - np.roll(there, 1, axis=1), axis=2) * (1.0 + 1.0 / outline)
        sides.append(float(np.median(edges)) / board.pitch_m)
    said = []
    if largest >= board.markers:
        said.append(f"a marker {largest} is seen, a board of {board.size} ends at {board.markers - 1}; check --squares")
    said += _side_differs(board, float(np.median(sides))) if sides else []
    return said


def _side_differs(board: Board, side: float) -> list[str]:
    """Compare the markers' side over their pitch with what was said."""
    if board.kind == "charuco":
        if abs(side / (board.marker_m / board.square_m) - 1.0) < _RATIO:
            return []
        mm = side * board.square_m
        return [
            f"markers are {side:.2f} of a square, {board.marker_m / board.square_m:.2f} was said; say --marker {mm:.4g}"
        ]
    if abs(side * (1.0 + board.spacing) - 1.0) < _RATIO:
        return []
    return [f"the gaps are {1.0 / side - 1.0:.2f} of a tag, {board.spacing:.2f} was said; check --spacing"]


def _chessboard_differs(board: Board, pictures: Sequence[Grey]) -> list[str]:
    for grey in pictures:
        size = chessboard_size(grey)
        if size is not None and _is_chessboard(grey, *size):
            wanted = sorted((board.columns, board.rows))
            grown = [a - b for a, b in zip(sorted(size), wanted, strict=True)]
            if min(grown) >= 0 and max(grown) > 0:
                return [f"the chessboard seen has {size[0]}x{size[1]} squares, {board.size} was said; check --squares"]
    return []
