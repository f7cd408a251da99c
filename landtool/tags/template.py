"""The picture of a tag as a blurred camera sees it, with its derivatives, ready to be looked up.

With S(t) a unit step blurred by a Gaussian, the module picture is a sum of 2-D steps at the module edges e_i:

    M(x, y) = sum_ij W[i, j] S(y - e_i) S(x - e_j)

so M and its derivatives by x, y and the blur are exact at any resolution. They are sampled once for a blur and
then looked up bilinearly.
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

_BLUR_STEP = 1.15  # neighbouring templates differ by this factor in blur; the derivative bridges the rest
_SAMPLES_PER_SIGMA = 3.0


@dataclass(frozen=True, eq=False)
class Template:
    """A sampled picture of one tag. Coordinates are modules from the tag's centre, x right, y down.

    reach: half width of the reference image. half: half width of the measured quadrilateral. blur: the Gaussian's
    standard deviation. samples: (n, n, 4) float32 of M in [0, 1], dM/dx, dM/dy, dM/dblur.
    """

    reach: float
    half: float
    blur: float
    samples: NDArray[np.float32]

    def look_up(self, x: Array, y: Array) -> Array:
        """Return M, dM/dx, dM/dy, dM/dblur (N, 4) at places x, y (N,)."""
        n = len(self.samples)
        # sample k stands at (k + 0.5) / n of the width
        grid = np.empty((len(x), 1, 2), dtype=np.float32)
        grid[:, 0, 0] = (x + self.reach) * (n / (2.0 * self.reach)) - 0.5
        grid[:, 0, 1] = (y + self.reach) * (n / (2.0 * self.reach)) - 0.5
        found = cv2.remap(self.samples, grid, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return found[:, 0].astype(np.float64)


def template(family: str, tag_id: int, blur: float) -> Template:
    """Return the template whose blur (modules) is nearest to the wanted one."""
    return _template(family, tag_id, round(math.log(blur) / math.log(_BLUR_STEP)))


@lru_cache(maxsize=64)
def _template(family: str, tag_id: int, blur_index: int) -> Template:
    layout = tag_family(family)
    modules = layout.modules(tag_id).astype(np.float64)
    reach = layout.total_modules / 2.0
    blur = _BLUR_STEP**blur_index
    n = layout.total_modules * min(max(math.ceil(_SAMPLES_PER_SIGMA / blur), 4), 40)
    steps, by_place, by_blur = _steps((np.arange(n) + 0.5) / n * 2.0 * reach - reach, blur, reach)
    weights = np.diff(np.diff(modules, axis=0, prepend=0.0), axis=1, prepend=0.0)
    rows = steps @ weights
    planes = (
        rows @ steps.T,
        rows @ by_place.T,
        by_place @ weights @ steps.T,
        rows @ by_blur.T + by_blur @ weights @ steps.T,
    )
    return Template(reach, layout.border_modules / 2.0, blur, np.stack(planes, axis=-1).astype(np.float32))


def _steps(t: Array, blur: float, reach: float) -> tuple[Array, Array, Array]:
    """Blurred steps S((t - e_i) / blur) and their derivatives by t and by blur, each (N, modules)."""
    edges = np.arange(round(2.0 * reach)) - reach
    z = (t[:, None] - edges) / blur
    z[:, 0] = 40.0  # what lies outside the picture is not known: its first module goes on outwards
    step = 0.5 * (1.0 + np.vectorize(math.erf, otypes=[np.float64])(z / math.sqrt(2.0)))
    density = np.exp(-0.5 * z * z) / (math.sqrt(2.0 * math.pi) * blur)
    return step, density, -density * z
