"""Pictures of a calibration board, drawn as a camera sees it: every pixel the mean of the light that falls on it.

A pixel's rays are cut with the board's plane and looked up in the exact pattern, so the crossings are where
`Camera.project` puts them; blur and noise come from `landtool.synth.sensor`, in linear light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.calibrate.board import Board
from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.synth.sensor import Sensor
from landtool.types import Image

Map = NDArray[np.float32]
_FINE = 4  # rays a pixel, each way
_PAPER, _INK = 0.82, 0.035  # light of white paper and of printed black, white at 1
_MARGIN = 0.6  # of white around the pattern, squares
_LONGEST_SIDE = 4000  # of the table of the pattern


@dataclass(frozen=True)
class Scene:
    """A board before a wall. slope: how much the light changes over a board's diagonal, one way and the other."""

    board: Board
    wall: float = 0.25
    slope: tuple[float, float] = (0.15, -0.1)


def draw_board(scene: Scene, camera: Camera, camera_T_board: Pose, sensor: Sensor, rng: np.random.Generator) -> Image:
    """Return the picture (H, W, 3) BGR of the board at a pose."""
    light = np.full((camera.height, camera.width), scene.wall, np.float32)
    light *= _grain(camera.width, camera.height)
    x0, y0, x1, y1 = _box(scene.board, camera, camera_T_board)
    if x1 > x0 and y1 > y0:
        _draw_into(light, scene, camera, camera_T_board, (x0, y0, x1, y1))
    return sensor.picture(np.repeat(light[..., None], 3, axis=2), rng)


def _draw_into(light: Map, scene: Scene, camera: Camera, pose: Pose, box: tuple[int, int, int, int]) -> None:
    board = scene.board
    x0, y0, x1, y1 = box
    u, v = _rays(camera)
    part = np.s_[y0 * _FINE : y1 * _FINE, x0 * _FINE : x1 * _FINE]
    u, v = u[part], v[part]
    # a ray (u, v, 1) meets the plane X e1 + Y e2 + t: [e1 e2 t]^-1 (u, v, 1) is (X, Y, 1) times 1 / depth
    inverse = np.linalg.inv(np.column_stack([pose.rotation[:, :2], pose.translation])).astype(np.float32)
    x, y, w = (inverse[i, 0] * u + inverse[i, 1] * v + inverse[i, 2] for i in range(3))
    ahead = w > 0
    w = np.where(ahead, w, np.float32(1.0))
    x, y = x / w, y / w
    table, left, top, scale = _pattern(board)
    column, row = (x - left) * scale - 0.5, (y - top) * scale - 0.5
    outside = 255
    column = np.where(ahead, column, -10.0)
    looked = cv2.remap(
        table,
        column.astype(np.float32),
        row.astype(np.float32),
        cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=outside,
    )
    width, height = board.extent_m
    lit = 1.0 + scene.slope[0] * (x / width - 0.5) + scene.slope[1] * (y / height - 0.5)
    on = np.where(looked == 1, _INK, _PAPER) * lit
    behind = np.repeat(np.repeat(light[y0:y1, x0:x1], _FINE, axis=0), _FINE, axis=1)
    fine = np.where(looked == outside, behind, on).astype(np.float32)
    light[y0:y1, x0:x1] = fine.reshape(y1 - y0, _FINE, x1 - x0, _FINE).mean(axis=(1, 3))


@lru_cache(maxsize=2)
def _rays(camera: Camera) -> tuple[Map, Map]:
    """Return x/z and y/z (FINE H, FINE W) of the camera's rays; far aside where the lens has none."""
    edge = 3
    y, x = np.mgrid[-edge : camera.height + edge, -edge : camera.width + edge].astype(np.float64)
    flat = camera.normalize(np.column_stack([x.ravel(), y.ravel()]))
    # what the lens model folds back is no ray
    again = camera.project(np.column_stack([flat, np.ones(len(flat))]))
    off = ~(np.abs(again - np.column_stack([x.ravel(), y.ravel()])) < 0.01).all(axis=1)
    flat[off] = 1e4
    column, row = _samples(camera.width, camera.height)
    maps = []
    for i in (0, 1):
        plane = flat[:, i].reshape(x.shape).astype(np.float32)
        maps.append(np.asarray(cv2.remap(plane, column + edge, row + edge, cv2.INTER_CUBIC), np.float32))
    return maps[0], maps[1]


def _samples(width: int, height: int) -> tuple[Map, Map]:
    """Return where in the picture the rays go, columns and rows (FINE H, FINE W).

    The grid of a pixel is sheared, so that its rays lie in FINE^2 columns and as many rows: an edge along the
    picture's own lines is then no coarser than a slanting one.
    """
    step = (np.arange(_FINE) + 0.5) / _FINE - 0.5
    x = (np.arange(width)[:, None] + step).ravel()
    y = (np.arange(height)[:, None] + step).ravel()
    column = x[None, :] + np.tile(step / _FINE, height)[:, None]
    row = y[:, None] + np.tile(step / _FINE, width)[None, :]
    return column.astype(np.float32), row.astype(np.float32)


@lru_cache(maxsize=4)
def _pattern(board: Board) -> tuple[Image, float, float, float]:
    """Return the pattern (h, w) with 1 where it is black, the place of its top left in metres, and samples a metre."""
    boxes = board.rectangles_m()
    rim = _MARGIN * board.square_m
    left, top = boxes[:, 0].min() - rim, boxes[:, 1].min() - rim
    right, bottom = boxes[:, 2].max() + rim, boxes[:, 3].max() + rim
    most = _LONGEST_SIDE / max(right - left, bottom - top)
    # so many samples a square that every edge of the pattern lies between two of them, or as nearly as can be
    counts = np.arange(40, max(41, int(most * board.square_m)))
    edges = np.unique(np.round((boxes - boxes[:, :2].min()) / board.square_m, 9))
    strays = [float(np.abs(edges * n - np.rint(edges * n)).max() / n) for n in counts]
    scale = float(counts[int(np.argmin(np.round(strays, 9)))]) / board.square_m
    first = np.rint(rim * scale)
    left, top = boxes[:, 0].min() - first / scale, boxes[:, 1].min() - first / scale
    shape = math.ceil((bottom - top) * scale), math.ceil((right - left) * scale)
    table = np.zeros(shape, np.uint8)
    for x0, y0, x1, y1 in np.rint((boxes - (left, top, left, top)) * scale).astype(int):
        table[y0:y1, x0:x1] = 1
    table.setflags(write=False)
    return table, float(left), float(top), scale


@lru_cache(maxsize=2)
def _grain(width: int, height: int) -> Map:
    """Return the wall's unevenness (H, W) about 1."""
    noise = np.random.default_rng(3).standard_normal((height // 24 + 2, width // 24 + 2)).astype(np.float32)
    return np.asarray(1.0 + 0.15 * np.clip(cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC), -2, 2))


def _box(board: Board, camera: Camera, pose: Pose) -> tuple[int, int, int, int]:
    """Return the pixels x0 y0 x1 y1 that may see the board."""
    boxes = board.rectangles_m()
    rim = 1.2 * _MARGIN * board.square_m
    low, high = boxes[:, :2].min(axis=0) - rim, boxes[:, 2:].max(axis=0) + rim
    x, y = np.meshgrid(np.linspace(low[0], high[0], 24), np.linspace(low[1], high[1], 24))
    pixels = camera.project(pose.apply(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])))
    if not np.isfinite(pixels).all():
        return 0, 0, camera.width, camera.height
    (x0, y0), (x1, y1) = np.floor(pixels.min(axis=0)) - 4, np.ceil(pixels.max(axis=0)) + 5
    return max(int(x0), 0), max(int(y0), 0), min(int(x1), camera.width), min(int(y1), camera.height)


def board_pose(board: Board, camera: Camera, rng: np.random.Generator, *, whole: bool) -> Pose:
    """Draw camera_T_board: any place in the picture, near and far, tilted up to 45 degrees.

    whole: all of the print is in the picture; else its middle and three quarters of its crossings are.
    """
    middle = np.array([*(v / 2.0 for v in board.extent_m), 0.0])
    edge = 4.0
    for trial in range(4000):
        axis = rng.uniform(0.0, 2.0 * np.pi)
        tilt = np.radians(rng.uniform(0.0, 45.0))
        turn = rng.normal(0.0, 0.35) + (np.pi / 2.0 if rng.random() < 0.3 else 0.0)
        rotation = rotation_from_rotvec(tilt * np.array([np.cos(axis), np.sin(axis), 0.0])) @ rotation_from_rotvec(
            np.array([0.0, 0.0, turn])
        )
        pixel = rng.uniform((0.12, 0.12), (0.88, 0.88)) * (camera.width, camera.height)
        ray = camera.unproject(pixel[None])[0]
        if not np.isfinite(ray).all():
            continue
        # seen square on from there, it spans this share of the picture's width
        share = rng.uniform(0.3, 0.85) * (1.0 if trial < 2000 else 0.7)
        distance = max(board.extent_m) * camera.fx / (share * camera.width)
        # the board faces the camera where it is, not where the axis is
        facing = _turn_to(ray) @ rotation
        pose = Pose(facing, ray * distance - facing @ middle)
        pixels = camera.project(pose.apply(board.points_m))
        with np.errstate(invalid="ignore"):
            inside = ((pixels > edge) & (pixels < np.array([camera.width, camera.height]) - 1 - edge)).all(axis=1)
        if (inside.all() if whole else inside.mean() > 0.75) and (pose.apply(board.points_m)[:, 2] > 0).all():
            return pose
    raise AssertionError("a board fits no picture")


def _turn_to(ray: Array) -> Array:
    """Return the shortest turn (3, 3) that takes the optical axis to a unit ray."""
    axis = np.cross([0.0, 0.0, 1.0], ray)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return np.eye(3)
    return rotation_from_rotvec(axis / sine * math.atan2(sine, float(ray[2])))
