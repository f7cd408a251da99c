"""The picture of a tag as a blurred camera sees it, with its derivatives, ready to be looked up.

With S(t) a unit step blurred by a Gaussian, the module picture is a sum of 2-D steps at the module edges e_i:

    M(x, y) = sum_ij W[i, j] S(y - e_i) S(x - e_j)

so M and its derivatives are exact at any resolution. They are sampled once for a blur and then looked up bilinearly.
The second derivatives bridge from one blur to another, along each direction: dM/dt = 1/2 (a Mxx + 2 b Mxy + c Myy)
when the blur's covariance grows by t [a b; b c].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.families import tag_family
from landtool.geometry import Array

_ALONG_EDGE = (0.125, 0.375, 0.625, 0.875)
_BLUR_STEP = 1.12  # neighbouring templates differ by this factor in blur
_SAMPLES_PER_SIGMA = 4.0
_MAX_SAMPLES = 48  # a module


@dataclass(frozen=True, eq=False)
class Template:
    """A sampled picture of one tag. Coordinates are modules from the tag's centre, x right, y down.

    reach: half width of the reference image. half: half width of the measured quadrilateral. blur: the Gaussian's
    standard deviation. first: (n, n, 3) float32 of M in [0, 1], dM/dx, dM/dy. second: (n, n, 3) float32 of d2M/dx2,
    d2M/dxdy, d2M/dy2.
    """

    reach: float
    half: float
    blur: float
    first: NDArray[np.float32]
    second: NDArray[np.float32]

    def look_up(self, places: Array) -> tuple[Array, Array]:
        """Return M, dM/dx, dM/dy (3, N) and d2M/dx2, d2M/dxdy, d2M/dy2 (3, N) at places (2, N)."""
        n = len(self.first)
        # sample k stands at (k + 0.5) / n of the width
        grid = (places.T * (n / (2.0 * self.reach)) + 0.5 * (n - 1)).astype(np.float32)[:, None]
        first, second = (_interpolate(samples, grid).T for samples in (self.first, self.second))
        return first.astype(np.float64), second.astype(np.float64)


def _interpolate(samples: NDArray[np.float32], grid: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return samples (n, n, C) at places (N, 1, 2), column and row, as (N, C)."""
    found = cv2.remap(samples, grid, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    return np.asarray(found[:, 0], dtype=np.float32)


def template(family: str, tag_id: int, blur: float) -> Template:
    """Return the template whose blur (modules) is nearest to the wanted one."""
    return _template(family, tag_id, round(math.log(blur) / math.log(_BLUR_STEP)))


@lru_cache(maxsize=64)
def edge_places(family: str, tag_id: int) -> tuple[Array, Array, Array]:
    """Return places (2, E) at the edges between black and white modules, four an edge, and the edges' normals (2, E).

    The third is the centres (2, K) of all modules.
    """
    modules = tag_family(family).modules(tag_id)
    reach = len(modules) / 2.0
    row, column = np.nonzero(modules[:, 1:] != modules[:, :-1])
    upright = [np.stack([column + 1.0, row + along]) for along in _ALONG_EDGE]
    places, normals = list(upright), [np.broadcast_to([[1.0], [0.0]], p.shape) for p in upright]
    row, column = np.nonzero(modules[1:] != modules[:-1])
    level = [np.stack([column + along, row + 1.0]) for along in _ALONG_EDGE]
    places, normals = places + level, normals + [np.broadcast_to([[0.0], [1.0]], p.shape) for p in level]
    centres = np.stack([axis.ravel() + 0.5 for axis in np.indices(modules.shape)])
    return np.concatenate(places, axis=1) - reach, np.concatenate(normals, axis=1), centres - reach


@lru_cache(maxsize=64)
def _template(family: str, tag_id: int, blur_index: int) -> Template:
    layout = tag_family(family)
    modules = layout.modules(tag_id).astype(np.float64)
    reach = layout.total_modules / 2.0
    blur = _BLUR_STEP**blur_index
    n = layout.total_modules * min(max(math.ceil(_SAMPLES_PER_SIGMA / blur), 4), _MAX_SAMPLES)
    step, slope, bend = _steps((np.arange(n) + 0.5) / n * 2.0 * reach - reach, blur, reach)
    weights = np.diff(np.diff(modules, axis=0, prepend=0.0), axis=1, prepend=0.0)
    # rows belong to y, columns to x
    first = (step @ weights @ step.T, step @ weights @ slope.T, slope @ weights @ step.T)
    second = (step @ weights @ bend.T, slope @ weights @ slope.T, bend @ weights @ step.T)
    planes = (np.stack(part, axis=-1).astype(np.float32) for part in (first, second))
    return Template(reach, layout.border_modules / 2.0, blur, *planes)


def _steps(t: Array, blur: float, reach: float) -> tuple[Array, Array, Array]:
    """Blurred steps S((t - e_i) / blur) and their first and second derivatives by t, each (N, modules)."""
    edges = np.arange(round(2.0 * reach)) - reach
    z = (t[:, None] - edges) / blur
    z[:, 0] = 40.0  # what lies outside the picture is not known: its first module goes on outwards
    step = 0.5 * (1.0 + np.vectorize(math.erf, otypes=[np.float64])(z / math.sqrt(2.0)))
    density = np.exp(-0.5 * z * z) / (math.sqrt(2.0 * math.pi) * blur)
    return step, density, -density * z / blur
