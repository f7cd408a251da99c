"""From views of a board to a camera one can trust: choice, solution, refusal of what does not fit, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.calibrate.board import Board
from landtool.calibrate.choose import choose_views, coverage
from landtool.calibrate.corners import BoardView
from landtool.calibrate.solve import LEAST_VIEWS, Solution, solve
from landtool.camera import Camera, DistortionModel
from landtool.errors import InputError
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.camera_check import refuse_impossible

Verdict = Literal["good", "usable", "poor"]
_BLURRED = 1.8, 1.2  # times the median blur, and pixels at least, from which a view is refused
_SOFT_PX = 1.8  # median blur that is said
_STRANGE = 3.0  # times the median error of views, from which one is refused
_LEAST_ERROR_PX = 0.15  # a view below this is never strange
_BAND = 0.2  # of the picture's width or height: its sides
_SEEN = 0.35  # of a side's cells
_LEAST_TILT_DEG = 15.0
_FOCAL = 0.005, 0.02  # relative standard deviations from which the focal length is said to be uncertain, and poor
_UNDETERMINED = 0.1  # the same: distances are as wrong, and the covariance, a linear one, no longer says how much
_SURE = 3.0  # standard deviations that tell a tilt from none
_EDGE_PX = 1.0, 4.0  # the same of a ray at the picture's corners
_RMS = 0.0015  # of the picture's width: corners fit worse when the board is bent, the shutter rolls or it is no board


@dataclass(frozen=True, eq=False)
class NamedView:
    """A view and the frame it was found in."""

    frame: int
    file: str
    view: BoardView


@dataclass(frozen=True)
class Refused:
    """A frame that shows the board but takes no part, and why."""

    frame: int
    file: str
    reason: str


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera and how far to trust it.

    cells: corners in each cell of the picture. tilts_deg: (V, 2) of each view's board about the picture's x and y, as
    seen along the ray to it. tilt_sigmas_deg: (V, 2) standard deviations of them. edge_sigma_px: standard deviation of
    where a ray to the picture's worst corner is seen.
    """

    board: Board
    solution: Solution
    views: tuple[NamedView, ...]
    refused: tuple[Refused, ...]
    spare: int
    cells: NDArray[np.int64]
    tilts_deg: Array
    tilt_sigmas_deg: Array
    edge_sigma_px: float
    warnings: tuple[str, ...]
    verdict: Verdict

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.solution.camera

    @property
    def covered(self) -> float:
        """Share of the picture's cells that a corner lies in."""
        return float((self.cells > 0).mean())

    @property
    def largest_tilt_deg(self) -> tuple[float, float] | None:
        """The largest tilt, degrees, and its standard deviation; None when none is told from square on."""
        tilts, sigmas = np.abs(self.tilts_deg).ravel(), self.tilt_sigmas_deg.ravel()
        sure = np.flatnonzero(tilts > _SURE * sigmas)
        if not len(sure):
            return None
        largest = sure[tilts[sure].argmax()]
        return float(tilts[largest]), float(sigmas[largest])

    @property
    def hfov_deg(self) -> float:
        """Horizontal field of view through the middle row, from edge to edge, degrees."""
        camera = self.camera
        edges = np.array([[-0.5, camera.cy], [camera.width - 0.5, camera.cy]])
        rays = camera.unproject(edges)
        if not np.isfinite(rays).all():
            return 180.0
        return float(np.degrees(np.arccos(np.clip(rays[0] @ rays[1], -1.0, 1.0))))


def calibrate_views(
    board: Board, found: Sequence[NamedView], size: tuple[int, int], model: DistortionModel
) -> Calibration:
    """Calibrate from the views found in pictures of `size` (width, height).

    Raises InputError for too few, for views that determine no camera, its focal length uncertain by more than a tenth,
    and for a camera that cannot be.
    """
    sharp, refused = _without_blurred(found)
    order = choose_views(board, [named.view for named in sharp], size)
    views = [sharp[i] for i in order]
    solution = solve(board, [named.view for named in views], size, model)
    for _ in range(2):
        strange = _strange(solution)
        if not strange.any() or (~strange).sum() < LEAST_VIEWS:
            break
        errors = solution.view_rms_px
        typical = float(np.median(errors))
        for named, error in ((views[i], errors[i]) for i in np.flatnonzero(strange)):
            reason = f"does not fit the others ({error:.2f} px, they {typical:.2f})"
            refused.append(Refused(named.frame, named.file, reason))
        views = [named for named, off in zip(views, strange, strict=True) if not off]
        solution = solve(board, [named.view for named in views], size, model, solution.camera)
    _refuse_undetermined(solution)
    try:
        refuse_impossible(solution.camera)
    except InputError as error:
        other = "fisheye" if model != "equidistant" else "plumb_bob"
        hint = f"the board does not show enough, or the lens is another: try --model {other}"
        raise InputError(f"the views lead to no possible camera: {error.reason}", hint=hint) from error
    calibration = Calibration(
        board,
        solution,
        tuple(views),
        tuple(sorted(refused, key=lambda r: r.frame)),
        len(sharp) - len(order),
        coverage([named.view for named in views], size),
        np.array([_tilt_deg(board, pose) for pose in solution.poses]),
        _tilt_sigmas_deg(board, solution),
        _edge_sigma_px(solution),
        (),
        "good",
    )
    warnings = _warnings(calibration)
    return replace(calibration, warnings=warnings, verdict=_verdict(calibration, warnings))


def _without_blurred(found: Sequence[NamedView]) -> tuple[list[NamedView], list[Refused]]:
    blur = np.array([np.median(named.view.blur_px) for named in found])
    limit = max(_BLURRED[0] * float(np.median(blur)), _BLURRED[1]) if len(blur) else np.inf
    sharp = [named for named, b in zip(found, blur, strict=True) if b <= limit]
    if len(sharp) < LEAST_VIEWS:
        return list(found), []
    reason = "blurred by {:.1f} px"
    pairs = zip(found, blur, strict=True)
    return sharp, [Refused(named.frame, named.file, reason.format(b)) for named, b in pairs if b > limit]


def _strange(solution: Solution) -> NDArray[np.bool_]:
    """Tell which views (V,) fit worse than the others; by their medians, which single wrong corners leave alone."""
    errors = np.array([np.median(np.linalg.norm(residual, axis=1)) for residual in solution.residuals_px])
    off: NDArray[np.bool_] = errors > max(_STRANGE * float(np.median(errors)), _LEAST_ERROR_PX)
    return off


def _focal_share(solution: Solution) -> float:
    """Return the standard deviation of the focal length over it, of the less certain axis."""
    camera, sigmas = solution.camera, solution.sigmas
    return float(max(sigmas[0] / camera.fx, sigmas[1] / camera.fy))


def _refuse_undetermined(solution: Solution) -> None:
    if _focal_share(solution) <= _UNDETERMINED:
        return
    reason = (
        f"the views do not determine the camera, focal length {solution.camera.fx:.0f} +- {solution.sigmas[0]:.0f} px"
    )
    hint = "film the board tilted by 30 degrees to all four sides, near and far"
    raise InputError(reason, hint=hint)


def _tilt_deg(board: Board, pose: Pose) -> Array:
    """Return the tilt (2,) of a board about x and y, against the ray to its middle, degrees."""
    middle = np.array([*(v / 2.0 for v in board.extent_m), 0.0])
    ray = pose.apply(middle[None])[0]
    ray /= np.linalg.norm(ray)
    across = np.cross([0.0, 1.0, 0.0], ray)
    across /= max(float(np.linalg.norm(across)), 1e-9)
    down = np.cross(ray, across)
    normal = pose.rotation[:, 2] * np.sign(pose.rotation[:, 2] @ ray)
    tilt: Array = np.degrees(np.arctan2([normal @ down, normal @ across], normal @ ray))
    return tilt


def _tilt_sigmas_deg(board: Board, solution: Solution) -> Array:
    """Return the standard deviations (V, 2) of the tilts, degrees: J C J', J by differences."""
    step = 1e-6
    sigmas = []
    for pose, covariance in zip(solution.poses, solution.pose_covariances, strict=True):
        vector = np.array([*pose.rotvec, *pose.translation])
        columns = []
        for i in range(6):
            low, high = (vector + sign * step * np.eye(6)[i] for sign in (-1.0, 1.0))
            tilts = [_tilt_deg(board, Pose(rotation_from_rotvec(v[:3]), v[3:])) for v in (low, high)]
            columns.append((tilts[1] - tilts[0]) / (2.0 * step))
        j = np.column_stack(columns)
        sigmas.append(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", j, covariance, j), 0.0)))
    return np.array(sigmas)


def sigma_map_px(solution: Solution, pixels: Array) -> Array:
    """Return the standard deviation (N,) px of where the rays through pixels (N, 2) are seen; inf where there is none.

    Propagated as J C J', J the derivatives of the lens model by its parameters.
    """
    camera = solution.camera
    flat = camera.normalize(pixels)
    held = np.isfinite(flat).all(axis=1)
    sigma = np.full(len(pixels), np.inf)
    if not held.any():
        return sigma
    points = np.column_stack([flat[held], np.ones(int(held.sum()))])[:, None]
    distortion, zero = np.array(camera.distortion), np.zeros(3)
    if camera.model == "equidistant":
        j = cv2.fisheye.projectPoints(points, zero, zero, camera.matrix, distortion)[1][:, :8]
    else:
        j = cv2.projectPoints(points, zero, zero, camera.matrix, distortion)[1][:, 6 : 10 + len(distortion)]
    variance = np.einsum("ij,jk,ik->i", j, solution.covariance, j).reshape(-1, 2).sum(axis=1)
    sigma[held] = np.sqrt(np.maximum(variance, 0.0))
    return sigma


def _edge_sigma_px(solution: Solution) -> float:
    width, height = solution.camera.width, solution.camera.height
    corners = np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]], np.float64)
    sigma = sigma_map_px(solution, corners)
    known = sigma[np.isfinite(sigma)]  # a fisheye's circle may end before the corners
    middles = np.array([[0, (height - 1) / 2], [width - 1, (height - 1) / 2]])
    return float(known.max()) if len(known) else float(sigma_map_px(solution, middles).max())


def _warnings(calibration: Calibration) -> tuple[str, ...]:
    solution, camera = calibration.solution, calibration.camera
    said = []
    seen = calibration.cells > 0
    rows, columns = seen.shape
    wide, high = max(1, round(_BAND * columns)), max(1, round(_BAND * rows))
    sides = {"left": seen[:, :wide], "right": seen[:, -wide:], "top": seen[:high], "bottom": seen[-high:]}
    empty = [name for name, part in sides.items() if part.mean() < _SEEN]
    if empty:
        said.append(f"hardly any view shows the board at the {' and '.join(empty)}: distortion is a guess there")
    tilts = calibration.tilts_deg
    low, high_deg = np.percentile(tilts, 10, axis=0), np.percentile(tilts, 90, axis=0)
    flat = [name for i, name in ((0, "x"), (1, "y")) if max(-low[i], high_deg[i]) < _LEAST_TILT_DEG]
    if len(flat) == 2:
        said.append("the board is never tilted: focal length and distance cannot be told apart; tilt it by 30 degrees")
    elif flat:
        axis = {"x": "up and down", "y": "left and right"}[flat[0]]
        said.append(f"the board is hardly tilted {axis}; tilt it both ways")
    if len(calibration.views) < 10:
        said.append(f"only {len(calibration.views)} views; 15 and more make a calibration one can rely on")
    share = _focal_share(solution)
    if share > _FOCAL[0]:
        said.append(f"the focal length is uncertain by {100 * share:.1f} %: tilt the board more and bring it nearer")
    if calibration.edge_sigma_px > _EDGE_PX[0]:
        said.append(f"the picture's corners are uncertain by {calibration.edge_sigma_px:.1f} px: bring the board there")
    if solution.rms_px > max(_RMS * camera.width, 0.3):
        said.append(
            f"corners miss the model by {solution.rms_px:.2f} px: a bent board, a rolling shutter in motion, "
            "another lens model or wrong sizes of the board"
        )
    blur = float(np.median([np.median(named.view.blur_px) for named in calibration.views]))
    if blur > _SOFT_PX:
        said.append(f"the pictures are blurred by {blur:.1f} px: move slower, use more light, or focus")
    return tuple(said)


def _verdict(calibration: Calibration, warnings: Sequence[str]) -> Verdict:
    solution, camera = calibration.solution, calibration.camera
    share = _focal_share(solution)
    if share > _FOCAL[1] or calibration.edge_sigma_px > _EDGE_PX[1] or solution.rms_px > 2 * _RMS * camera.width:
        return "poor"
    return "usable" if warnings else "good"
