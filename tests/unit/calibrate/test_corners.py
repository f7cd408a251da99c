from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from landtool.calibrate.board import KINDS, Board, BoardKind
from landtool.calibrate.corners import find_board
from landtool.synth.sensor import Sensor
from tests.unit.calibrate.scenes import CAMERAS, FISHEYE, PINHOLE, picture, straight, views


def errors(kind: BoardKind, lens: str) -> np.ndarray:
    """Distances of found corners from the truth, pixels; a chessboard may be found turned by 180 degrees."""
    board, camera = Board.usual(kind), CAMERAS[lens]
    apart = []
    for view, pose in views(kind, lens):
        truth = camera.project(pose.apply(board.points_m))
        tries = [truth[view.ids], truth[::-1][view.ids]] if kind == "chessboard" else [truth[view.ids]]
        apart.append(min((np.linalg.norm(view.pixels - t, axis=1) for t in tries), key=np.median))
    return np.concatenate(apart)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lens", ["pinhole", "fisheye"])
def test_corners_are_where_they_are(kind: BoardKind, lens: str) -> None:
    found = errors(kind, lens)
    assert len(found) > 500
    assert np.median(found) < 0.05
    assert np.quantile(found, 0.99) < 0.35


@pytest.mark.parametrize("kind", KINDS)
def test_a_tone_curve_or_blur_does_not_move_them(kind: BoardKind) -> None:
    board = Board.usual(kind)
    pose = straight(0.3, board)
    truth = PINHOLE.project(pose.apply(board.points_m))
    for sensor in (
        Sensor(psf_sigma_px=0.8, gamma=1.4),
        Sensor(psf_sigma_px=1.0),
        Sensor(psf_sigma_px=0.8, contrast=0.8),
    ):
        view = find_board(picture(board, PINHOLE, pose, sensor), board).view
        assert view is not None
        shift = view.pixels - truth[view.ids]
        if kind == "chessboard" and np.abs(shift).max() > 5:
            shift = view.pixels - truth[::-1][view.ids]
        assert np.abs(np.median(shift, axis=0)).max() < 0.01
        assert np.median(np.linalg.norm(shift, axis=1)) < 0.1


def test_its_sigma_tells_the_error() -> None:
    board = Board.usual("aprilgrid")
    z = []
    for view, pose in views("aprilgrid", "pinhole"):
        truth = PINHOLE.project(pose.apply(board.points_m))[view.ids]
        z.append(((view.pixels - truth) / view.sigma_px[:, None]).ravel())
    assert 0.5 < np.median(np.abs(np.concatenate(z))) / 0.6745 < 2.0


def test_part_of_a_board_is_enough() -> None:
    board = Board()
    image = picture(board, PINHOLE, straight(0.3)).copy()
    image[:, :320] = 90
    view = find_board(image, board).view
    assert view is not None
    assert 20 < len(view.ids) < 60


def test_an_aprilgrid_of_other_order_is_read() -> None:
    board = Board.usual("aprilgrid")
    image = picture(board, PINHOLE, straight(0.3, board))
    turned = np.ascontiguousarray(image[::-1, ::-1])
    view = find_board(turned, board).view
    assert view is not None
    assert len(view.ids) == len(board.points_m)


@pytest.mark.parametrize(
    ("board", "said"),
    [
        (Board("chessboard"), "board not found"),
        (Board("aprilgrid", 6, 8, 0.022), "no marker read"),
        (Board("charuco", 7, 11), "its markers do not lie as the board's do"),
    ],
)
def test_another_board_is_not_found(board: Board, said: str) -> None:
    seen = find_board(picture(Board(), PINHOLE, straight(0.3)), board)
    assert seen.view is None
    assert seen.reason == said


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_found_in_nothing(kind: BoardKind) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)
    for image in (noise, np.zeros((48, 64, 3), np.uint8)):
        assert find_board(image, Board.usual(kind)).view is None


def test_opencvs_corner_search_is_no_better() -> None:
    board, camera = Board.usual("charuco"), FISHEYE
    ours, theirs = [], []
    for view, pose in views("charuco", "fisheye")[:6]:
        truth = camera.project(pose.apply(board.points_m))[view.ids]
        grey = cv2.cvtColor(picture(board, camera, pose), cv2.COLOR_BGR2GRAY)
        again = find_board(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), board).view
        assert again is not None
        start = camera.project(pose.apply(board.points_m))[again.ids].astype(np.float32)
        found = cv2.cornerSubPix(grey, start[:, None].copy(), (3, 3), (-1, -1), (3, 30, 0.001))[:, 0]
        same = camera.project(pose.apply(board.points_m))[again.ids]
        ours.append(np.linalg.norm(again.pixels - same, axis=1))
        theirs.append(np.linalg.norm(found - same, axis=1))
        assert len(truth)
    assert np.median(np.concatenate(ours)) < np.median(np.concatenate(theirs))


def test_a_board_far_away_is_not_made_up() -> None:
    board = replace(Board(), square_m=0.002, marker_m=0.0015)
    assert find_board(picture(board, PINHOLE, straight(0.5, board)), board).view is None
