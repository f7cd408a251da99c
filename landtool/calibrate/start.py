"""Where the least squares begin: a camera without distortion, and the poses of boards before it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from landtool.calibrate.board import Board
from landtool.calibrate.corners import BoardView
from landtool.camera import COEFFICIENTS, Camera, DistortionModel
from landtool.errors import InputError
from landtool.geometry import Pose, rotation_from_rotvec

_HFOVS_DEG = (20.0, 35.0, 50.0, 65.0, 80.0, 95.0, 110.0, 130.0)


def first_camera(board: Board, views: Sequence[BoardView], size: tuple[int, int], model: DistortionModel) -> Camera:
    """Try fields of view without distortion, and keep the one with which the boards are nearest to planes."""
    width, height = size
    centre = (width - 1) / 2.0, (height - 1) / 2.0
    some = list(views)[:: max(1, len(views) // 12)]
    best: tuple[float, Camera] | None = None
    zeros = (0.0,) * COEFFICIENTS[model]
    for hfov in np.radians(_HFOVS_DEG):
        f = width / hfov if model == "equidistant" else width / 2.0 / np.tan(hfov / 2.0)
        camera = Camera(width, height, f, f, *centre, model, zeros)
        errors = [_view_error(board, view, camera) for view in some]
        error = float(np.median(errors))
        if np.isfinite(error) and (best is None or error < best[0]):
            best = error, camera
    if best is None:
        raise InputError("the corners lie as no board's picture does", hint="check --board and --squares")
    return best[1]


def _view_error(board: Board, view: BoardView, camera: Camera) -> float:
    pose = first_pose(board, view, camera)
    if pose is None:
        return np.inf
    apart = camera.project(pose.apply(board.points_m[view.ids])) - view.pixels
    error = np.sqrt((apart**2).sum(axis=1).mean())
    return float(error) if np.isfinite(error) else np.inf


def first_pose(board: Board, view: BoardView, camera: Camera) -> Pose | None:
    """Return camera_T_board from the corners alone; None where they have none."""
    flat = camera.normalize(view.pixels)
    held = np.isfinite(flat).all(axis=1)
    if held.sum() < 4:
        return None
    points = board.points_m[view.ids[held]]
    middle = points.mean(axis=0)
    try:
        found, turns, places, _ = cv2.solvePnPGeneric(
            points - middle, flat[held], np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return None
    if not found or not (np.isfinite(turns[0]).all() and np.isfinite(places[0]).all()) or places[0][2, 0] <= 0:
        return None
    rotation = rotation_from_rotvec(turns[0].reshape(3))
    return Pose(rotation, places[0].reshape(3) - rotation @ middle)
