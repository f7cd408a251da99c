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
from landtool.synth.faces import Faces, on_picture
from landtool.synth.grounds import GroundTexture, ground_albedo, relative_detail
from landtool.synth.mesh import Mesh
from landtool.synth.raster import SAMPLES, Window, filled, window_of
from landtool.synth.scene import Mark, Scene
from landtool.synth.view import Map, View

Linear = NDArray[np.float32]
# brightness of the horizon beside the mean of the sky
_HORIZON = np.float32(1.5)
_SOFTEST_PX = 60.0
# what a stretched texture keeps of its own darkness
_DARKEST = 0.3
# the ground is the mirror of how bright paint on it looks: relief shows through to this share
_GRAIN = 0.55
_WEAR_TEXELS, _WEAR_TILE_M = 256, 3.1


@dataclass(frozen=True, eq=False)
class Floor:
    """The ground of a picture.

    light: (H, W, 3) linear, blue first. depth_m: (H, W) along the optical axis, inf in the sky. x_m, y_m: (H, W)
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
    near: Map = np.where(sky, np.float32(0.0), depth).astype(np.float32, copy=False)
    x: Map = view.origin(0) + near * dx
    y: Map = view.origin(1) + near * dy
    footprint = near * np.float32(1.0 / view.camera.fx)
    on_x: Map = x + np.float32(scene.phase_m[0])
    on_y: Map = y + np.float32(scene.phase_m[1])
    albedo = ground_albedo(scene.ground, on_x, on_y, footprint)
    if scene.relief != 1.0:
        _stretch(albedo, scene.ground, scene.relief)
    for region in scene.regions:
        inside = _share(view, (region.polygon_m,), region.soft_m, depth)
        if inside is not None:
            window, share = inside
            other = ground_albedo(region.ground, on_x[window], on_y[window], footprint[window])
            albedo[window] += share[:, :, None] * (other - albedo[window])
    for mark in scene.marks:
        _painted(albedo, mark, scene.ground, view, on_x, on_y, depth)
    usual = float(np.median(depth[::8, ::8]))
    usual = usual if np.isfinite(usual) else 100.0
    sun = shadow.lit(view, scene.sun, shades, 0.0, usual)
    open_sky = shadow.openness(view, shades, usual)
    sunny = np.array(scene.sun.sun, np.float32) * np.float32(max(scene.sun.direction[2], 0.0))
    albedo *= cv2.merge([open_sky * np.float32(scene.sun.sky[c]) + sun * sunny[c] for c in range(3)])
    if sky.any():
        # low over the ground the sky is its palest and brightest
        pale = np.array(scene.sun.sky, np.float32)
        albedo[sky] = _HORIZON * (pale + np.float32(2.0) * pale.mean()) / np.float32(3.0)
    return Floor(albedo, depth, x, y, sun)


def _stretch(albedo: Linear, ground: GroundTexture, relief: float) -> None:
    """Make the ground's texture stand out more or less about its mean, in place; nothing gets darker than a hole."""
    mean = np.tile(ground.mean * np.float32(1.0 - relief), albedo.shape[1])
    flat = albedo.reshape(albedo.shape[0], -1)
    holes = flat * np.float32(_DARKEST)
    flat *= np.float32(relief)
    flat += mean
    np.maximum(flat, holes, out=flat)


def _painted(albedo: Linear, mark: Mark, ground: GroundTexture, view: View, x: Map, y: Map, depth: Map) -> None:
    """Cover the ground with a mark, in place."""
    inside = _share(view, mark.polygons_m, mark.soft_m, depth)
    if inside is None:
        return
    window, share = inside
    share *= np.float32(mark.opacity)
    part = albedo[window]
    if mark.wear > 0.0:
        share *= _left_of_paint(x[window], y[window], mark.wear)
    grain = relative_detail(ground, part) * np.float32(_GRAIN) + np.float32(1.0 - _GRAIN)
    grain = np.minimum(grain, np.float32(1.5))
    paint = cv2.merge([grain * np.float32(c) for c in mark.albedo])
    paint -= part
    paint *= cv2.merge([share, share, share])
    part += paint


def _share(view: View, polygons_m: Sequence[Array], soft_m: float, depth: Map) -> tuple[Window, Map] | None:
    """Return how much of each pixel (h, w) of a window polygons on the ground cover, their edge `soft_m` wide."""
    soft_px = soft_m * view.camera.fx / max(float(np.median(depth[::8, ::8])), 0.1) if soft_m > 0.0 else 0.0
    soft_px = min(soft_px, _SOFTEST_PX)
    outlines = [outline for outline in on_picture(view, Faces.level(polygons_m, 0.0)) if outline is not None]
    window = window_of(view, outlines, 1.5 * soft_px)
    if window is None:
        return None
    mask = filled(outlines, window, 1 if soft_px > 1.5 else SAMPLES)
    if soft_px > 0.3:
        mask = shadow.softened(mask, soft_px / 2.0)
    return window, mask.astype(np.float32) * np.float32(1.0 / 255.0)


def _left_of_paint(x: Map, y: Map, wear: float) -> Map:
    """Return how much paint is left (H, W) where the share `wear` of it has come off in patches."""
    scale = np.float32(_WEAR_TEXELS / _WEAR_TILE_M)
    column, row = (np.mod(v * scale, np.float32(_WEAR_TEXELS)) for v in (x, y))
    noise = cv2.remap(_wear_noise(), column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    threshold = 255.0 * wear
    above = (noise.astype(np.float32) - np.float32(threshold)) * np.float32(1 / 50.0) + np.float32(0.5)
    left: Map = np.clip(above, 0.0, 1.0)
    return left


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
