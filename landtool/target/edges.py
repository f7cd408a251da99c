"""Where the printed edges of ring and H are in a picture, measured along their normals.

The tag is small and its two poses differ by a fraction of a pixel at its corners; the ring is six times as wide.
Edges are taken from the green channel, where red and black are both dark against white, in linear light, where the
middle of a blurred edge is where the edge is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.tone import Tone, linear_lut
from landtool.types import Image

_POINTS_ON_CIRCLE = 48
_SHARES_OF_SIDE = (0.15, 0.38, 0.62, 0.85)
_REACH_PX = 3.0
_STEP_PX = 0.5
# The window must not reach the next edge: this share of the narrowest printed stroke is its half width at the most
_SHARE_OF_STROKE = 0.45
_LEAST_REACH_PX = 1.5
_LEAST_FALL = 0.25  # of the strongest edges' fall; a weaker one is a shadow's, a blur's, or another thing's


@dataclass(frozen=True, eq=False)
class Edges:
    """Measured edges.

    normals: (N, 2) unit vectors in the image, into the dark side. offsets_px: (N,) how far along the normal the edge
    lies from where the pose has it. jacobian: (N, 6) how far the pose's own edge moves along the normal, in pixels,
    by a left perturbation (dt, dw) of the pose. share: of the edges in the picture that were seen.
    """

    normals: Array
    offsets_px: Array
    jacobian: Array
    share: float


def measure_edges(image: Image, camera: Camera, camera_T_pad: Pose, pad: PadSpec, tone: Tone) -> Edges | None:
    """Measure the pad's edges near where a pose has them; None when they are too small or out of the picture.

    image: (H, W, 3) BGR uint8 of the camera's size.
    """
    points, inward, stroke_m = _printed(pad)
    if not len(points):
        return None
    places, normals, jacobian = _projected(camera, camera_T_pad, points, inward)
    stroke_px = stroke_m * min(camera.fx, camera.fy) / camera_T_pad.translation[2]
    reach = min(_REACH_PX, _STEP_PX * np.floor(_SHARE_OF_STROKE * stroke_px / _STEP_PX))
    limit = np.array([camera.width, camera.height]) - (reach + 2.0)
    inside = ((places > reach + 1.0) & (places < limit)).all(axis=1)
    if reach < _LEAST_REACH_PX or inside.sum() < _POINTS_ON_CIRCLE // 2:
        return None
    distance = np.arange(-reach, reach + _STEP_PX / 2, _STEP_PX)
    profile = _profiles(image, places[inside], normals[inside], distance, tone)
    # the normal points into the dark: the edge lies where the light falls, its middle is the fall's centre
    fall = np.maximum(-np.diff(profile, axis=1), 0.0)
    total = fall.sum(axis=1)
    strong = np.partition(total, int(0.9 * len(total)))[int(0.9 * len(total))]
    seen = total > _LEAST_FALL * strong + 1e-6
    middle = (distance[1:] + distance[:-1]) / 2.0
    # squared, so that the noise of the bright side, larger in linear light, does not pull the centre there
    strength = fall[seen] ** 2
    offsets = strength @ middle / strength.sum(axis=1)
    return Edges(normals[inside][seen], offsets, jacobian[inside][seen], float(seen.sum() / inside.sum()))


def _profiles(image: Image, places: Array, normals: Array, distance: Array, tone: Tone) -> Array:
    """Sample linear light (N, S) of the green channel at distances (S,) along normals (N, 2) through places (N, 2)."""
    u, v = (places[:, None, :] + distance[:, None] * normals[:, None, :]).transpose(2, 0, 1)
    column, row = u.astype(np.int64), v.astype(np.int64)  # inside the picture, so never below zero
    right, down = u - column, v - row
    green, light = image[:, :, 1], linear_lut(tone)
    upper = (1.0 - right) * light[green[row, column]] + right * light[green[row, column + 1]]
    lower = (1.0 - right) * light[green[row + 1, column]] + right * light[green[row + 1, column + 1]]
    return np.asarray((1.0 - down) * upper + down * lower)


@lru_cache(maxsize=8)
def _printed(pad: PadSpec) -> tuple[Array, Array, float]:
    """Points (N, 2) on printed edges, unit normals (N, 2) into their dark side, and the narrowest stroke in metres."""
    places: list[Array] = []
    normals: list[Array] = []
    strokes: list[float] = []
    if pad.ring:
        angle = np.linspace(0.0, 2.0 * np.pi, _POINTS_ON_CIRCLE, endpoint=False)
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        places += [outward * (d * pad.diameter_m / 2.0) for d in (pad.ring.outer, pad.ring.inner)]
        normals += [-outward, outward]
        strokes.append((pad.ring.outer - pad.ring.inner) / 2.0)
        if pad.board:
            strokes.append((pad.board.side - pad.ring.outer) / 2.0)
    if pad.letter:
        on_letter, into_letter = _letter_edges(pad)
        places.append(on_letter)
        normals.append(into_letter)
        strokes.append(pad.letter.stroke)
    if not places:
        return np.zeros((0, 2)), np.zeros((0, 2)), 0.0
    return np.concatenate(places), np.concatenate(normals), min(strokes) * pad.diameter_m


def _letter_edges(pad: PadSpec) -> tuple[Array, Array]:
    """Points on the sides of the H that no quiet zone covers, and the normals into it."""
    outline = pad.letter_outline_m
    side = np.roll(outline, -1, axis=0) - outline
    x, y = outline.T
    turns_left = float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0.0
    normal = np.column_stack([-side[:, 1], side[:, 0]]) / np.linalg.norm(side, axis=1, keepdims=True)
    normal = normal if turns_left else -normal
    points = np.concatenate([outline + share * side for share in _SHARES_OF_SIDE])
    normals = np.concatenate([normal] * len(_SHARES_OF_SIDE))
    covered = pad.quiet_zone.side * pad.diameter_m / 2.0 if pad.quiet_zone else 0.0
    free = np.abs(points).max(axis=1) > covered * 1.15
    return points[free], normals[free]


def _projected(camera: Camera, camera_T_pad: Pose, points: Array, inward: Array) -> tuple[Array, Array, Array]:
    """Return the points' pixels (N, 2), unit normals (N, 2) in the image, and Jacobian (N, 6) along them by (dt, dw).

    NaN for what is not in front.
    """
    turned = points @ camera_T_pad.rotation[:, :2].T
    seen = turned + camera_T_pad.translation
    step = 1e-5 * float(camera_T_pad.translation[2])
    pixels = camera.project(np.concatenate([seen, seen + (step, 0.0, 0.0), seen + (0.0, step, 0.0)]))
    places, by_x, by_y = pixels.reshape(3, -1, 2)
    by_x, by_y = (by_x - places) / step, (by_y - places) / step
    # a point further out on the same ray is seen at the same place: x d/dx + y d/dy + z d/dz = 0
    x, y, z = seen.T[:, :, None]
    by_z = -(x * by_x + y * by_y) / z
    nx, ny, nz = (inward @ camera_T_pad.rotation[:, :2].T).T[:, :, None]
    normals = nx * by_x + ny * by_y + nz * by_z
    normals /= np.sqrt((normals**2).sum(axis=1, keepdims=True))
    gx, gy, gz = ((by * normals).sum(axis=1) for by in (by_x, by_y, by_z))
    # dp = dt + dw x q with q = R p, and g . (dw x q) = dw . (q x g)
    qx, qy, qz = turned.T
    jacobian = np.column_stack([gx, gy, gz, qy * gz - qz * gy, qz * gx - qx * gz, qx * gy - qy * gx])
    return places, normals, jacobian
