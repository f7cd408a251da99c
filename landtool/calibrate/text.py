"""A calibration in words and as plain values."""

from __future__ import annotations

from typing import Any

import numpy as np

from landtool.calibrate.calibration import Calibration
from landtool.camera import DistortionModel

NAMES: dict[DistortionModel, tuple[str, ...]] = {
    "plumb_bob": ("k1", "k2", "p1", "p2", "k3"),
    "rational_polynomial": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "equidistant": ("k1", "k2", "k3", "k4"),
}


def calibration_lines(calibration: Calibration) -> list[str]:
    """Return the result as text, a fact a line."""
    solution, camera = calibration.solution, calibration.camera
    s = solution.sigmas
    used, refused = len(calibration.views), len(calibration.refused)
    corners = sum(len(named.view.ids) for named in calibration.views)
    distortion = [
        f"{name} {value:.4g} +- {sigma:.2g}" if free else f"{name} 0 (not determined)"
        for name, value, sigma, free in zip(
            NAMES[camera.model], camera.distortion, s[4:], solution.free[4:], strict=True
        )
    ]
    tilt = calibration.largest_tilt_deg
    tilted = "tilt not told from none" if tilt is None else f"tilt up to {tilt[0]:.1f} +- {tilt[1]:.1f} degrees"
    return [
        f"views {used} used, {refused} refused, {calibration.spare} not needed; {corners} corners",
        f"rms {solution.rms_px:.3f} px",
        f"fx {camera.fx:.2f} +- {s[0]:.2f}, fy {camera.fy:.2f} +- {s[1]:.2f} px",
        f"cx {camera.cx:.2f} +- {s[2]:.2f}, cy {camera.cy:.2f} +- {s[3]:.2f} px",
        f"{camera.model}: {', '.join(distortion)}",
        f"uncertainty at the picture's corners {calibration.edge_sigma_px:.2f} px",
        f"coverage {100 * calibration.covered:.0f} % of the picture, {tilted}",
        f"field of view {calibration.hfov_deg:.1f} degrees horizontally, {camera.width}x{camera.height}",
        f"verdict: {calibration.verdict}",
    ]


def calibration_values(calibration: Calibration) -> dict[str, Any]:
    """Return everything as plain values for JSON; what is not known is None."""
    solution, camera, board = calibration.solution, calibration.camera, calibration.board
    names = ("fx", "fy", "cx", "cy", *NAMES[camera.model])
    values = (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)
    return {
        "verdict": calibration.verdict,
        "warnings": list(calibration.warnings),
        "board": {"kind": board.kind, "columns": board.columns, "rows": board.rows, "square_m": board.square_m}
        | ({"marker_m": board.marker_m, "dictionary": board.dictionary} if board.kind == "charuco" else {})
        | ({"spacing": board.spacing} if board.kind == "aprilgrid" else {}),
        "image": {"width": camera.width, "height": camera.height},
        "model": camera.model,
        "parameters": {
            name: {"value": value, "sigma": float(sigma) if free else None, "solved": bool(free)}
            for name, value, sigma, free in zip(names, values, solution.sigmas, solution.free, strict=True)
        },
        "covariance": solution.covariance.tolist(),
        "rms_px": solution.rms_px,
        "edge_sigma_px": calibration.edge_sigma_px,
        "hfov_deg": calibration.hfov_deg,
        "coverage": {"share": calibration.covered, "corners_per_cell": calibration.cells.tolist()},
        "views": _view_values(calibration),
        "refused": [{"frame": r.frame, "file": r.file, "reason": r.reason} for r in calibration.refused],
        "not_needed": calibration.spare,
    }


def _view_values(calibration: Calibration) -> list[dict[str, Any]]:
    solution = calibration.solution
    rows = []
    for named, pose, rms, weight, tilt, tilt_sigma in zip(
        calibration.views,
        solution.poses,
        solution.view_rms_px,
        solution.weights,
        calibration.tilts_deg,
        calibration.tilt_sigmas_deg,
        strict=True,
    ):
        rows.append({
            "frame": named.frame,
            "file": named.file,
            "corners": len(named.view.ids),
            "corners_refused": int((weight <= 0).sum()),
            "rms_px": float(rms),
            "blur_px": float(np.median(named.view.blur_px)),
            "tilt_deg": [float(v) for v in tilt],
            "tilt_sigma_deg": [float(v) for v in tilt_sigma],
            "camera_T_board": {
                "translation_m": pose.translation.tolist(),
                "quaternion_wxyz": pose.quaternion_wxyz.tolist(),
            },
        })  # fmt: skip
    return rows
