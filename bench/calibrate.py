"""`landtool calibrate` on rendered boards: corners, cameras, honest uncertainties, and time, against the truth."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import cv2
import numpy as np

from bench.show import table
from landtool.calibrate.board import KINDS, Board, BoardKind
from landtool.calibrate.calibration import NamedView, calibrate_views
from landtool.calibrate.corners import BoardView, find_board
from landtool.camera import Camera
from landtool.errors import InputError
from landtool.geometry import Array
from landtool.synth.board_view import Scene, board_pose, draw_board
from landtool.synth.sensor import Sensor

VIEWS, TURNS = 24, 3
SIZE = 640, 480
# Name, model to solve for, camera
CAMERAS = {
    "65 degrees, barrel": Camera(*SIZE, 500.0, 501.0, 324.0, 234.0, "plumb_bob", (-0.24, 0.07, 6e-4, -4e-4, 0.0)),
    "90 degrees, barrel": Camera(*SIZE, 330.0, 331.0, 314.0, 245.0, "plumb_bob", (-0.22, 0.05, -5e-4, 5e-4, -0.005)),
    "35 degrees": Camera(*SIZE, 1010.0, 1011.0, 322.0, 239.0, "plumb_bob", (0.08, -0.15, 0.0, 0.0, 0.0)),
    "fisheye 120 degrees": Camera(*SIZE, 300.0, 301.0, 325.0, 236.0, "equidistant", (-0.02, 0.004, -0.002, 2e-4)),
}
SENSORS = {
    "clean": Sensor(psf_sigma_px=0.6, shot_variance=1e-4, read_variance=5e-6),
    "noisy": Sensor(psf_sigma_px=0.8, shot_variance=2e-3, read_variance=2e-4),
    "blurred": Sensor(psf_sigma_px=1.4, shot_variance=3e-4, read_variance=2e-5),
    "another tone": Sensor(psf_sigma_px=0.8, shot_variance=3e-4, read_variance=2e-5, contrast=0.7, gamma=1.2),
}


@dataclass
class Tally:
    """What came out of several calibrations."""

    focal: list[float] = field(default_factory=list)
    centre: list[float] = field(default_factory=list)
    z: list[float] = field(default_factory=list)
    corner: list[Array] = field(default_factory=list)
    corner_cv: list[Array] = field(default_factory=list)
    found: int = 0
    drawn: int = 0
    seconds: float = 0.0
    solving: list[float] = field(default_factory=list)
    failed: int = 0


def main() -> None:
    """Print cameras by board and lens, by board and picture, and corners against OpenCV's."""
    _lenses()
    _pictures()


def _lenses() -> None:
    rows, all_z = [], []
    for name, camera in CAMERAS.items():
        for kind in KINDS:
            tally = _run(kind, camera, SENSORS["clean"])
            all_z += tally.z
            rows.append((name, kind, *_row(tally)))
    table(f"Cameras from {VIEWS} views, {TURNS} times each: worst errors", HEAD, rows)
    z = np.abs(all_z)
    print(f"\nerror over its standard deviation, all parameters: median {np.median(z):.2f}, 0.67 is honest; "
          f"within 3: {100 * (z < 3).mean():.1f} %")  # fmt: skip


HEAD = (
    "lens", "board", "found", "focal, %", "centre, px", "|error|/sigma", "corner, px", "cornerSubPix, px", "pictures/s",
    "solve, s", "failed",
)  # fmt: skip


def _pictures() -> None:
    camera = CAMERAS["65 degrees, barrel"]
    rows = [(name, kind, *_row(_run(kind, camera, s))) for name, s in SENSORS.items() for kind in KINDS]
    table("The same with noise, blur and another tone curve, 65 degrees", ("picture", *HEAD[1:]), rows)


def _row(t: Tally) -> tuple[str, ...]:
    if not t.focal:
        return (f"{t.found}/{t.drawn}", *("-",) * 7, str(t.failed))
    return (
        f"{t.found}/{t.drawn}",
        f"{100 * max(t.focal):.3f}",
        f"{max(t.centre):.2f}",
        f"{np.median(np.abs(t.z)):.2f}",
        f"{np.median(np.concatenate(t.corner)):.3f}",
        f"{np.median(np.concatenate(t.corner_cv)):.3f}",
        f"{t.drawn / t.seconds:.0f}",
        f"{np.median(t.solving):.2f}",
        str(t.failed),
    )


def _run(kind: BoardKind, camera: Camera, sensor: Sensor) -> Tally:
    tally, board = Tally(), Board.usual(kind)
    for seed in range(TURNS):
        rng = np.random.default_rng(seed)
        views = []
        for index in range(VIEWS):
            pose = board_pose(board, camera, rng, whole=kind == "chessboard")
            image = draw_board(Scene(board), camera, pose, sensor, rng)
            start = time.thread_time()
            seen = find_board(image, board)
            tally.seconds += time.thread_time() - start
            tally.drawn += 1
            if seen.view is None:
                continue
            views.append(NamedView(index, "", seen.view))
            truth = camera.project(pose.apply(board.points_m))
            _count_corners(tally, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), seen.view, truth, kind)
        tally.found += len(views)
        _count_camera(tally, board, views, camera)
    return tally


def _count_corners(tally: Tally, grey: Array, view: BoardView, truth: Array, kind: BoardKind) -> None:
    tries = [truth[view.ids], truth[::-1][view.ids]] if kind == "chessboard" else [truth[view.ids]]
    ours, there = min(
        ((np.linalg.norm(view.pixels - t, axis=1), t) for t in tries), key=lambda pair: np.median(pair[0])
    )
    tally.corner.append(ours)
    start = np.ascontiguousarray(np.rint(there), np.float32)[:, None].copy()
    theirs = cv2.cornerSubPix(grey, start, (4, 4), (-1, -1), (3, 40, 1e-3))[:, 0]
    tally.corner_cv.append(np.linalg.norm(theirs - there, axis=1))


def _count_camera(tally: Tally, board: Board, views: list[NamedView], truth: Camera) -> None:
    start = time.thread_time()
    try:
        solution = calibrate_views(board, views, SIZE, truth.model).solution
    except InputError:
        tally.failed += 1
        return
    tally.solving.append(time.thread_time() - start)
    camera, sigma = solution.camera, solution.sigmas
    tally.focal.append(max(abs(camera.fx / truth.fx - 1), abs(camera.fy / truth.fy - 1)))
    tally.centre.append(max(abs(camera.cx - truth.cx), abs(camera.cy - truth.cy)))
    got, true = (np.array([c.fx, c.fy, c.cx, c.cy, *c.distortion]) for c in (camera, truth))
    tally.z += ((got - true)[solution.free] / sigma[solution.free]).tolist()
