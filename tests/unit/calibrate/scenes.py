"""Rendered views of boards with known cameras."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from landtool.calibrate.board import Board, BoardKind
from landtool.calibrate.corners import BoardView, find_board
from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.synth.board_view import Scene, board_pose, draw_board
from landtool.synth.sensor import Sensor
from landtool.types import Image

PINHOLE = Camera(640, 480, 520.0, 522.0, 315.0, 244.0, "plumb_bob", (-0.28, 0.09, 0.0008, -0.0005, 0.0))
FISHEYE = Camera(640, 480, 300.0, 301.0, 325.0, 236.0, "equidistant", (-0.02, 0.004, -0.002, 0.0002))
TELE = Camera(640, 480, 1100.0, 1102.0, 322.0, 239.0, "plumb_bob", (0.1, -0.2, 0.0, 0.0, 0.0))
CAMERAS = {"pinhole": PINHOLE, "fisheye": FISHEYE, "tele": TELE}
SENSOR = Sensor(psf_sigma_px=0.7, shot_variance=3e-4, read_variance=2e-5)
SIZE = (640, 480)


def straight(z_m: float = 0.3, board: Board | None = None) -> Pose:
    """The board square on, its middle on the axis."""
    board = board or Board()
    width, height = board.extent_m
    return Pose(np.eye(3), np.array([-width / 2.0, -height / 2.0, z_m]))


def picture(board: Board, camera: Camera, pose: Pose, sensor: Sensor = SENSOR) -> Image:
    return draw_board(Scene(board), camera, pose, sensor, np.random.default_rng(0))


@lru_cache(maxsize=16)
def views(kind: BoardKind, lens: str, count: int = 10, seed: int = 1) -> tuple[tuple[BoardView, Pose], ...]:
    """Views that were found, each with its true pose."""
    board, camera, rng = Board.usual(kind), CAMERAS[lens], np.random.default_rng(seed)
    found = []
    for _ in range(count):
        pose = board_pose(board, camera, rng, whole=kind == "chessboard")
        seen = find_board(draw_board(Scene(board), camera, pose, SENSOR, rng), board)
        if seen.view is not None:
            found.append((seen.view, pose))
    return tuple(found)
