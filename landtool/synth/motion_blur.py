"""Motion blur along the true image motion: how pixels move while the shutter is open, and what that does to light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from landtool.geometry import Array
from landtool.synth.view import View

Linear = NDArray[np.float32]
Flow = NDArray[np.float32]

_STEP_PX = 32
_FAR_M = 200.0  # where nothing is: as good as endlessly far for a drone that turns and hardly moves
_UNSEEN_PX = 0.15
_UNIFORM_PX = 0.3
_DIRECT_PX = 9.0
_APART_PX = 1.2


def flow_grid(view: View, plane_z_m: float, velocity_mps: ArrayLike = (0.0, 0.0, 0.0)) -> Flow:
    """Return by how many pixels (gh, gw, 2) the picture moves during the exposure, on a grid over the whole image.

    The grid's nodes are as in `grid_nodes`. It is of points on the level plane at height plane_z_m that move with
    velocity_mps (3,) in the world, or of points far away where the sight misses the plane; 0 where the lens sees none.
    """
    down, across = (grid_nodes(n) for n in (view.camera.height, view.camera.width))
    shape = (len(down), len(across), 2)
    if view.exposure_s == 0.0:
        return np.zeros(shape, np.float32)
    rays = np.stack(view.rays_at(down, across), axis=-1).reshape(-1, 3).astype(np.float64)
    t = np.repeat(view.row_time_s(down.astype(np.float64)), len(across))
    origin = view.world_T_camera.translation + t[:, None] * view.velocity_mps
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (plane_z_m - origin[:, 2]) / rays[:, 2]
        far = _FAR_M / np.linalg.norm(rays, axis=1)
    depth = np.where((depth > 0.0) & (depth < far), depth, far)
    # in_camera wants points as they are at its time 0
    points = origin + depth[:, None] * rays - t[:, None] * np.asarray(velocity_mps, dtype=np.float64)
    half = view.exposure_s / 2.0
    start, end = (view.camera.project(view.in_camera(points, t + s, velocity_mps)) for s in (-half, half))
    return np.nan_to_num(_on_rows(view, end - start)).reshape(shape).astype(np.float32)


def grid_nodes(size_px: int) -> NDArray[np.intp]:
    """Return the pixels (n,) along an axis at which a grid has its nodes: first and last, and one about every 32."""
    count = max(2, round(size_px / _STEP_PX) + 1)
    return np.linspace(0.0, size_px - 1.0, count).round().astype(np.intp)


def motion_blur(linear: Linear, flow_px: Flow, over_flow_px: Flow | None = None, mask: Linear | None = None) -> Linear:
    """Return light (H, W, 3) smeared along its motion, symmetric about the middle of the exposure.

    flow_px: (gh, gw, 2) whole motion on the nodes of `grid_nodes`, as from `flow_grid`. over_flow_px: the same for
    what moves by itself before it, and mask (H, W) that one's coverage in [0, 1]. Without motion the light itself is
    returned.
    """
    shape = linear.shape[:2]
    if over_flow_px is None or mask is None or _largest(over_flow_px - flow_px) < _UNSEEN_PX:
        return _smeared(linear, flow_px, shape)
    if mask.min() > 0.999:
        return _smeared(linear, over_flow_px, shape)
    out = _smeared(linear, flow_px, shape)
    covered = _covered(mask)
    if covered is None:
        return out
    if out is linear:
        out = linear.copy()
    # a margin more is looked at than changed, for what moves in from there
    reach = math.ceil(max(_largest(over_flow_px), _largest(flow_px)) / 2.0) + 2
    changed, seen = (_grown(covered, margin, shape) for margin in (reach, 2 * reach))
    composed = _composed(linear, mask, flow_px, over_flow_px, seen)
    rows, columns = (slice(c.start - w.start, c.stop - w.start) for c, w in zip(changed, seen, strict=True))
    out[changed] = composed[rows, columns]
    return out


def _on_rows(view: View, motion_px: Array) -> Array:
    """Return motions (N, 2) of points as a rolling shutter smears them: rows that move along are exposed later."""
    # row y is exposed at k y, so a point that moves with u passes it for 1 / (1 - k u_y) of the motion
    k = view.readout_s / max(view.camera.height - 1, 1)
    slower = 1.0 - k * motion_px[:, 1] / view.exposure_s
    return motion_px / np.maximum(slower, 0.1)[:, None]


def _composed(linear: Linear, mask: Linear, flow: Flow, over_flow: Flow, window: tuple[slice, slice]) -> Linear:
    """Return the window of light (H, W, 3) in which a layer covers another by mask (H, W), each with its motion."""
    cover = mask[window]
    rest = np.float32(1.0) - cover
    planes = cv2.split(linear[window])
    over = _smeared(_merged([*(p * cover for p in planes), cover]), over_flow, mask.shape, window)
    under = _smeared(_merged([*(p * rest for p in planes), rest]), flow, mask.shape, window)
    # nobody knows what is hidden: the mean of what is seen near it stands in
    side = 2 * math.ceil(_largest(over_flow)) + 5
    *near, near_cover = cv2.split(cv2.blur(under, (side, side)))
    *front, front_cover = cv2.split(over)
    *behind, behind_cover = cv2.split(under)
    little = np.float32(1e-3)
    shown = []
    for i, plane in enumerate(planes):
        guess = (near[i] + little * plane) / (near_cover + little)
        back = (behind[i] + little * guess) / (behind_cover + little)
        shown.append(front[i] + (np.float32(1.0) - front_cover) * back)
    return _merged(shown)


def _smeared(
    light: Linear, grid: Flow, shape: tuple[int, ...], window: tuple[slice, slice] = (slice(None), slice(None))
) -> Linear:
    """Return light (h, w, 3 or 4), a window of a picture of a shape, smeared along the motions of that picture."""
    if _largest(grid) < _UNSEEN_PX:
        return light
    mean = grid.reshape(-1, 2).mean(axis=0)
    if _largest(grid - mean) < _UNIFORM_PX:
        return _along(light, mean)
    dx, dy = (motion[window] for motion in _dense(grid, shape[0], shape[1]))
    return _averaged(light, dx, dy, max(1, _levels(_largest(grid) / _APART_PX)))


def _along(light: Linear, motion_px: Linear) -> Linear:
    """Return light (h, w, 3 or 4) smeared along one motion (2,)."""
    # OpenCV turns to Fourier's transform for large kernels, at ten times the cost: put together of small ones
    levels = _levels(float(np.hypot(*motion_px)) / _DIRECT_PX)
    kernel = line_kernel(motion_px / 3.0**levels)
    short = np.asarray(cv2.filter2D(light, -1, kernel, borderType=cv2.BORDER_REPLICATE), np.float32)
    dx, dy = (np.full(light.shape[:2], motion, np.float32) for motion in motion_px)
    return _averaged(short, dx, dy, levels)


def line_kernel(motion_px: ArrayLike) -> Linear:
    """Return the kernel (n, m) of sum 1 of a point that moves by (x, y) pixels about the middle of the kernel."""
    dx, dy = (float(c) for c in np.asarray(motion_px))
    reach_x, reach_y = math.ceil(abs(dx) / 2.0) + 1, math.ceil(abs(dy) / 2.0) + 1
    kernel = np.zeros((2 * reach_y + 1, 2 * reach_x + 1))
    count = max(32, 8 * math.ceil(math.hypot(dx, dy)))
    share = (np.arange(count) + 0.5) / count - 0.5
    # every moment gives its light to the four pixels about its place, by their nearness
    x, y = share * dx + reach_x, share * dy + reach_y
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    right, low = x - column, y - row
    np.add.at(kernel, (row, column), (1.0 - right) * (1.0 - low))
    np.add.at(kernel, (row, column + 1), right * (1.0 - low))
    np.add.at(kernel, (row + 1, column), (1.0 - right) * low)
    np.add.at(kernel, (row + 1, column + 1), right * low)
    return np.asarray(kernel / count, np.float32)


def _averaged(light: Linear, dx: Linear, dy: Linear, levels: int) -> Linear:
    """Return light (H, W, 3 or 4) averaged along a flow (H, W) by 3^levels moments."""
    if levels == 0:
        return light
    height, width, channels = light.shape
    # OpenCV looks up four channels more than twice as fast as three
    now = light if channels == 4 else np.asarray(cv2.cvtColor(light, cv2.COLOR_BGR2BGRA), np.float32)
    x, y = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
    places, total, other = (np.empty_like(dx), np.empty_like(dy)), np.empty_like(now), np.empty_like(now)
    # 3 moments a third of the motion apart, each of them 3 a ninth apart, ...: 3^n moments for 2 n pictures
    for level in range(1, levels + 1):
        for picture, share in ((total, 3.0**-level), (other, -(3.0**-level))):
            for place, start, motion in zip(places, (x, y), (dx, dy), strict=True):
                np.multiply(motion, np.float32(share), out=place)
                np.add(place, start, out=place)
            cv2.remap(now, *places, cv2.INTER_LINEAR, dst=picture, borderMode=cv2.BORDER_REPLICATE)
        total += other
        total += now
        total *= np.float32(1.0 / 3.0)
        now, total = total, (np.empty_like(now) if now is light else now)
    return now if channels == 4 else np.asarray(cv2.cvtColor(now, cv2.COLOR_BGRA2BGR), np.float32)


def _levels(ratio: float) -> int:
    """Return how often a length is cut in three to become `ratio` times shorter."""
    return max(0, math.ceil(math.log(max(ratio, 1.0), 3.0)))


def _dense(grid: Flow, height: int, width: int) -> tuple[Linear, Linear]:
    """Return the flow (H, W) along x and y between the nodes of a grid (gh, gw, 2), linear."""
    rows, columns = _hats(height), _hats(width)
    dx, dy = (rows @ grid[:, :, axis].astype(np.float32) @ columns.T for axis in (0, 1))
    return dx, dy


@lru_cache(maxsize=8)
def _hats(size_px: int) -> Flow:
    """Return the matrix (size, nodes) from values at the nodes to values at every pixel of an axis."""
    nodes = grid_nodes(size_px)
    return np.stack([np.interp(np.arange(size_px), nodes, e) for e in np.eye(len(nodes))], axis=1).astype(np.float32)


def _covered(mask: Linear) -> tuple[slice, slice] | None:
    """Return the rows and columns that a mask (H, W) covers, None when it covers nothing."""
    rows, columns = (np.flatnonzero((mask > 0.0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _grown(window: tuple[slice, slice], margin_px: int, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Return a window with a margin, as far as the picture goes."""
    rows, columns = (
        slice(max(0, part.start - margin_px), min(size, part.stop + margin_px))
        for part, size in zip(window, shape, strict=True)
    )
    return rows, columns


def _largest(flow: Flow) -> float:
    return float(np.hypot(flow[..., 0], flow[..., 1]).max(initial=0.0))


def _merged(planes: Sequence[NDArray[Any]]) -> Linear:
    return np.asarray(cv2.merge(planes), np.float32)
