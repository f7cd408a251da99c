"""A scene through a view: the light of every pixel, and how far its sight goes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.synth import shadow
from landtool.synth.decals import decal_light
from landtool.synth.floor import Floor, render_floor
from landtool.synth.mesh import Mesh
from landtool.synth.print_layer import PrintLayer, print_layer
from landtool.synth.raster import Raster, Window, paint
from landtool.synth.scene import Scene, Target, is_under
from landtool.synth.sheet import glare
from landtool.synth.surfaces import PRINT, Surfaces, surfaces_of
from landtool.synth.view import Map, View

Linear = NDArray[np.float32]
Layers = dict[int, tuple[Window, Linear]]


@dataclass(frozen=True, eq=False)
class _Seen:
    """What the pixels of a view see."""

    view: View
    raster: Raster
    surfaces: Surfaces
    floor: Floor
    sheet: PrintLayer | None


@dataclass(frozen=True, eq=False)
class Rendered:
    """What reaches the camera. linear: (H, W, 3) float32 light, blue first, not clipped, without fog.

    x_m, y_m: (H, W) place on the ground below what a pixel sees. hidden: share of the disc inside the ring, of its
    part in the picture, that something hides. shaded: share of that part in shadow.
    """

    linear: Linear
    x_m: Map
    y_m: Map
    hidden: float
    shaded: float
    seen: _Seen

    @cached_property
    def depth_m(self) -> Map:
        """How far each pixel sees along the optical axis (H, W), inf in the sky."""
        return _depth(self.seen)

    @cached_property
    def distance_m(self) -> Map:
        """How far each pixel sees along its ray (H, W), inf in the sky."""
        x, y = self.seen.view.lens
        distance: Map = self.depth_m * np.sqrt(x * x + y * y + np.float32(1.0))
        return distance

    @cached_property
    def platform(self) -> Map:
        """The share (H, W) of a pixel that sees the pad, its carrier or what lies on it."""
        raster, platform = self.seen.raster, self.seen.surfaces.platform
        share: Map = platform[raster.centre].astype(np.float32)
        share.ravel()[raster.mixed] = platform[raster.mixed_ids].mean(axis=1, dtype=np.float32)
        return share


@np.errstate(over="ignore")  # rays at the horizon meet the sheet's plane beyond what a float32 holds
def render(scene: Scene, view: View) -> Rendered:
    """Return the picture of a scene in clear air."""
    target = scene.target
    floor = render_floor(scene, view, _bodies(scene))
    surfaces = surfaces_of(scene, view)
    raster = paint(view, surfaces.faces, exact=PRINT)
    layers: Layers = {}
    for id, decal in surfaces.decals.items():
        layer = decal_light(view, decal, scene.sun, floor)
        if layer is not None:
            layers[id] = layer
    sheet = None if target is None else print_layer(view, target)
    lit = None
    if target is not None:
        lit = _lit_on_pad(scene, view, target)
        if sheet is not None:
            layers[PRINT] = (sheet.window, _print_light(scene, view, target, sheet, lit))
    linear = _composed(raster, surfaces, floor, layers, lit)
    hidden, shaded = _covered(target, sheet, raster, lit)
    seen = _Seen(view, raster, surfaces, floor, sheet)
    return Rendered(linear, floor.x_m, floor.y_m, hidden, shaded, seen)


def _bodies(scene: Scene, *, over_pad: bool = False) -> list[Mesh]:
    """Return everything that throws a shadow, in the world; over_pad: without what lies under the pad's own plane.

    A deck that leans would shade its own pad, because shadows fall on the level of the pad's middle.
    """
    target = scene.target
    carried: list[Mesh] = []
    if target is not None:
        carrier = [m for m in target.carrier if not (over_pad and is_under(m))]
        carried = [m.moved(target.world_T_pad) for m in (*carrier, *target.above)]
    return [*chain.from_iterable(scene.things), *carried, *chain.from_iterable(scene.shades)]


def _lit_on_pad(scene: Scene, view: View, target: Target) -> Map:
    """Return the share of sunlight (H, W) that reaches the level of the pad."""
    place = target.world_T_pad.translation
    reach = max([target.pad.extent_m, *(float(np.abs(m.points_m[:, :2]).max()) for m in target.carrier)])
    casters = shadow.shading(_bodies(scene, over_pad=True), scene.sun, place, reach)
    depth = float(view.in_camera(place[None])[0, 2])
    return shadow.lit(view, scene.sun, casters, float(place[2]), max(depth, 0.1))


def _print_light(scene: Scene, view: View, target: Target, sheet: PrintLayer, lit: Map) -> Linear:
    """Return the light (h, w, 3) of the print: what its colours give back, and the sun's mirror image in its gloss."""
    up = target.world_T_pad.rotation[:, 2]
    facing = max(float(up @ np.array(scene.sun.direction)), 0.0)
    sun, sky = (np.array(c, np.float32) for c in (scene.sun.sun, scene.sun.sky))
    reach = lit[sheet.window]
    light = np.empty_like(sheet.albedo)
    shine = None
    if target.sheet.gloss > 0.0 and facing > 0.0:
        rays = [r[sheet.window] for r in view.rays]
        shine = target.sheet.gloss * reach * glare(up, rays, scene.sun.direction, target.sheet.roughness)
    for c in range(3):
        light[:, :, c] = sheet.albedo[:, :, c] * (sky[c] + reach * (sun[c] * np.float32(facing)))
        if shine is not None:
            light[:, :, c] += shine * sun[c]
    return light


def _composed(raster: Raster, surfaces: Surfaces, floor: Floor, layers: Layers, lit: Map | None) -> Linear:
    """Return the picture: whole pixels from what they see, mixed ones from their shares."""
    picture = floor.light
    flat = picture.reshape(-1, 3)
    if lit is not None and not (surfaces.tops.any() and surfaces.sun.any()):
        lit = None
    tables = _by_id(surfaces.sky + surfaces.sun)
    blend = _mixed_light(raster, surfaces, tables, flat, layers, lit)
    light = cv2.merge([cv2.LUT(raster.centre, table) for table in tables])
    cv2.copyTo(light, (raster.centre != 0).view(np.uint8), picture)
    if lit is not None:
        dark = np.flatnonzero(lit < 1.0)
        kind = raster.centre.ravel()[dark]
        top = np.flatnonzero(surfaces.tops[kind])
        flat[dark[top]] -= surfaces.sun[kind[top]] * (1.0 - lit.ravel()[dark[top]])[:, None]
    for id, (window, layer) in layers.items():
        cv2.copyTo(layer, (raster.centre[window] == id).view(np.uint8), picture[window])
    flat[raster.mixed] = blend
    return picture


def _mixed_light(
    raster: Raster,
    surfaces: Surfaces,
    tables: list[NDArray[np.float32]],
    ground: Linear,
    layers: Layers,
    lit: Map | None,
) -> NDArray[np.float32]:
    """Return the light (M, 3) of the pixels that see several surfaces; tables: as `_by_id`; ground: (H W, 3)."""
    mixed, ids = raster.mixed, raster.mixed_ids
    if not len(mixed):
        return np.zeros((0, 3), np.float32)
    blend = _mean(tables, ids)
    blend += _share(ids, 0) * ground[mixed]
    if lit is not None:
        dark = np.flatnonzero(lit.ravel()[mixed] < 1.0)
        shade = _by_id(np.where(surfaces.tops[:, None], surfaces.sun, np.float32(0.0)))
        if len(dark):
            blend[dark] -= _mean(shade, ids[dark]) * (1.0 - lit.ravel()[mixed[dark]])[:, None]
    row, column = np.divmod(mixed, raster.centre.shape[1])
    for id, ((rows, columns), layer) in layers.items():
        inside = (row >= rows.start) & (row < rows.stop) & (column >= columns.start) & (column < columns.stop)
        some = np.flatnonzero(inside & (ids == id).any(axis=1))
        blend[some] += _share(ids[some], id) * layer[row[some] - rows.start, column[some] - columns.start]
    return blend


def _by_id(values: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Return the columns of values by id (n, C) as OpenCV looks them up: each (1, 65536), it wants them all."""
    tables = np.zeros((values.shape[1], 1, 1 << 16), np.float32)
    tables[:, 0, : len(values)] = values.T
    return list(tables)


def _mean(tables: list[NDArray[np.float32]], ids: NDArray[np.uint16]) -> NDArray[np.float32]:
    """Return the mean (M, C) of the values of ids (M, K)."""
    means = [cv2.reduce(cv2.LUT(ids, table), 1, cv2.REDUCE_AVG) for table in tables]
    return np.concatenate(means, axis=1, dtype=np.float32)


def _share(ids: NDArray[np.uint16], id: int) -> NDArray[np.float32]:
    """Return how many of ids (M, K) are one of them, (M, 1) in [0, 1]."""
    share: NDArray[np.float32] = (ids == id).mean(axis=1, dtype=np.float32, keepdims=True)
    return share


def _depth(seen: _Seen) -> Map:
    """Return the depth (H, W) of what is in the middle of each pixel."""
    depth, raster, sheet = seen.floor.depth_m.copy(), seen.raster, seen.sheet
    covered = np.flatnonzero(raster.centre)
    if len(covered):
        plane = seen.surfaces.planes[raster.centre.ravel()[covered]]
        # n . (s ray) = d
        along = sum(plane[:, i] * seen.view.rays[i].ravel()[covered] for i in range(3))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = plane[:, 3] / along
        # the face of a grazing sight, whose plane says nothing
        depth.ravel()[covered] = np.where((found > 0) & np.isfinite(found), found, depth.ravel()[covered])
    if sheet is not None:
        here = raster.centre[sheet.window] == PRINT
        depth[sheet.window][here] = sheet.depth_m[here]
    return depth


def _covered(target: Target | None, sheet: PrintLayer | None, raster: Raster, lit: Map | None) -> tuple[float, float]:
    """Return the hidden and the shaded share of the disc inside the ring, of its part in the picture."""
    if target is None or sheet is None or target.pad.ring is None or lit is None:
        return 0.0, 0.0
    radius = target.pad.ring.outer * target.pad.diameter_m / 2.0
    disc = sheet.x_m**2 + sheet.y_m**2 <= radius * radius
    total = int(disc.sum())
    if not total:
        return 0.0, 0.0
    seen = raster.coverage(PRINT)[sheet.window][disc]
    return float(1.0 - seen.mean()), float(1.0 - lit[sheet.window][disc].mean())
