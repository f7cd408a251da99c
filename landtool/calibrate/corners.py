"""A board's crossings in one picture: found roughly by OpenCV, named, then measured in linear light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.calibrate.board import BORDER_MODULES, DICTIONARIES, Board
from landtool.calibrate.crossing import Crossings, refine_crossings
from landtool.geometry import Array
from landtool.types import Image

Grey = NDArray[np.uint8]
LEAST_CORNERS = 8
_LEAST_MARKERS = 3
_LEAST_SHARE = 0.6  # of the markers read that must fit together
_AROUND = 4  # neighbours of a marker that say where it should be
_STRAY = 0.3  # of their distance that they may be wrong by
_LEAST_CONTRAST = 0.25  # of the board's median
# not exhaustive: that finds one in twenty more through a fisheye, and takes four times as long where there is none
_CHESS_FLAGS = cv2.CALIB_CB_NORMALIZE_IMAGE
_GROWTH = 6  # rounds of looking for crossings beside the known ones
_NEIGHBOURS = 10
_TRIES = 2  # of a crossing, the second from nearer neighbours
_LARGEST_SIDE_PX = 1400  # pictures are reduced to this for the search, measured as they are


@dataclass(frozen=True, eq=False)
class BoardView:
    """What one picture shows of a board. ids: (N,) of `Board.points_m`. pixels: (N, 2). sigma_px, blur_px: (N,)."""

    ids: NDArray[np.intp]
    pixels: Array
    sigma_px: Array
    blur_px: Array


@dataclass(frozen=True, eq=False)
class Markers:
    """Square markers of one table that a picture shows. ids: (n,). corners_px: (n, 4, 2), as the table has them."""

    ids: NDArray[np.intp]
    corners_px: Array


@dataclass(frozen=True, eq=False)
class Seen:
    """A look at one picture: the board, or in `reason` why not. markers: how many of its kind were read."""

    view: BoardView | None
    reason: str = ""
    markers: int = 0


def grey_of(image: Image) -> Grey:
    """Return the brightness (H, W) of a picture (H, W, 3) BGR."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def find_board(image: Image, board: Board) -> Seen:
    """Find and measure the board's crossings in a picture (H, W, 3) BGR."""
    return find_in_grey(grey_of(image), board)


def find_in_grey(grey: Grey, board: Board) -> Seen:
    """Find and measure the board's crossings in a picture's brightness (H, W)."""
    if board.kind == "chessboard":
        pixels = find_chessboard(grey, board.columns, board.rows)
        if pixels is None:
            return Seen(None, "board not found")
        return _measured(grey, board, np.arange(len(pixels)), pixels)
    markers = find_markers(grey, board)
    if not len(markers.ids):
        return Seen(None, "no marker read")
    placed = place_markers(board, markers)
    if placed is None:
        return Seen(None, "its markers do not lie as the board's do", len(markers.ids))
    seen = _measured(grey, board, *_crossings_of(board, *placed))
    return Seen(seen.view, seen.reason, len(markers.ids))


def find_chessboard(grey: Grey, columns: int, rows: int) -> Array | None:
    """Return the inner crossings (N, 2) of a chessboard of so many squares, row by row; None where it is not seen."""
    small, scale = reduced(grey)
    size = columns - 1, rows - 1
    found, corners = cv2.findChessboardCornersSB(small, size, flags=_CHESS_FLAGS)
    if not found or corners is None or len(corners) != (columns - 1) * (rows - 1):
        return None
    return (np.asarray(corners, np.float64).reshape(-1, 2) + 0.5) * scale - 0.5


def reduced(grey: Grey) -> tuple[Grey, float]:
    """Return a picture for the search, and how many of its pixels one of it has."""
    scale = max(1.0, max(grey.shape) / _LARGEST_SIDE_PX)
    if scale == 1.0:
        return grey, 1.0
    size = round(grey.shape[1] / scale), round(grey.shape[0] / scale)
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8), grey.shape[1] / size[0]


def find_markers(grey: Grey, board: Board) -> Markers:
    """Read the board's markers; small ones in the picture enlarged when few are read in it as it is."""
    table = DICTIONARIES[board.dictionary] if board.kind == "charuco" else cv2.aruco.DICT_APRILTAG_36h11
    border = BORDER_MODULES if board.kind == "aprilgrid" else 1
    found = read_markers(grey, table, border, board.markers)
    if 2 * len(found.ids) >= board.markers or max(grey.shape) > _LARGEST_SIDE_PX:
        return found
    twice = cv2.resize(grey, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_CUBIC)
    again = read_markers(np.asarray(twice, np.uint8), table, border, board.markers)
    if len(again.ids) <= len(found.ids):
        return found
    return Markers(again.ids, (again.corners_px + 0.5) / 2.0 - 0.5)


def read_markers(grey: Grey, table: int, border: int, count: int | None = None) -> Markers:
    """Read the first `count` markers of one of OpenCV's tables, with so many black modules around them; ids once."""
    corners, ids, _ = _detector(table, border, count).detectMarkers(grey)
    if ids is None or not len(ids):
        return Markers(np.zeros(0, np.intp), np.zeros((0, 4, 2)))
    flat = np.asarray(ids, np.intp).reshape(-1)
    quads = np.asarray(corners, np.float64).reshape(-1, 4, 2)
    _, first, times = np.unique(flat, return_index=True, return_counts=True)
    once = first[times == 1]  # twice in one picture: nobody knows which is which
    return Markers(flat[once], quads[once])


@cache
def _detector(table: int, border: int, count: int | None) -> cv2.aruco.ArucoDetector:
    settings = cv2.aruco.DetectorParameters()
    settings.markerBorderBits = border
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    settings.minMarkerPerimeterRate = 0.02
    settings.minMarkerDistanceRate = 0.02
    dictionary = cv2.aruco.getPredefinedDictionary(table)
    if count is not None:  # every candidate is compared with every code
        dictionary.bytesList = dictionary.bytesList[:count]
    return cv2.aruco.ArucoDetector(dictionary, settings)


def place_markers(board: Board, markers: Markers) -> tuple[Array, Array] | None:
    """Return the markers' corners on the board and in the picture, (n, 4, 2) each, those that fit together.

    Prints differ in where the ids begin and how a tag is turned: the one way is taken in which each marker lies where
    its neighbours say. None where there are too few, or none fits.
    """
    known = markers.ids < board.markers
    ids, pixels = markers.ids[known], markers.corners_px[known]
    if len(ids) < _LEAST_MARKERS:
        return None
    best: tuple[int, float, Array, Array] | None = None
    for turned, places in _layouts(board):
        corners, seen = places[ids], np.roll(pixels, turned, axis=1)
        inside, error = fit_neighbours(corners, seen)
        score = int(inside.sum()), -error
        if score[0] >= _LEAST_MARKERS and (best is None or score > best[:2]):
            best = (*score, corners[inside], seen[inside])
    if best is None or best[0] < _LEAST_SHARE * len(ids):
        return None
    return best[2], best[3]


def _layouts(board: Board) -> list[tuple[int, Array]]:
    """Return the ways to print a board: quarter turns of the markers' corners, and the corners (n, 4, 2) by id."""
    places = board.marker_corners_m
    if board.kind == "charuco":
        return [(0, places)]
    # ids from the bottom left, as ours and Kalibr's, or from the top left; a tag turned any way
    rows = np.arange(board.markers).reshape(board.rows, board.columns)
    return [(turned, p) for p in (places, places[rows[::-1].reshape(-1)]) for turned in range(4)]


def fit_neighbours(corners_m: Array, pixels: Array) -> tuple[NDArray[np.bool_], float]:
    """Tell which markers (n,) lie where their neighbours see them, and the median error over the distance.

    Each marker's own corners make a plane's picture, good enough to place what is next to it through any lens.
    """
    middles, seen = corners_m.mean(axis=1), pixels.mean(axis=1)
    errors = np.full((len(corners_m), _AROUND), np.nan)
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=2)
    for i, (corners, quad) in enumerate(zip(corners_m, pixels, strict=True)):
        nearest = np.argsort(apart[i])[1 : 1 + _AROUND]
        homography = cv2.getPerspectiveTransform(quad.astype(np.float32), corners.astype(np.float32))
        there = cv2.perspectiveTransform(seen[nearest][None], homography)[0]
        errors[i, : len(nearest)] = np.linalg.norm(there - middles[nearest], axis=1) / apart[i, nearest]
    # a small marker's own corners are coarse: one neighbour in two may miss
    typical = np.sort(np.where(np.isfinite(errors), errors, np.inf), axis=1)[:, min(_AROUND, len(corners_m) - 1) // 2]
    inside: NDArray[np.bool_] = typical < _STRAY
    return inside, float(np.median(typical[inside])) if inside.any() else np.inf


def _crossings_of(board: Board, corners_m: Array, pixels: Array) -> tuple[NDArray[np.intp], Array]:
    """Return the crossings beside the markers: their ids (N,) and where they should be (N, 2), from the markers."""
    points = board.points_m[:, :2]
    reach = 1e-6 + (0.0 if board.kind == "aprilgrid" else np.sqrt(0.5) * (board.square_m - board.marker_m))
    total = np.zeros((len(points), 2))
    count = np.zeros(len(points))
    apart = np.linalg.norm(points[None, :, None] - corners_m[:, None], axis=3).min(axis=2)
    for corners, seen, near in zip(corners_m, pixels, apart <= 1.01 * reach, strict=True):
        if not near.any():
            continue
        homography = cv2.getPerspectiveTransform(corners.astype(np.float32), seen.astype(np.float32))
        total[near] += cv2.perspectiveTransform(points[near][None], homography)[0]
        count[near] += 1
    ids = np.flatnonzero(count)
    return ids, total[ids] / count[ids, None]


def _measured(grey: Grey, board: Board, ids: NDArray[np.intp], pixels: Array) -> Seen:
    """Measure the crossings that are known roughly, and then what is beside them on the board."""
    found: list[BoardView] = []
    tried = np.zeros(len(board.points_m), np.intp)
    for _ in range(_GROWTH):
        if not len(ids):
            break
        tried[ids] += 1
        axes, clear = _local_scale(board, ids, pixels, found)
        fitted = refine_crossings(grey, pixels, axes, clear)
        good = _like_the_board(board, ids, fitted)
        tried[ids[good]] = _TRIES
        found.append(BoardView(ids[good], fitted.pixels[good], fitted.sigma_px[good], fitted.blur_px[good]))
        if board.kind == "chessboard":
            break  # all of it or nothing
        ids, pixels = _beside(board, _joined(found), tried)
    view = _joined(found)
    if len(view.ids) < LEAST_CORNERS:
        return Seen(None, f"{len(view.ids)} sharp corners, {LEAST_CORNERS} are needed")
    places = board.points_m[view.ids, :2]
    if np.linalg.matrix_rank(places - places.mean(axis=0), tol=0.5 * board.square_m) < 2:
        return Seen(None, "all its corners are in one line")
    return Seen(view)


def _like_the_board(board: Board, ids: NDArray[np.intp], fitted: Crossings) -> NDArray[np.bool_]:
    """Which crossings (N,) are good, and black on the sides where the board has it."""
    good = fitted.good
    if not good.any():
        return good
    if board.kind == "aprilgrid":
        side = np.array([1.0, -1.0, 1.0, -1.0])[ids % 4]
    else:
        side = np.where((ids // (board.columns - 1) + ids % (board.columns - 1)) % 2, 1.0, -1.0)
    contrast = fitted.contrast * side
    typical = np.median(contrast[good])  # a chessboard has no first corner: its sign may be either
    alike: NDArray[np.bool_] = good & (contrast / typical > _LEAST_CONTRAST)
    return alike


def _joined(parts: list[BoardView]) -> BoardView:
    ids = np.concatenate([part.ids for part in parts])
    order = np.argsort(ids)
    fields = ("pixels", "sigma_px", "blur_px")
    return BoardView(ids[order], *(np.concatenate([getattr(part, name) for part in parts])[order] for name in fields))


def _beside(board: Board, view: BoardView, tried: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array]:
    """Return crossings still to be tried that are next to measured ones, and where they should be (N, 2)."""
    none = np.zeros(0, np.intp), np.zeros((0, 2))
    left = np.flatnonzero(tried < _TRIES)
    if len(view.ids) < LEAST_CORNERS or not len(left):
        return none
    points, known = board.points_m[:, :2], board.points_m[view.ids, :2]
    apart = np.linalg.norm(points[left][:, None] - known[None], axis=2)
    near = apart.min(axis=1) < 1.5 * board.pitch_m
    ids, pixels = [], []
    for i, distances in zip(left[near], apart[near], strict=True):
        nearest = np.argsort(distances)[:_NEIGHBOURS]
        homography, _ = cv2.findHomography(known[nearest], view.pixels[nearest], 0)
        if homography is None:
            continue
        ids.append(i)
        pixels.append(cv2.perspectiveTransform(points[i][None, None], homography)[0, 0])
    return (np.array(ids, np.intp), np.array(pixels)) if ids else none


def _local_scale(board: Board, ids: NDArray[np.intp], pixels: Array, found: list[BoardView]) -> tuple[Array, Array]:
    """Return the directions (N, 2, 2) of the board's axes at crossings, and the clear distance (N,), pixels.

    From the neighbours on the board, those found before too, so that a lens's bend is in them.
    """
    places = board.points_m[ids, :2]
    known = np.concatenate([places, *(board.points_m[view.ids, :2] for view in found)])
    seen = np.concatenate([pixels, *(view.pixels for view in found)])
    apart = np.linalg.norm(places[:, None] - known[None], axis=2)
    nearest = np.argsort(apart, axis=1)[:, 1:9]
    steps, moved = known[nearest] - places[:, None], seen[nearest] - pixels[:, None]
    # least squares of moved = steps @ axes; row k of axes is the picture of the board's axis k, pixels a metre
    square = steps.transpose(0, 2, 1) @ steps + 1e-12 * board.square_m**2 * np.eye(2)
    axes = np.linalg.solve(square, steps.transpose(0, 2, 1) @ moved)
    size = np.linalg.norm(axes, axis=2)
    # the nearest strange line is clear_m away along an axis; a tilted board brings it nearer
    height = np.abs(np.linalg.det(axes)) / np.maximum(size.max(axis=1), 1e-9)
    axes = np.where((size > 0)[..., None], axes, np.eye(2))
    return np.asarray(axes), np.asarray(board.clear_m * np.minimum(size.min(axis=1), height))
