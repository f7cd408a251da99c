"""Where the sun does not reach: shadows on the ground and on the pad, and the dimness under and beside bodies."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.mesh import Mesh
from landtool.synth.raster import Faces, filled, on_picture, window_of
from landtool.synth.scene import Sun
from landtool.synth.view import View

Share = NDArray[np.float32]
_HIGHEST_SUN_STEP = 0.05  # a sun lower than this share of its length throws shadows without end
_SHARPEST_PX, _SOFTEST_PX = 0.45, 24.0
# bodies dim the ground within about this share of their height, by at most so much
_DIM_REACH, _DIM_MOST = 0.35, 0.55
_LEFT = (1.0 - np.arange(256) / 255.0).astype(np.float32)
_LEFT_OF_SKY = (1.0 - _DIM_MOST * np.arange(256) / 255.0).astype(np.float32)
# a Gaussian this narrow is blurred at full size
_FINEST_SIGMA_PX = 1.25


def lit(view: View, sun: Sun, meshes: Iterable[Mesh], z_m: float, depth_m: float) -> Share:
    """Return the share (H, W) of the sun's light that reaches the level plane at height z_m.

    meshes: what throws shadows, in the world; parts below the plane throw none. depth_m: a usual distance of the
    plane along the optical axis, which says how wide a penumbra is on the picture.
    """
    shape = (view.camera.height, view.camera.width)
    reaching = np.ones(shape, np.float32)
    if not any(sun.sun) or sun.direction[2] < _HIGHEST_SUN_STEP:
        return reaching if any(sun.sun) else np.zeros(shape, np.float32)
    parts: list[Faces] = []
    levels: list[int] = []
    for mesh in meshes:
        if mesh.casts:
            fallen = _fallen(mesh, sun, z_m)
            if fallen is not None:
                parts.append(fallen)
                level = round(2.0 * math.log2(_softness_px(view, sun, mesh, z_m, depth_m)))
                levels += [level] * len(fallen.counts)
    _darken(reaching, view, Faces.joined(parts), levels, {level: 2.0 ** (level / 2.0) for level in levels}, _LEFT)
    return reaching


def openness(view: View, meshes: Iterable[Mesh], depth_m: float) -> Share:
    """Return the share (H, W) of the sky's light that reaches the ground beside bodies that stand on it."""
    polygons: list[Array] = []
    levels: list[int] = []
    for mesh in meshes:
        low, high = mesh.points_m[:, 2].min(), mesh.points_m[:, 2].max()
        if mesh.closed and low < 0.6 and high > 0.03:
            hull = cv2.convexHull(mesh.points_m[:, :2].astype(np.float32)).reshape(-1, 2)
            reach_px = _DIM_REACH * high * view.camera.fx / max(depth_m, 0.1)
            polygons.append(np.column_stack([hull, np.zeros(len(hull))]))
            levels.append(round(math.log2(float(np.clip(reach_px, 1.0, _SOFTEST_PX)))))
    free = np.ones((view.camera.height, view.camera.width), np.float32)
    _darken(free, view, Faces.of(polygons), levels, {level: 2.0**level for level in levels}, _LEFT_OF_SKY)
    return free


def _darken(
    share: Share, view: View, faces: Faces, levels: list[int], sigmas_px: dict[int, float], left: Share
) -> None:
    """Multiply a share (H, W) by what faces leave, those of a level together and blurred; left: by coverage."""
    outlines: dict[int, list[Array]] = defaultdict(list)
    for level, outline in zip(levels, on_picture(view, faces), strict=True):
        if outline is not None:
            outlines[level].append(outline)
    for level, members in outlines.items():
        window = window_of(view, members, 3.0 * sigmas_px[level])
        if window is not None:
            mask = softened(filled(members, window, 1), sigmas_px[level])
            share[window] *= cv2.LUT(mask, left)


def softened(mask: NDArray[np.uint8], sigma_px: float) -> NDArray[np.uint8]:
    """Return a mask (H, W) blurred by a Gaussian; a wide one is blurred on a smaller picture."""
    shrink = 1 << max(0, math.floor(math.log2(sigma_px / _FINEST_SIGMA_PX)))
    if shrink == 1:
        return np.asarray(cv2.GaussianBlur(mask, (0, 0), sigma_px), dtype=np.uint8)
    height, width = mask.shape
    small = cv2.resize(mask, (-(-width // shrink), -(-height // shrink)), interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(small, (0, 0), sigma_px / shrink)
    return np.asarray(cv2.resize(blurred, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _softness_px(view: View, sun: Sun, mesh: Mesh, z_m: float, depth_m: float) -> float:
    height = max(float(mesh.points_m[:, 2].mean()) - z_m, 0.0)
    # the penumbra lies as far from its caster as the light's way down, so a low sun widens it
    width_m = sun.softness * height / sun.direction[2]
    px = 0.5 * width_m * view.camera.fx / max(depth_m, 0.1)
    return float(np.clip(px, _SHARPEST_PX, _SOFTEST_PX))


def _fallen(mesh: Mesh, sun: Sun, z_m: float) -> Faces | None:
    """Return the shadow that a mesh throws on the plane at height z_m, None when it throws none."""
    above = np.maximum(mesh.points_m[:, 2] - z_m, 0.0)
    if not above.any():
        return None
    thrown = _thrown(mesh.points_m, above, sun, z_m)
    if not mesh.closed:
        counts = np.array([len(face) for face in mesh.faces], np.intp)
        resting = np.zeros((len(counts), 3))
        return Faces(thrown[np.concatenate(mesh.faces)], counts, np.ones(len(counts), np.intp), resting)
    if not above.all():
        # what lies under the plane is cut off there, roughly: below each point above it
        upper = above > 0.0
        thrown = np.concatenate([thrown[upper], _thrown(mesh.points_m[upper], 0.0 * above[upper], sun, z_m)])
    hull = cv2.convexHull(thrown[:, :2].astype(np.float32)).reshape(-1, 2).astype(np.float64)
    return Faces.of([np.column_stack([hull, np.full(len(hull), z_m)])]) if len(hull) >= 3 else None


def _thrown(points: Array, above: Array, sun: Sun, z_m: float) -> Array:
    """Return points (N, 3) moved along the sun's rays down to the plane."""
    x, y, z = sun.direction
    thrown = np.empty_like(points)
    thrown[:, 0] = points[:, 0] - above * (x / z)
    thrown[:, 1] = points[:, 1] - above * (y / z)
    thrown[:, 2] = z_m
    return thrown
