"""The ground as the camera sees it: its kinds, what is painted on it, its shadows, and the sky where it ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth import shadow
from landtool.synth.grounds import GroundTexture, ground_albedo
from landtool.synth.mesh import Mesh
from landtool.synth.raster import Polygon, coverage
from landtool.synth.scene import Mark, Scene
from landtool.synth.view import Map, View

Linear = NDArray[np.float32]
# the ground is the mirror of how bright paint on it looks: relief shows through to this share
_GRAIN = 0.55
_WEAR_TEXELS, _WEAR_TILE_M = 256, 3.1


@dataclass(frozen=True, eq=False)
class Floor:
    """light: (H, W, 3) linear, blue first. depth_m: (H, W) along the optical axis, inf in the sky. x_m, y_m: (H, W)
    place in the world that a pixel sees. lit: (H, W) share of the sun's light that reaches it.
    """

    light: Linear
    depth_m: Map
    x_m: Map
    y_m: Map
    lit: Map


def render_floor(scene: Scene, view: View, shades: Sequence[Mesh]) -> Floor:
    """Return the ground of a scene; shades: all bodies, in the world."""
    depth = view.plane_depth(0.0)
    dx, dy, _ = view.rays
    sky = ~np.isfinite(depth)
    near = np.where(sky, np.float32(0.0), depth)
    x, y = view.origin(0) + near * dx, view.origin(1) + near * dy
    footprint = near * np.float32(1.0 / view.camera.fx)
    on_x, on_y = x + np.float32(scene.phase_m[0]), y + np.float32(scene.phase_m[1])
    albedo = ground_albedo(scene.ground, on_x, on_y, footprint)
    for region in scene.regions:
        inside = _share(view, (region.polygon_m,), region.soft_m, depth)
        if inside.any():
            other = ground_albedo(region.ground, on_x, on_y, footprint)
            albedo += inside[:, :, None] * (other - albedo)
    for mark in scene.marks:
        _painted(albedo, mark, scene.ground, view, on_x, on_y, depth)
    usual = float(np.median(depth))
    usual = usual if np.isfinite(usual) else 100.0
    sun = shadow.lit(view, scene.sun, shades, 0.0, usual)
    open_sky = shadow.openness(view, shades, usual)
    sunny = np.array(scene.sun.sun, np.float32) * np.float32(max(scene.sun.direction[2], 0.0))
    albedo *= cv2.merge([open_sky * np.float32(scene.sun.sky[c]) + sun * sunny[c] for c in range(3)])
    if sky.any():
        albedo[sky] = np.array(scene.sun.sky, np.float32)
    return Floor(albedo, depth, x, y, sun)


def _painted(albedo: Linear, mark: Mark, ground: GroundTexture, view: View, x: Map, y: Map, depth: Map) -> None:
    """Cover the ground with a mark, in place."""
    share = _share(view, mark.polygons_m, mark.soft_m, depth)
    rows, columns = np.flatnonzero(share.any(axis=1)), np.flatnonzero(share.any(axis=0))
    if not len(rows):
        return
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    share = share[window] * np.float32(mark.opacity)
    part = albedo[window]
    if mark.wear > 0.0:
        share *= _left_of_paint(x[window], y[window], mark.wear)
    mean = max(float(np.mean(ground.mean)), 1e-3)
    grain = part.mean(axis=2) * np.float32(_GRAIN / mean) + np.float32(1.0 - _GRAIN)
    paint = np.array(mark.albedo, np.float32) * np.minimum(grain, 1.5)[:, :, None]
    part += share[:, :, None] * (paint - part)


def _share(view: View, polygons_m: Sequence[Array], soft_m: float, depth: Map) -> Map:
    """Return how much of each pixel (H, W) polygons on the ground cover, their edge `soft_m` wide."""
    level = [Polygon(np.column_stack([p, np.zeros(len(p))]), 1) for p in polygons_m]
    soft_px = soft_m * view.camera.fx / max(float(np.median(depth)), 0.1) if soft_m > 0.0 else 0.0
    mask = coverage(view, level, 1 if soft_px > 1.5 else 3)
    if soft_px > 0.3 and mask.any():
        mask = shadow.softened(mask, min(soft_px / 2.0, 30.0))
    return mask.astype(np.float32) * np.float32(1.0 / 255.0)


def _left_of_paint(x: Map, y: Map, wear: float) -> Map:
    """Return how much paint is left (H, W) where the share `wear` of it has come off in patches."""
    scale = np.float32(_WEAR_TEXELS / _WEAR_TILE_M)
    places = [np.mod(v * scale, np.float32(_WEAR_TEXELS)) for v in (x, y)]
    noise = cv2.remap(_wear_noise(), *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    threshold = 255.0 * wear
    return np.clip(
        (noise.astype(np.float32) - np.float32(threshold)) * np.float32(1 / 50.0) + np.float32(0.5), 0.0, 1.0
    )


@lru_cache(maxsize=1)
def _wear_noise() -> NDArray[np.uint8]:
    """Return patchy noise (n, n) that tiles the plane, each value as common as every other."""
    rng = np.random.default_rng(20)
    total = np.zeros((_WEAR_TEXELS, _WEAR_TEXELS), np.float32)
    for cells, strength in ((8, 1.0), (32, 0.8), (128, 0.7)):
        wrapped = np.pad(rng.standard_normal((cells, cells)).astype(np.float32), 2, mode="wrap")
        k = _WEAR_TEXELS // cells
        large = cv2.resize(wrapped, None, fx=k, fy=k, interpolation=cv2.INTER_CUBIC)
        total += np.float32(strength) * large[2 * k : -2 * k, 2 * k : -2 * k]
    rank = np.argsort(np.argsort(total.ravel()))
    return (rank * 256 // len(rank)).astype(np.uint8).reshape(total.shape)
