"""How far the printed edges of ring and H lie from where a pose has them, all of them by the same into the dark.

The ring has an outer and an inner edge, the H's strokes have two sides: a shift s common to all edges is no size and
no distance of the pad, and is solved together with a step dx of the pose,

    o_i = J_i dx + s

with o_i the offset of edge i along its normal into the dark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.target.edges import (
    LEAST_EDGES,
    LEAST_REACH_PX,
    STEP_PX,
    PrintedEdges,
    centres,
    falls,
    project_edges,
    sample_profiles,
    within,
)
from landtool.tone import Tone, decode, encode
from landtool.types import Image

_LEAST_SHARE = 0.6  # of the edges in the picture
_WHITE, _BLACK = 246, 1  # grey levels: light cut off there is not all of it
_LUMA = np.array([0.114, 0.587, 0.299])  # ITU-R BT.601, as JPEG and video have it, blue first
_SHARES, _TABLE = (-0.1, 1.25), 136  # of the bright side's light, noise beyond both sides included
_MOST_OFF_PX = 1.5
_MOST_SCATTER_PX = 0.35
_HUBER, _HUBER_ROUNDS = 2.0, 4
_LEAST_SCATTER_PX = 0.01
_MOST_CONDITION = 1e3  # edges that face one way cannot tell a shift from a pose
_POSE_ROUNDS, _REST_PX = 4, 0.05
# Variances that sampling adds to an edge's: a pixel's area, its interpolation, the step
_SAMPLED_PX2 = 1.0 / 12.0 + 1.0 / 6.0 + STEP_PX**2 / 12.0


@dataclass(frozen=True)
class Shift:
    """What all edges have in common by one tone curve.

    shift_px: towards the dark. sigma_px: its standard error. blur_px: standard deviation of the light's spread across
    an edge, the pixel's own area not counted.
    """

    shift_px: float
    sigma_px: float
    blur_px: float


@dataclass(frozen=True, eq=False)
class EdgeProfiles:
    """The profiles of N edges in one picture, to be looked at by any tone curve.

    luma: (H, W) what codecs keep sharp, where they smear colours. red: (N,) edges of the ring, not the H. ends: for
    those of the ring and of the H the encoded colours (2, 3) on both sides, blue first, in [0, 1]. places, normals:
    (N, 2). jacobian: (N, 6). used: (N,) those between lights that are neither burnt out nor black.
    """

    luma: Image
    ends: tuple[Array, Array]
    places: Array
    normals: Array
    jacobian: Array
    red: NDArray[np.bool_]
    used: NDArray[np.bool_]
    distance: Array

    def shift(self, tone: Tone) -> Shift | None:
        """Return the shift by a tone curve; None when too few edges are seen or no pose explains them."""
        found = self._solve(tone)
        return found and found[1]

    def _solve(self, tone: Tone) -> tuple[Array, Shift] | None:
        """Return the step (6,) of the pose, too."""
        fall, seen = falls(self._light(tone))
        if seen.sum() < _LEAST_SHARE * len(seen):
            return None
        offsets = np.zeros(len(fall))
        offsets[seen] = centres(fall[seen], self.distance)
        good = seen & self.used & (np.abs(offsets) < _MOST_OFF_PX)
        if good.sum() < max(LEAST_EDGES, _LEAST_SHARE * len(good)):
            return None
        solved = _solved(np.column_stack([self.jacobian[good], np.ones(int(good.sum()))]), offsets[good])
        if solved is None:
            return None
        x, sigma_px = solved
        return x[:6], Shift(float(x[6]), sigma_px, _blur_px(fall[good]))

    def _light(self, tone: Tone) -> Array:
        out = np.empty((len(self.places), len(self.distance)))
        for part, ends in zip((self.red, ~self.red), self.ends, strict=True):
            if part.any():
                table = _light_of_luma(ends, tone)
                out[part] = sample_profiles(self.luma, self.places[part], self.normals[part], self.distance, table)
        return out


def edge_profiles(
    image: Image, camera: Camera, camera_T_pad: Pose, printed: PrintedEdges, tone: Tone
) -> EdgeProfiles | None:
    """Return the edges' profiles at a pose refined on them with the shift free.

    None when they are too small, too few, out of the picture, burnt out, or no pose explains them.
    image: (H, W, 3) BGR uint8 of the camera's size. camera_T_pad: within a pixel or so. tone: to refine the pose by.
    """
    pose, luma = camera_T_pad, np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    for _ in range(_POSE_ROUNDS):
        profiles = _profiles_at(image, luma, camera, pose, printed)
        found = profiles._solve(tone) if profiles is not None else None
        if profiles is None or found is None:
            return None
        step = found[0]
        if np.abs(profiles.jacobian @ step).max() < _REST_PX:
            return profiles
        pose = pose.perturbed(step)
    return None


def _profiles_at(image: Image, luma: Image, camera: Camera, pose: Pose, printed: PrintedEdges) -> EdgeProfiles | None:
    places, normals, jacobian = project_edges(camera, pose, printed.points_m, printed.inward)
    reach = printed.reach_px(camera, pose)
    inside = within(camera, places, reach)
    if reach < LEAST_REACH_PX or inside.sum() < LEAST_EDGES:
        return None
    places, normals, red = places[inside], normals[inside], printed.red[inside]
    values, ends_px = np.arange(256) / 255.0, np.array([-reach, reach])
    # (N, 2, 3): the colours on the bright and the dark side
    colors = np.stack([sample_profiles(image[:, :, c], places, normals, ends_px, values) for c in range(3)], axis=2)
    used = (colors[:, 0].max(axis=1) < _WHITE / 255.0) & (colors[:, 1].max(axis=1) > _BLACK / 255.0)
    if used.sum() < LEAST_EDGES:
        return None
    ring, letter = (np.median(colors[part], axis=0) if part.any() else np.zeros((2, 3)) for part in (red, ~red))
    distance = np.arange(-reach, reach + STEP_PX / 2, STEP_PX)
    return EdgeProfiles(luma, (ring, letter), places, normals, jacobian[inside], red, used, distance)


def _light_of_luma(ends: Array, tone: Tone) -> Array:
    """Return for the values (256,) of luma how much of the bright side's light is in them: 1 there, 0 on the dark one.

    ends: (2, 3) encoded colours of both sides, blue first. Luma is a sum of encoded colours, each of mixed light:
    Y(a) = sum_c w_c encode(a decode(bright_c) + (1 - a) decode(dark_c)), to be solved for a.
    """
    bright, dark = decode(ends, tone)
    share = np.linspace(*_SHARES, _TABLE)[:, None]
    luma = encode(share * bright + (1.0 - share) * dark, tone) @ _LUMA
    # towards black and white, where the curve is cut off, it no longer rises
    return np.interp(np.arange(256) / 255.0, np.maximum.accumulate(luma), share[:, 0])


def _solved(design: Array, offsets: Array) -> tuple[Array, float] | None:
    """Return least squares by Huber's weights and the standard error of the last unknown; None for a poor fit."""
    scale = np.linalg.norm(design, axis=0)  # metres and radians have little in common
    design = design / scale
    if np.linalg.cond(design) > _MOST_CONDITION:
        return None
    weight = np.ones(len(offsets))
    for _ in range(_HUBER_ROUNDS):
        normal = (design * weight[:, None]).T @ design
        x = np.linalg.solve(normal, design.T @ (weight * offsets))
        left = np.abs(offsets - design @ x)
        sigma = max(1.4826 * float(np.median(left)), _LEAST_SCATTER_PX)
        weight = np.minimum(1.0, _HUBER * sigma / np.maximum(left, 1e-9))
    if sigma > _MOST_SCATTER_PX:
        return None
    return x / scale, sigma * math.sqrt(float(np.linalg.inv(normal)[-1, -1])) / float(scale[-1])


def _blur_px(fall: Array) -> float:
    # a Gaussian's square has the integral 1 / (2 sqrt(pi) sigma)
    total = fall.sum(axis=1) ** 2 * STEP_PX
    sigma_px = float(np.median(total / (2.0 * math.sqrt(math.pi) * (fall**2).sum(axis=1))))
    return math.sqrt(max(sigma_px**2 - _SAMPLED_PX2, 0.0))
