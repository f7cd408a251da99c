"""A pose refined on the pad's large edges together with the corners of its tags.

Corners and edges are independent measurements of one pose T, each edge an offset o_i along its normal n_i:

    minimise  r(T)^T W r(T) + sum_i rho( (o_i(T) - d)^2 / s^2 ) + d^2 / s_d^2

by Gauss-Newton, with the edges measured anew at every step. rho is Huber's, s the spread of the edges themselves. d is
a shift of all edges into the dark, which a tone curve makes that is not quite the camera's: ring and H have edges that
face both ways, so it is told apart from the pad's distance.
"""

from __future__ import annotations

import numpy as np

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.tags.pose import Corners, Solution
from landtool.target.edges import Edges, measure_edges
from landtool.tone import Tone
from landtool.types import Image

_ROUNDS = 6
_STOP_RAD, _STOP_PX = 4e-3, 0.05  # the next step would be several times smaller
_LEAST_SHARE = 0.4  # of the edges in the picture; with fewer something covers the pad, or it is another
_LEAST_SIGMA_PX = 0.08  # an edge is never known better: paper and print are not exact
_SHIFT_SIGMA_PX = 0.2  # a gamma of 1.4 or 3 taken for sRGB's, at a blur of 0.6 px
_MOST_SIGMA_PX = 0.4  # wider scatter is no blurred print but another picture: a tag without ring and H around it
_HUBER = 2.0
_MOST_CHI2 = 4.0  # a corner or edge; well above what noise gives


def refine_on_edges(image: Image, corners: Corners, start: Solution, pad: PadSpec, tone: Tone) -> Solution | None:
    """Return a tag's solution refined on the edges, with chi2 over corners and edges.

    None when too few edges are seen, or the pose that fits them best does not explain them.
    image: (H, W, 3) BGR uint8.
    """
    solution, shift_px = start, 0.0
    for _ in range(_ROUNDS):
        edges = measure_edges(image, corners.camera, solution.camera_T_pad, pad, tone)
        if edges is None or edges.share < _LEAST_SHARE:
            return None
        taken = _step(corners, edges, solution, shift_px)
        if taken is None:
            return None
        step, solution = taken
        shift_px += float(step[6])
        if np.abs(step[3:6]).max() < _STOP_RAD and abs(step[6]) < _STOP_PX:
            return solution if solution.chi2 < _MOST_CHI2 * (len(edges.offsets_px) + len(corners.flat)) else None
    return None


def _step(corners: Corners, edges: Edges, now: Solution, shift_px: float) -> tuple[Array, Solution] | None:
    """One Gauss-Newton step (7,) of pose and shift, its chi2 that of where it starts; None when no pose explains them.

    shift_px: of all edges into the dark, as it is known so far.
    """
    pose, jacobian = now.camera_T_pad, np.column_stack([edges.jacobian, np.ones(len(edges.offsets_px))])
    # the edges' own scatter, what no pose explains, so that a wrong pose does not excuse itself
    plain = jacobian.T @ jacobian
    plain += np.diag(1e-9 * np.diag(plain) + 1e-9)  # edges in one line leave a direction open
    scatter = edges.offsets_px - jacobian @ np.linalg.solve(plain, jacobian.T @ edges.offsets_px)
    sigma = max(1.4826 * float(np.median(np.abs(scatter))), _LEAST_SIGMA_PX)
    if sigma > _MOST_SIGMA_PX:
        return None
    offsets = edges.offsets_px - shift_px
    weight = np.minimum(1.0, _HUBER * sigma / np.maximum(np.abs(offsets), 1e-9)) / sigma**2
    normal = jacobian.T @ (jacobian * weight[:, None])
    gradient = jacobian.T @ (weight * offsets)
    by_corners, corners_gradient, chi2 = corners.terms(pose)
    normal[:6, :6] += by_corners
    gradient[:6] += corners_gradient
    normal[6, 6] += 1.0 / _SHIFT_SIGMA_PX**2
    gradient[6] -= shift_px / _SHIFT_SIGMA_PX**2
    step = np.asarray(np.linalg.solve(normal, gradient))
    moved, covariance = pose.perturbed(step[:6]), np.linalg.inv(normal)[:6, :6]
    chi2 += float(weight @ offsets**2) + (shift_px / _SHIFT_SIGMA_PX) ** 2
    return step, Solution(moved, np.asarray(covariance), chi2, corners.reproj_px(moved))
