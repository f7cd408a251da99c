"""How well the large printed edges around the tag, ring and H, agree with a pose.

The two poses of a small tag differ by a fraction of a pixel at its own corners, but by whole pixels at the ring,
which is six times as wide. The edges are looked for along their normals, in the green channel: there red and black
are both dark against white.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.types import Image

_POINTS = 48  # on each circle and on the H
_REACH_PX = 3.0
_STEP_PX = 0.5
_LEAST_CONTRAST = 12.0  # grey levels across an edge that counts
_LEAST_EDGES = 12


def outline_misfit(image: Image, camera: Camera, camera_T_pad: Pose, *, pad: PadSpec) -> float | None:
    """Return the mean squared distance (px^2) of the edges seen from the edges a pose predicts.

    None where too few edges are in the picture, or the pad has neither ring nor H.
    """
    points, inward = _edges(pad)
    if not len(points):
        return None
    places, normals = _projected(camera, camera_T_pad, points, inward)
    limit = np.array([camera.width, camera.height]) - (_REACH_PX + 2.0)
    inside = ((places > _REACH_PX + 1.0) & (places < limit)).all(axis=1)
    if inside.sum() < _LEAST_EDGES:
        return None
    offsets = np.arange(-_REACH_PX, _REACH_PX + _STEP_PX / 2, _STEP_PX)
    grid = places[inside, None, :] + offsets[:, None] * normals[inside, None, :]
    x0, y0 = np.floor(grid.min(axis=(0, 1))).astype(int) - 1
    x1, y1 = np.ceil(grid.max(axis=(0, 1))).astype(int) + 2
    green = np.ascontiguousarray(image[max(y0, 0) : y1, max(x0, 0) : x1, 1])
    local = (grid - (max(x0, 0), max(y0, 0))).astype(np.float32)
    profile = cv2.remap(green, local, None, cv2.INTER_LINEAR).astype(np.float64)
    # the normal points into the dark side: the edge is where the profile falls
    fall = np.maximum(-np.diff(profile, axis=1), 0.0)
    seen = fall.sum(axis=1) > _LEAST_CONTRAST
    if seen.sum() < _LEAST_EDGES:
        return None
    middle = (offsets[1:] + offsets[:-1]) / 2.0
    distance = fall[seen] @ middle / fall[seen].sum(axis=1)
    return float(np.mean(distance**2))


@lru_cache(maxsize=8)
def _edges(pad: PadSpec) -> tuple[Array, Array]:
    """Points (N, 2) on printed edges and unit normals (N, 2) into their dark side, pad frame, metres."""
    places: list[Array] = []
    normals: list[Array] = []
    if pad.ring:
        angle = np.linspace(0.0, 2.0 * np.pi, _POINTS, endpoint=False)
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        for diameter, sign in ((pad.ring.outer, -1.0), (pad.ring.inner, 1.0)):
            places.append(outward * (diameter * pad.diameter_m / 2.0))
            normals.append(outward * sign)
    if pad.letter:
        outline = pad.letter_outline_m
        edge = np.roll(outline, -1, axis=0) - outline
        length = np.linalg.norm(edge, axis=1, keepdims=True)
        clockwise = _signed_area(outline) < 0.0
        inward = np.column_stack([-edge[:, 1], edge[:, 0]]) / length * (-1.0 if clockwise else 1.0)
        for share in (0.2, 0.4, 0.6, 0.8):
            places.append(outline + share * edge)
            normals.append(inward)
    if not places:
        return np.zeros((0, 2)), np.zeros((0, 2))
    return np.concatenate(places), np.concatenate(normals)


def _projected(camera: Camera, camera_T_pad: Pose, points: Array, inward: Array) -> tuple[Array, Array]:
    """Return the points' pixels (N, 2) and the unit normals (N, 2) in the image; NaN for what is not in front."""
    step = 1e-3 * float(np.abs(points).max())
    both = np.concatenate([points, points + step * inward])
    pixels = camera.project(camera_T_pad.apply(np.column_stack([both, np.zeros(len(both))])))
    places, moved = np.split(pixels, 2)
    normals = moved - places
    return places, np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _signed_area(polygon: Array) -> float:
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
