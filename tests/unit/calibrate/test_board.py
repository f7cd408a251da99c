from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.calibrate.board import KINDS, Board, BoardKind, marker_modules
from landtool.errors import InputError, UsageError


def drawn(board: Board, scale: float) -> np.ndarray:
    """The board's rectangles as a picture, `scale` pixels a metre."""
    boxes = np.rint((board.rectangles_m() - board.rectangles_m()[:, :2].min()) * scale).astype(int)
    image = np.full((boxes[:, 3].max(), boxes[:, 2].max()), 255, np.uint8)
    for x0, y0, x1, y1 in boxes:
        image[y0:y1, x0:x1] = 0
    return image


@pytest.mark.parametrize("rows", [7, 8])
def test_a_charuco_board_is_opencvs(rows: int) -> None:
    board = Board("charuco", 6, rows, 0.028, 0.021)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
    theirs = cv2.aruco.CharucoBoard((6, rows), 0.028, 0.021, dictionary)
    image = theirs.generateImage((6 * 56, rows * 56), marginSize=0, borderBits=1)
    ours = drawn(board, 2000.0)
    assert ours.shape == image.shape
    assert ((ours > 127) == (image > 127)).mean() > 0.999
    np.testing.assert_allclose(board.points_m, theirs.getChessboardCorners(), atol=1e-7)


def test_a_white_first_board_is_opencvs_legacy_pattern() -> None:
    board = Board("charuco", 6, 8, 0.028, 0.021, white_first=True)
    theirs = cv2.aruco.CharucoBoard((6, 8), 0.028, 0.021, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000))
    theirs.setLegacyPattern(True)
    image = theirs.generateImage((6 * 56, 8 * 56), marginSize=0, borderBits=1)
    assert ((drawn(board, 2000.0) > 127) == (image > 127)).mean() > 0.999


def test_an_aprilgrid_is_kalibrs() -> None:
    board = Board("aprilgrid", 3, 2, 0.02, spacing=0.3)
    image = drawn(board, 1000.0)
    # tags of 20 mm begin after a corner square of 6 mm; two black modules of 2 mm around six
    assert image.shape == (2 * 26 + 6, 3 * 26 + 6)
    assert not image[6:10, 6:26].any()
    assert not image[:6, :6].any()
    assert image[:6, 6:26].all()
    assert marker_modules(board, 0).shape == (10, 10)
    # ids from the bottom left, as Kalibr counts
    assert board.marker_places.tolist()[:4] == [[0, 1], [1, 1], [2, 1], [0, 0]]


@pytest.mark.parametrize("kind", KINDS)
def test_its_toml_makes_an_equal_board(kind: BoardKind, tmp_path: Path) -> None:
    for board in (Board.usual(kind), replace(Board.usual(kind), columns=7, square_m=0.0191)):
        path = tmp_path / "board.toml"
        path.write_text(board.to_toml())
        assert Board.read(path) == board


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kind = 'checker'", "no board 'checker'; known: chessboard"),
        ("columns = 4", "holds no board's kind"),
        ("kind = 'charuco'\nsquare = 0.02", "unknown key 'square'"),
        ("kind = 'charuco'\ncolumns = 4.5", "columns = 4.5 is no int"),
        ("kind = 'charuco'\ncolumns = true", "columns = True is no int"),
        ("kind = 'charuco'\nmarker_m = 0.02", "markers of 0.02 m in squares of 0.02 m"),
        ("kind = charuco", "is no TOML"),
    ],
)
def test_a_file_that_is_no_board(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "board.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        Board.read(path)
    assert caught.value.file == str(path)


@pytest.mark.parametrize(
    "values",
    [
        {"columns": 2},
        {"rows": 101},
        {"square_m": 0.0},
        {"square_m": float("nan")},
        {"dictionary": "3x3"},
        {"columns": 90, "rows": 90},
        {"kind": "aprilgrid", "spacing": 0.0},
        {"kind": "circles"},
    ],
)
def test_boards_that_cannot_be(values: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        replace(Board(), **values)  # type: ignore[arg-type]


def test_a_first_white_square_needs_an_even_number_of_rows() -> None:
    with pytest.raises(UsageError, match="a board of 8x11 whose first square is white"):
        Board(white_first=True)
