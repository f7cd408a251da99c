"""Pictures on planes: signs, lettering and other targets, as the pixels see them."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool import tone
from landtool.synth.faces import Faces, on_picture
from landtool.synth.floor import Floor
from landtool.synth.raster import Window, window_of
from landtool.synth.scene import Decal, Sun
from landtool.synth.surfaces import ON_GROUND_M
from landtool.synth.view import View

_FINER = 2  # samples a side of a pixel


def decal_light(view: View, decal: Decal, sun: Sun, floor: Floor) -> tuple[Window, NDArray[np.float32]] | None:
    """Return a decal's light (h, w, 3) in a window of the picture, over the floor; None where it is not seen."""
    outline = on_picture(view, Faces.of([decal.corners_m]))[0]
    window = None if outline is None else window_of(view, [outline], 1.0)
    if window is None or min(part.stop - part.start for part in window) < 2:
        return None
    column, row = _texels(view, decal, window)
    albedo = _sampled(decal, column, row)
    up = decal.world_T_plane.rotation[:, 2]
    facing = max(float(up @ np.array(sun.direction)), 0.0)
    light = np.array(sun.sky, np.float32) * np.ones_like(albedo[:, :, :3])
    reach = floor.lit[window][:, :, None] if decal.world_T_plane.translation[2] < ON_GROUND_M else np.float32(1.0)
    light += reach * (np.float32(facing) * np.array(sun.sun, np.float32))
    cover = albedo[:, :, 3:]
    return window, albedo[:, :, :3] * light * cover + floor.light[window] * (1.0 - cover)


def _texels(view: View, decal: Decal, window: Window) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the column and row (h, w) of the picture that each pixel's middle sees."""
    plane_T_world = decal.world_T_plane.inverse()
    m = plane_T_world.rotation.astype(np.float32)
    dx, dy, dz = (r[window] for r in view.rays)
    rays = [row[0] * dx + row[1] * dy + row[2] * dz for row in m]
    ox, oy, oz = (np.float32(v) for v in plane_T_world.apply(view.world_T_camera.translation))
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = -oz / rays[2]
    depth = np.where((depth > 0) & np.isfinite(depth), depth, np.float32(1e4))
    n = len(decal.picture)
    scale = np.float32(n / decal.side_m)
    x, y = ox + depth * rays[0], oy + depth * rays[1]
    half = np.float32(n / 2.0 - 0.5)
    return half - y * scale, half - x * scale


def _sampled(decal: Decal, column: NDArray[np.float32], row: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return linear albedo and coverage (h, w, 4)."""
    h, w = column.shape
    step = max(
        abs(float(column[h // 2, w // 2] - column[h // 2, w // 2 - 1]))
        + abs(float(row[h // 2, w // 2] - row[h // 2, w // 2 - 1])),
        1e-3,
    )
    picture, texels = decal.picture, 1.0
    while step / texels > 1.5 * _FINER and len(picture) > 8:
        picture = np.asarray(cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        texels *= 2.0
    size = (w * _FINER, h * _FINER)
    maps = [
        cv2.resize((np.clip(m, -2000, 4000) + np.float32(0.5)) / np.float32(texels) - np.float32(0.5), size)
        for m in (column, row)
    ]
    sampled = cv2.remap(picture, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    mean = cv2.resize(sampled, (w, h), interpolation=cv2.INTER_AREA)
    out = np.empty((h, w, 4), np.float32)
    out[:, :, :3] = _to_linear()[mean[:, :, :3]]
    out[:, :, 3] = mean[:, :, 3].astype(np.float32) / 255.0
    return out


@lru_cache(maxsize=1)
def _to_linear() -> NDArray[np.float32]:
    return tone.linear_lut("srgb")
