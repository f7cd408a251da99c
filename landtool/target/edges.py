"""Where the printed edges of ring and H are in a picture, measured along their normals.

The tag is small and its two poses differ by a fraction of a pixel at its corners; the ring is six times as wide.
Edges are taken from the green channel, where red and black are both dark against white, in linear light, where the
middle of a blurred edge is where the edge is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.tone import Tone, linear_lut
from landtool.types import Image

_POINTS_ON_CIRCLE = 48
_SHARES_OF_SIDE = (0.15, 0.38, 0.62, 0.85)
_REACH_PX = 3.0
STEP_PX = 0.5
# The window must not reach the next edge: this share of the narrowest printed stroke is its half width at the most
_SHARE_OF_STROKE = 0.45
LEAST_REACH_PX = 1.5
LEAST_EDGES = _POINTS_ON_CIRCLE // 2
_LEAST_FALL = 0.25  # of the strongest edges' fall; a weaker one is a shadow's, a blur's, or another thing's


@dataclass(frozen=True, eq=False)
class PrintedEdges:
    """Points on a pad's printed edges.

    points_m, inward: (N, 2) pad frame, the latter unit normals into the dark side. red: (N,) the dark side is the
    ring's, not the H's. stroke_m: the narrowest stroke.
    """

    points_m: Array
    inward: Array
    red: NDArray[np.bool_]
    stroke_m: float

    def reach_px(self, camera: Camera, camera_T_pad: Pose) -> float:
        """Return how far from an edge nothing else is printed, at most what is needed; pixels."""
        stroke_px = self.stroke_m * min(camera.fx, camera.fy) / camera_T_pad.translation[2]
        return float(min(_REACH_PX, STEP_PX * np.floor(_SHARE_OF_STROKE * stroke_px / STEP_PX)))


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
    printed = printed_edges(pad)
    if not len(printed.points_m):
        return None
    places, normals, jacobian = project_edges(camera, camera_T_pad, printed.points_m, printed.inward)
    reach = printed.reach_px(camera, camera_T_pad)
    inside = within(camera, places, reach)
    if reach < LEAST_REACH_PX or inside.sum() < LEAST_EDGES:
        return None
    distance = np.arange(-reach, reach + STEP_PX / 2, STEP_PX)
    profile = sample_profiles(image[:, :, 1], places[inside], normals[inside], distance, linear_lut(tone))
    fall, seen = falls(profile)
    offsets = centres(fall[seen], distance)
    return Edges(normals[inside][seen], offsets, jacobian[inside][seen], float(seen.sum() / inside.sum()))


def within(camera: Camera, places: Array, reach_px: float) -> NDArray[np.bool_]:
    """Return which places (N, 2) have their whole profile in the picture."""
    limit = np.array([camera.width, camera.height]) - (reach_px + 2.0)
    return np.asarray(((places > reach_px + 1.0) & (places < limit)).all(axis=1))


def falls(profile: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return how much the light of profiles (N, S) falls at each step (N, S - 1), and which show an edge (N,)."""
    # the normal points into the dark: the edge lies where the light falls
    fall = np.maximum(-np.diff(profile, axis=1), 0.0)
    total = fall.sum(axis=1)
    strong = np.partition(total, int(0.9 * len(total)))[int(0.9 * len(total))]
    return fall, total > _LEAST_FALL * strong + 1e-6


def centres(fall: Array, distance: Array) -> Array:
    """Return where on their normals edges lie (N,) whose light falls by `fall` (N, S - 1) between distances (S,)."""
    middle = (distance[1:] + distance[:-1]) / 2.0
    # squared, so that the noise of the bright side, larger in linear light, does not pull the centre there
    strength = fall**2
    return np.asarray(strength @ middle / strength.sum(axis=1))


def sample_profiles(
    plane: Image, places: Array, normals: Array, distance: Array, light: NDArray[np.floating[Any]]
) -> Array:
    """Sample light (N, S) at distances (S,) along normals (N, 2) through places (N, 2), all inside the picture.

    plane: (H, W) uint8. light: (256,) of its values.
    """
    u, v = (places[:, None, :] + distance[:, None] * normals[:, None, :]).transpose(2, 0, 1)
    column, row = u.astype(np.int64), v.astype(np.int64)  # inside the picture, so never below zero
    right, down = u - column, v - row
    upper = (1.0 - right) * light[plane[row, column]] + right * light[plane[row, column + 1]]
    lower = (1.0 - right) * light[plane[row + 1, column]] + right * light[plane[row + 1, column + 1]]
    return np.asarray((1.0 - down) * upper + down * lower)


@lru_cache(maxsize=8)
def printed_edges(pad: PadSpec) -> PrintedEdges:
    """Return points on the edges of ring and H; none without both."""
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
        return PrintedEdges(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.bool_), 0.0)
    points = np.concatenate(places)
    red = np.arange(len(points)) < (2 * _POINTS_ON_CIRCLE if pad.ring else 0)
    return PrintedEdges(points, np.concatenate(normals), red, min(strokes) * pad.diameter_m)


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


def project_edges(camera: Camera, camera_T_pad: Pose, points: Array, inward: Array) -> tuple[Array, Array, Array]:
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
