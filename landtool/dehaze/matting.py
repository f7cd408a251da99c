"""Step 4, the slow way: soft matting fits the transmission to the picture's edges.

A. Levin, D. Lischinski, Y. Weiss, A closed-form solution to natural image matting, 2008; its use for haze: K. He,
J. Sun, X. Tang, Single image haze removal using dark channel prior, 2011.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.sparse import dia_array, diags_array
from scipy.sparse.linalg import cg

from landtool.dehaze.air import Map
from landtool.errors import InputError
from landtool.geometry import Array
from landtool.types import Image

# the regularisation of the colour model in a window, as its authors have it
MATTING_EPSILON = 1e-7
_WINDOW_PX = 3
_TOLERANCE, _MOST_ITERATIONS = 1e-5, 20_000


def soft_matting(image: Image, values: Map, weight: float) -> Map:
    """Return values (H, W) fitted to the edges of a picture (H, W, 3).

    weight: lambda, how much the values before count. Raises InputError when the system does not converge.
    """
    # (L + lambda U) t = lambda t~
    laplacian = matting_laplacian(image, MATTING_EPSILON)
    system = (laplacian + weight * diags_array(np.ones(values.size))).tocsr()
    before = values.astype(np.float64).ravel()
    # conjugate gradients, each unknown scaled by its own diagonal entry (Jacobi)
    scale = diags_array(1.0 / system.diagonal())
    solved, failed = cg(system, weight * before, x0=before, rtol=_TOLERANCE, maxiter=_MOST_ITERATIONS, M=scale)
    if failed:
        raise InputError("the matting system does not converge", hint="raise matting_lambda, or refine = guided")
    return np.asarray(solved.reshape(values.shape), dtype=np.float32)


def matting_laplacian(image: Image, epsilon: float) -> dia_array:
    """Return the matting Laplacian (H W, H W), sparse and symmetric, of a picture (H, W, 3), rows of pixels first.

    Windows of 3 x 3 pixels, or as much of them as a picture has that is smaller.
    """
    height, width = image.shape[:2]
    places = list(itertools.product(range(min(_WINDOW_PX, height)), range(min(_WINDOW_PX, width))))
    rows, columns = height - places[-1][0], width - places[-1][1]
    off_mean, weighted = _windows(image / 255.0, places, (rows, columns), epsilon)
    count = len(places)
    diagonals: dict[int, Array] = {}
    for (i, (top, left)), (j, (below, right)) in itertools.product(enumerate(places), repeat=2):
        # L_ij = sum over windows k that hold i and j, of
        #   delta_ij - (1 + (I_i - mu_k)^T (Sigma_k + epsilon / |w| U)^-1 (I_j - mu_k)) / |w|
        entry = (i == j) - (1.0 + np.einsum("...c,...c->...", off_mean[i], weighted[j])) / count
        # symmetric: the column of an entry can stand for its row
        offset = (top - below) * width + left - right
        plane = diagonals.setdefault(offset, np.zeros((height, width)))
        plane[below : below + rows, right : right + columns] += entry
    # below and right of the last window lies nothing, so no entry reaches over the end of a row
    offsets = sorted(diagonals)
    data = np.stack([diagonals[-offset].ravel() for offset in offsets])
    return dia_array((data, offsets), shape=(height * width, height * width))


def _windows(
    values: Array, places: list[tuple[int, int]], shape: tuple[int, int], epsilon: float
) -> tuple[list[Array], list[Array]]:
    """Return for each place in a window I - mu, and (Sigma + epsilon / |w| U)^-1 (I - mu), of all windows (h, w, 3)."""
    rows, columns = shape
    inside = [values[top : top + rows, left : left + columns] for top, left in places]
    count = len(places)
    mean = sum(inside) / count
    off_mean = [part - mean for part in inside]
    covariance = sum(part[..., :, None] * part[..., None, :] for part in off_mean) / count
    inverse = np.linalg.inv(covariance + epsilon / count * np.eye(3))
    return off_mean, [np.einsum("...cd,...d->...c", inverse, part) for part in off_mean]
