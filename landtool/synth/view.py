"""A camera in the world while it takes one picture: where each pixel looks, and where each point is seen.

With a rolling shutter every row has its own moment, so rays and projections know the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from landtool.camera import Camera
from landtool.geometry import Array, Pose, skew

Map = NDArray[np.float32]
_NODES = 14  # a side of the grid on which the lens is inverted exactly: the polynomial between strays under 1e-4 px
_ROUNDS = 3  # a point's row tells its moment, and its moment its row


@dataclass(frozen=True, eq=False)
class View:
    """What takes the picture. The world is level, z up, its ground at z = 0.

    world_T_camera: at the middle of the exposure of the middle row. velocity_mps: (3,) of the camera in the world.
    rate_radps: (3,) turning of the camera about its own axes. exposure_s: time the shutter of a row is open.
    readout_s: time from the first row to the last; 0 is a global shutter.
    """

    camera: Camera
    world_T_camera: Pose
    velocity_mps: Array
    rate_radps: Array
    exposure_s: float = 0.0
    readout_s: float = 0.0

    @classmethod
    def still(cls, camera: Camera, world_T_camera: Pose) -> View:
        """Return a camera at rest."""
        return cls(camera, world_T_camera, np.zeros(3), np.zeros(3))

    def row_time_s(self, row: Array) -> Array:
        """Return when a row (any shape) is exposed, seconds after the middle row."""
        moment: Array = (np.asarray(row) / max(self.camera.height - 1, 1) - 0.5) * self.readout_s
        return moment

    def project(self, points_m: ArrayLike, velocity_mps: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Return the pixels (N, 2) of world points (N, 3) that move; NaN as `Camera.project`.

        velocity_mps: of the points in the world, (3,) of all or (N, 3).
        """
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
        pixels = self.camera.project(self.in_camera(points))
        if self.readout_s == 0.0 or not len(points):
            return pixels
        for _ in range(_ROUNDS):
            t = self.row_time_s(pixels[:, 1])
            pixels = self.camera.project(self.in_camera(points, np.where(np.isfinite(t), t, 0.0), velocity_mps))
        return pixels

    def in_camera(self, points_m: Array, t_s: Array | float = 0.0, velocity_mps: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Return world points (N, 3) in the camera frame at times (N,) or one time."""
        t = np.broadcast_to(np.asarray(t_s, dtype=np.float64), (len(points_m),))[:, None]
        seen_from = points_m - self.world_T_camera.translation - t * (self.velocity_mps - np.asarray(velocity_mps))
        # the frame has turned by exp(t w), so p_c = exp(-t w) R^T p
        inside: Array = _turned(seen_from @ self.world_T_camera.rotation, -t, self.rate_radps)
        return inside

    @cached_property
    def rays(self) -> tuple[Map, Map, Map]:
        """World directions (H, W) x 3 through all pixels; one unit of them is one metre of depth along the axis."""
        return self._turned_rays(*self.lens, self._row_times.reshape(-1, 1))

    def rays_at(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> tuple[Map, Map, Map]:
        """World directions (h, w) x 3 as `rays`, through the pixels of some rows (h,) and columns (w,)."""
        x, y = (part[np.ix_(rows, columns)] for part in self.lens)
        return self._turned_rays(x, y, self._row_times[rows].reshape(-1, 1))

    def _turned_rays(self, x: Map, y: Map, t_s: Map) -> tuple[Map, Map, Map]:
        if not (self.readout_s and self.rate_radps.any()):
            return _rotated(self.world_T_camera.rotation, x, y)
        first = _rotated(skew(self.rate_radps), x, y)
        second = _rotated(skew(self.rate_radps), *first)
        half = np.float32(0.5) * t_s * t_s
        dx, dy = (d + t_s * a + half * b for d, a, b in zip((x, y), first, second, strict=False))
        dz = np.float32(1.0) + t_s * first[2] + half * second[2]
        return _rotated(self.world_T_camera.rotation, dx, dy, dz)

    @property
    def lens(self) -> tuple[Map, Map]:
        """Undistorted x/z, y/z (H, W) of every pixel, by Chebyshev interpolation between exact values."""
        return _lens(self.camera)

    def plane_depth(self, z_m: float) -> Map:
        """Return the depth (H, W) along the optical axis of the level plane at height z_m; inf where it is not seen."""
        away = np.float32(z_m) - self.origin(2)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth: Map = away / self.rays[2]
        if not 0.0 < float(depth.min()) <= float(depth.max()) < np.inf:
            depth[~(depth > 0)] = np.inf
        return depth

    def origin(self, axis: int) -> Map:
        """Return the camera's coordinate (H, 1) along a world axis when each row is exposed."""
        along = self.world_T_camera.translation[axis] + self._row_times * self.velocity_mps[axis]
        place: Map = along.astype(np.float32).reshape(-1, 1)
        return place

    @cached_property
    def _row_times(self) -> Map:
        times: Map = self.row_time_s(np.arange(self.camera.height, dtype=np.float64)).astype(np.float32)
        return times


def _nodes(size: int) -> Array:
    """Return Chebyshev points over the pixels of an axis, as pixel coordinates."""
    nodes: Array = (chebyshev.chebpts1(_NODES) + 1.0) / 2.0 * size - 0.5
    return nodes


@lru_cache(maxsize=8)
def _basis(size: int) -> Array:
    """Return the (size, nodes) matrix from values at `_nodes` to values at every pixel."""
    to_coefficients = np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts1(_NODES), _NODES - 1))
    at = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    basis: Array = chebyshev.chebvander(at, _NODES - 1) @ to_coefficients
    return basis


@lru_cache(maxsize=2)
def _lens(camera: Camera) -> tuple[Map, Map]:
    """Return `View.lens`, which all views of a camera share."""
    across, down = (_nodes(n) for n in (camera.width, camera.height))
    grid = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    exact = camera.normalize(grid).reshape(_NODES, _NODES, 2)
    rows, columns = (_basis(n) for n in (camera.height, camera.width))
    x, y = ((rows @ exact[:, :, i] @ columns.T).astype(np.float32) for i in (0, 1))
    for part in (x, y):
        part.setflags(write=False)
    return x, y


def _rotated(matrix: Array, x: Map, y: Map, z: Map | None = None) -> tuple[Map, Map, Map]:
    """Return rotated vectors, z is 1 where it is not given."""
    m = matrix.astype(np.float32)
    turned = []
    for row in m:
        part = row[0] * x
        part += row[1] * y
        part += row[2] if z is None else row[2] * z
        turned.append(part)
    first, second, third = turned
    return first, second, third


def _turned(points: Array, t: Array, rate_radps: Array) -> Array:
    """Return points (N, 3) turned by t (N, 1) times the rate: exp(t w) to its second order, as `rays` has it."""
    if not rate_radps.any() or not t.any():
        return points
    turning = skew(rate_radps).T
    first = points @ turning
    turned: Array = points + t * first + t * t / 2.0 * (first @ turning)
    return turned
