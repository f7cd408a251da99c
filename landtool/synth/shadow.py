"""Where the sun does not reach: shadows on the ground and on the pad, and the dimness under and beside bodies."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.faces import Faces, on_picture, out_of_sight
from landtool.synth.mesh import Mesh
from landtool.synth.raster import filled, window_of
from landtool.synth.scene import Sun
from landtool.synth.view import View

Share = NDArray[np.float32]
_LOWEST_SUN = 0.05  # a sun lower than this share of its length throws shadows without end
_LOWEST_CASTER_M = 0.005
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
    if not any(sun.sun) or sun.direction[2] < _LOWEST_SUN:
        return reaching if any(sun.sun) else np.zeros(shape, np.float32)
    casting = [mesh for mesh in meshes if mesh.casts]
    if not casting:
        return reaching
    all_points, starts = _joined(casting)
    height = np.add.reduceat(all_points[:, 2], starts) / [len(mesh.points_m) for mesh in casting] - z_m
    # the penumbra lies as far from its caster as the light's way down, so a low sun widens it
    width_m = sun.softness * np.maximum(height, 0.0) / sun.direction[2]
    soft_px = np.clip(0.5 * width_m * view.camera.fx / max(depth_m, 0.1), _SHARPEST_PX, _SOFTEST_PX)
    of_mesh = np.rint(2.0 * np.log2(soft_px)).astype(int).tolist()
    polygons: list[NDArray[np.float32]] = []
    levels: list[int] = []
    for i, fallen in _fallen(view, sun, casting, all_points, starts, z_m):
        polygons += fallen
        levels += [of_mesh[i]] * len(fallen)
    sigmas = {level: 2.0 ** (level / 2.0) for level in levels}
    _darken(reaching, view, Faces.level(polygons, z_m), levels, sigmas, _LEFT)
    return reaching


def shading(meshes: Sequence[Mesh], sun: Sun, place_m: Array, reach_m: float) -> list[Mesh]:
    """Return the bodies that may throw their shadow within reach of a place (3,), on a level plane through it."""
    if not meshes:
        return []
    points, starts = _joined(meshes)
    low, high = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
    above = high[:, 2] - place_m[2]
    fall = above[:, None] * np.array(sun.direction[:2]) / max(sun.direction[2], _LOWEST_SUN)
    first, last = np.minimum(low[:, :2], low[:, :2] - fall), np.maximum(high[:, :2], high[:, :2] - fall)
    near = (first < place_m[:2] + reach_m).all(axis=1) & (last > place_m[:2] - reach_m).all(axis=1)
    return [meshes[i] for i in np.flatnonzero(near & (above >= _LOWEST_CASTER_M)).tolist()]


def openness(view: View, meshes: Iterable[Mesh], depth_m: float) -> Share:
    """Return the share (H, W) of the sky's light that reaches the ground beside bodies that stand on it."""
    free = np.ones((view.camera.height, view.camera.width), np.float32)
    closed = [mesh for mesh in meshes if mesh.closed]
    if not closed:
        return free
    points, starts = _joined(closed)
    low, high = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
    reach_px = _DIM_REACH * high[:, 2] * view.camera.fx / max(depth_m, 0.1)
    of_mesh = np.rint(np.log2(np.clip(reach_px, 1.0, _SOFTEST_PX))).astype(int)
    low[:, 2], standing = 0.0, (low[:, 2] < 0.6) & (high[:, 2] > 0.03)
    high[:, 2] = 0.0
    seen = np.flatnonzero(standing & ~out_of_sight(view, low, high)).tolist()
    polygons = [_hull(closed[i].points_m[:, :2].astype(np.float32)) for i in seen]
    levels = of_mesh[seen].tolist()
    _darken(free, view, Faces.level(polygons, 0.0), levels, {level: 2.0**level for level in levels}, _LEFT_OF_SKY)
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


def _joined(meshes: Sequence[Mesh]) -> tuple[Array, NDArray[np.intp]]:
    """Return the points (P, 3) of all meshes and where those of each one start."""
    counts = np.array([len(mesh.points_m) for mesh in meshes], np.intp)
    return np.concatenate([mesh.points_m for mesh in meshes]), np.cumsum(counts) - counts


def _hull(points: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.convexHull(points), dtype=np.float32).reshape(-1, 2)


def _fallen(
    view: View, sun: Sun, meshes: Sequence[Mesh], points: Array, starts: NDArray[np.intp], z_m: float
) -> Iterator[tuple[int, list[NDArray[np.float32]]]]:
    """Yield which meshes throw a shadow on the plane at height z_m that may be seen, and its polygons (N, 2).

    points, starts: as from `_joined`.
    """
    x, y, z = sun.direction
    above = np.maximum(points[:, 2] - z_m, 0.0)
    thrown = points[:, :2] - above[:, None] * (x / z, y / z)
    # with what lies under the plane, for a body that is cut there
    low = np.minimum.reduceat(np.minimum(thrown, points[:, :2]), starts)
    high = np.maximum.reduceat(np.maximum(thrown, points[:, :2]), starts)
    unseen = out_of_sight(view, *(np.insert(corner, 2, z_m, axis=1) for corner in (low, high)))
    seen = ~unseen & (np.maximum.reduceat(above, starts) > 0.0)
    whole = np.minimum.reduceat(above, starts) > 0.0
    thrown32, foot = thrown.astype(np.float32), points[:, :2].astype(np.float32)
    for i in np.flatnonzero(seen).tolist():
        mesh, start = meshes[i], int(starts[i])
        own = slice(start, start + len(mesh.points_m))
        if not mesh.closed:
            yield i, [thrown32[own][face] for face in mesh.faces]
            continue
        part = thrown32[own]
        if not whole[i]:
            # what lies under the plane is cut off there, roughly: below each point above it
            upper = above[own] > 0.0
            part = np.concatenate([part[upper], foot[own][upper]])
        hull = _hull(part)
        if len(hull) >= 3:
            yield i, [hull]
