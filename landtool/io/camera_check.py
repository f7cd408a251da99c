"""Calibrations that parse but that no camera has: everything measured with them would be silently wrong."""

from __future__ import annotations

import numpy as np

from landtool.camera import Camera
from landtool.errors import InputError

_FOCAL_LENGTHS = 0.02, 200.0  # in sides of the image: fields of view from 175 degrees down to a third of one
_HINT = "calibrate the camera again"


def refuse_impossible(camera: Camera) -> None:
    """Raise InputError for a focal length, principal point or lens distortion that cannot be."""
    size = max(camera.width, camera.height)
    images = f"images of {camera.width}x{camera.height}"
    if not all(_FOCAL_LENGTHS[0] * size < f < _FOCAL_LENGTHS[1] * size for f in (camera.fx, camera.fy)):
        raise InputError(f"a focal length of {camera.fx:g}, {camera.fy:g} px is impossible for {images}", hint=_HINT)
    if abs(camera.cx - camera.width / 2) > 2 * size or abs(camera.cy - camera.height / 2) > 2 * size:
        raise InputError(f"the principal point {camera.cx:g}, {camera.cy:g} lies far outside {images}", hint=_HINT)
    if not _can_be_undone(camera):
        raise InputError(f"its distortion folds {images} onto themselves", hint=_HINT)


def _can_be_undone(camera: Camera) -> bool:
    """Return whether the lens model has an inverse halfway from the middle to each edge."""
    middle = np.array([(camera.width - 1) / 2, (camera.height - 1) / 2])
    points = middle + np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]) * (camera.width / 4, camera.height / 4)
    try:
        with np.errstate(all="ignore"):
            again = camera.project(np.column_stack([camera.normalize(points), np.ones(4)]))
    except np.linalg.LinAlgError:  # coefficients beyond what a polynomial's roots can be found for
        return False
    return bool((np.abs(again - points) < 1.0).all())
