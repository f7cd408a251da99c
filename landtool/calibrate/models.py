"""The lens models a camera is calibrated with, and whether another one than was chosen fits clearly better."""

from __future__ import annotations

from landtool.calibrate.calibration import Calibration
from landtool.calibrate.solve import Solution, solve
from landtool.camera import DistortionModel
from landtool.errors import InputError
from landtool.io.camera_check import refuse_impossible

MODELS: dict[str, DistortionModel] = {
    "plumb_bob": "plumb_bob",
    "fisheye": "equidistant",
    "rational": "rational_polynomial",
}
"""By their names on the command line, those with fewer coefficients first."""
_CLEARLY = 1.1  # times smaller residuals: of rendered lenses the true one reaches 1.15 to 6, an equal one 1.01
_AS_GOOD = 1.05  # within this the model of fewer coefficients is preferred


def better_model(calibration: Calibration) -> list[str]:
    """Say which other model fits the calibration's own views clearly better; nothing when none does."""
    solution, views = calibration.solution, [named.view for named in calibration.views]
    size = calibration.camera.width, calibration.camera.height
    best: tuple[str, Solution] | None = None
    for name, model in MODELS.items():
        if model == calibration.camera.model:
            continue
        try:
            other = solve(calibration.board, views, size, model)
            refuse_impossible(other.camera)
        except InputError:
            continue  # this lens is none that explains the views
        if best is None or _AS_GOOD * other.scale < best[1].scale:
            best = name, other
    if best is None or solution.scale < _CLEARLY * best[1].scale:
        return []
    name, other = best
    return [f"another lens model fits better, rms {other.rms_px:.3f} against {solution.rms_px:.3f} px: --model {name}"]
