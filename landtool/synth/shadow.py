"""Where the sun does not reach: shadows on the ground and on the pad, and the dimness under and beside bodies."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.mesh import Mesh
from landtool.synth.raster import Polygon, coverage
from landtool.synth.scene import Sun
from landtool.synth.view import View

Share = NDArray[np.float32]
_HIGHEST_SUN_STEP = 0.05  # a sun lower than this share of its length throws shadows without end
_SHARPEST_PX, _SOFTEST_PX = 0.45, 24.0
# bodies dim the ground within about this share of their height, by at most so much
_DIM_REACH, _DIM_MOST = 0.35, 0.55


def lit(view: View, sun: Sun, meshes: Iterable[Mesh], z_m: float, depth_m: float) -> Share:
    """Return the share (H, W) of the sun's light that reaches the level plane at height z_m.

    meshes: what throws shadows, in the world; parts below the plane throw none. depth_m: a usual distance of the
    plane along the optical axis, which says how wide a penumbra is on the picture.
    """
    shape = (view.camera.height, view.camera.width)
    reaching = np.ones(shape, np.float32)
    if not any(sun.sun) or sun.direction[2] < _HIGHEST_SUN_STEP:
        return reaching if any(sun.sun) else np.zeros(shape, np.float32)
    by_softness: dict[int, list[Polygon]] = defaultdict(list)
    for mesh in meshes:
        if mesh.casts:
            softness = _softness_px(view, sun, mesh, z_m, depth_m)
            by_softness[round(2.0 * math.log2(softness))] += [Polygon(p, 1) for p in _fallen(mesh, sun, z_m)]
    for level, polygons in by_softness.items():
        sigma = 2.0 ** (level / 2.0)
        mask = coverage(view, polygons, 1)
        if mask.any():
            dark = cv2.GaussianBlur(mask, (0, 0), sigma)
            reaching *= np.float32(1.0) - dark.astype(np.float32) * np.float32(1.0 / 255.0)
    return reaching


def openness(view: View, meshes: Iterable[Mesh], depth_m: float) -> Share:
    """Return the share (H, W) of the sky's light that reaches the ground beside bodies that stand on it."""
    by_reach: dict[int, list[Polygon]] = defaultdict(list)
    for mesh in meshes:
        low, high = mesh.points_m[:, 2].min(), mesh.points_m[:, 2].max()
        if mesh.closed and low < 0.6 and high > 0.03:
            foot = mesh.points_m[:, :2]
            hull = cv2.convexHull(foot.astype(np.float32)).reshape(-1, 2)
            reach_px = _DIM_REACH * high * view.camera.fx / max(depth_m, 0.1)
            level = round(math.log2(float(np.clip(reach_px, 1.0, _SOFTEST_PX))))
            by_reach[level].append(Polygon(np.column_stack([hull, np.zeros(len(hull))]), 1))
    free = np.ones((view.camera.height, view.camera.width), np.float32)
    for level, polygons in by_reach.items():
        mask = coverage(view, polygons, 1)
        if mask.any():
            near = cv2.GaussianBlur(mask, (0, 0), 2.0**level)
            free *= np.float32(1.0) - near.astype(np.float32) * np.float32(_DIM_MOST / 255.0)
    return free


def _softness_px(view: View, sun: Sun, mesh: Mesh, z_m: float, depth_m: float) -> float:
    height = max(float(mesh.points_m[:, 2].mean()) - z_m, 0.0)
    # the penumbra lies as far from its caster as the light's way down, so a low sun widens it
    width_m = sun.softness * height / sun.direction[2]
    px = 0.5 * width_m * view.camera.fx / max(depth_m, 0.1)
    return float(np.clip(px, _SHARPEST_PX, _SOFTEST_PX))


def _fallen(mesh: Mesh, sun: Sun, z_m: float) -> Iterator[Array]:
    """Yield the shadows (N, 3) that a mesh throws on the plane at height z_m."""
    above = np.maximum(mesh.points_m[:, 2] - z_m, 0.0)
    if not above.any():
        return
    if not mesh.closed:
        for face in mesh.faces:
            if above[face].any():
                yield _thrown(mesh.points_m[face], above[face], sun, z_m)
        return
    if mesh.points_m[:, 2].min() < z_m:
        # only what stands out above the plane: its foot is cut off at the plane, roughly, by its own upper points
        upper = mesh.points_m[:, 2] > z_m
        points, above = mesh.points_m[upper], above[upper]
        points, above = np.concatenate([points, points]), np.concatenate([above, np.zeros(len(above))])
    else:
        points = mesh.points_m
    thrown = _thrown(points, above, sun, z_m)
    hull = cv2.convexHull(thrown[:, :2].astype(np.float32)).reshape(-1, 2).astype(np.float64)
    yield np.column_stack([hull, np.full(len(hull), z_m)])


def _thrown(points: Array, above: Array, sun: Sun, z_m: float) -> Array:
    """Return points (N, 3) moved along the sun's rays down to the plane."""
    x, y, z = sun.direction
    return np.column_stack([points[:, 0] - above * x / z, points[:, 1] - above * y / z, np.full(len(points), z_m)])
