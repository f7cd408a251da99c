"""A pose refined on the pad's large edges together with the corners of its tags.

Corners and edges are independent measurements of one pose T, each edge an offset o_i along its normal n_i:

    minimise  r(T)^T W r(T) + sum_i rho( o_i(T)^2 / s^2 )

by Gauss-Newton, with the edges measured anew at every step. rho is Huber's, s the spread of the edges themselves.
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
_STOP_RAD = 4e-3  # the next step would be several times smaller
_LEAST_SHARE = 0.4  # of the edges in the picture; with fewer something covers the pad, or it is another
_LEAST_SIGMA_PX = 0.08  # an edge is never known better: paper and print are not exact
_MOST_SIGMA_PX = 0.4  # wider scatter is no blurred print but another picture: a tag without ring and H around it
_HUBER = 2.0
_MOST_CHI2 = 4.0  # a corner or edge; well above what noise gives


def refine_on_edges(image: Image, corners: Corners, start: Solution, pad: PadSpec, tone: Tone) -> Solution | None:
    """Return a tag's solution refined on the edges, with chi2 over corners and edges.

    None when too few edges are seen, or the pose that fits them best does not explain them.
    image: (H, W, 3) BGR uint8.
    """
    solution = start
    for _ in range(_ROUNDS):
        edges = measure_edges(image, corners.camera, solution.camera_T_pad, pad, tone)
        if edges is None or edges.share < _LEAST_SHARE:
            return None
        taken = _step(corners, edges, solution)
        if taken is None:
            return None
        step, solution = taken
        if np.abs(step[3:]).max() < _STOP_RAD:
            return solution if solution.chi2 < _MOST_CHI2 * (len(edges.offsets_px) + len(corners.flat)) else None
    return None


def _step(corners: Corners, edges: Edges, now: Solution) -> tuple[Array, Solution] | None:
    """One Gauss-Newton step, its chi2 that of the pose it starts from; None when no pose explains the edges."""
    pose, offsets, jacobian = now.camera_T_pad, edges.offsets_px, edges.jacobian
    # the edges' own scatter, what no pose explains, so that a wrong pose does not excuse itself
    plain = jacobian.T @ jacobian
    plain += np.diag(1e-9 * np.diag(plain) + 1e-9)  # edges in one line leave a direction open
    scatter = offsets - jacobian @ np.linalg.solve(plain, jacobian.T @ offsets)
    sigma = max(1.4826 * float(np.median(np.abs(scatter))), _LEAST_SIGMA_PX)
    if sigma > _MOST_SIGMA_PX:
        return None
    weight = np.minimum(1.0, _HUBER * sigma / np.maximum(np.abs(offsets), 1e-9)) / sigma**2
    normal, gradient, chi2 = corners.terms(pose)
    normal = normal + jacobian.T @ (jacobian * weight[:, None])
    step = np.asarray(np.linalg.solve(normal, gradient + jacobian.T @ (weight * offsets)))
    moved, covariance = pose.perturbed(step), np.asarray(np.linalg.inv(normal))
    return step, Solution(moved, covariance, chi2 + float(weight @ offsets**2), corners.reproj_px(moved))
