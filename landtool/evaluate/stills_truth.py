"""What a generated dataset's truth.csv says of each picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from landtool.camera import Camera
from landtool.errors import InputError
from landtool.evaluate.facts import Facts
from landtool.geometry import Array, Pose
from landtool.io.labels import picture_size
from landtool.io.tables import Cell, read_rows
from landtool.synth.dataset.rows import TRUTH_COLUMNS

_HINT = "generate the dataset again"
_BOX = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
_POSE = tuple(f"camera_T_pad_{name}" for name in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"))
_CORNERS = tuple(f"{axis}{i}_px" for i in range(4) for axis in "xy")
_CAMERA = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
# variance of a Gaussian of sigma 1, of a disc of radius 1 along any line, of a line of length 1
_BLUR_VARIANCE = {"psf_sigma_px": 1.0, "defocus_radius_px": 0.25, "motion_px": 1.0 / 12.0}

_Row = Mapping[str, Cell]


@dataclass(frozen=True, eq=False)
class StillTruth:
    """What is true of one picture; without a pad in it there is no pose, no corner and nothing visible.

    tag_corners_px: (4, 2) of the pad's first tag, upright top-left, top-right, bottom-right, bottom-left, OpenCV's
    pixels, in the picture or not. visible_fraction: share of the disc that is in the picture and not hidden.
    hidden: share of what is in the picture that something stands before.
    """

    facts: Facts
    camera: Camera
    camera_T_pad: Pose | None
    tag_corners_px: Array | None
    visible_fraction: float
    present: bool
    hidden: float | None = None


def read_stills_truth(path: Path) -> Mapping[str, StillTruth]:
    """Read a truth.csv with the columns of `TRUTH_COLUMNS`; the keys are the pictures' paths relative to its folder.

    The size of the pictures, all have the same, is that of the first one there is.
    Raises UsageError when it cannot be opened, InputError naming file and line or row when it is broken, names a
    picture twice or no picture that is there.
    """
    truths: dict[str, StillTruth] = {}
    size: tuple[int, int] | None = None
    for number, row in enumerate(read_rows(path, TRUTH_COLUMNS), start=1):
        file = str(row["file"] or "")
        where = f"row {number} ({file or 'no file'})"
        size = size or _size(path.parent / file)
        try:
            if not file or file in truths:
                raise InputError("the picture is named twice" if file else "it names no picture")
            truths[file] = _truth(row, size or (1, 1))
        except (InputError, ValueError) as error:
            reason = error.reason if isinstance(error, InputError) else str(error)
            raise InputError(f"{where}: {reason}", file=path, hint=_HINT) from error
    if truths and size is None:
        raise InputError("none of the pictures it names is there", file=path, hint="keep it in the dataset's folder")
    return truths


def _size(picture: Path) -> tuple[int, int] | None:
    return picture_size(picture) if picture.is_file() else None


def _truth(row: _Row, size: tuple[int, int]) -> StillTruth:
    if row["present"] not in (0, 1):
        raise InputError("present is neither 0 nor 1")
    present = bool(row["present"])
    fx, fy, cx, cy, *lens = _numbers(row, _CAMERA)
    camera = Camera(*size, fx, fy, cx, cy, distortion=tuple(lens))
    if not present:
        facts = Facts(fog_per_m=_number(row, "beta_per_m"), blur_px=_blur_px(row))
        return StillTruth(facts, camera, None, None, 0.0, False)
    x, y, z, *wxyz = _numbers(row, _POSE)
    pose = Pose.from_quaternion((x, y, z), wxyz)
    corners = np.array(_numbers(row, _CORNERS)).reshape(4, 2)
    return StillTruth(
        _facts(row, pose), camera, pose, corners, _number(row, "visible_fraction"), True, _number(row, "hidden")
    )


def _facts(row: _Row, camera_T_pad: Pose) -> Facts:
    box = None if row["x_min_px"] is None else _numbers(row, _BOX)
    far_m = float(np.linalg.norm(camera_T_pad.translation))
    if far_m <= 0.0:
        raise InputError("the pad is where the camera is")
    # cos a = |n . t| / |t|, with the pad's normal n and its place t in the camera frame
    cosine = abs(float(camera_T_pad.rotation[:, 2] @ camera_T_pad.translation)) / far_m
    return Facts(
        distance_m=_number(row, "distance_m"),
        size_px=None if box is None else max(box[2] - box[0], box[3] - box[1]),
        tilt_deg=math.degrees(math.acos(min(cosine, 1.0))),
        fog_per_m=_number(row, "beta_per_m"),
        shadow=_number(row, "shadow"),
        blur_px=_blur_px(row),
    )


def _blur_px(row: _Row) -> float:
    """Return the deviation of all the blurs in `applied`, which reads `name=value name=value`."""
    variance = 0.0
    for name, _, value in (part.partition("=") for part in str(row["applied"] or "").split()):
        if name in _BLUR_VARIANCE:
            # blurs one after the other: their variances add up, each k L^2 of its length
            variance += _BLUR_VARIANCE[name] * _applied(name, value) ** 2
    return math.sqrt(variance)


def _applied(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"applied: {name} '{text}' is not a finite number")
    return value


def _numbers(row: _Row, names: tuple[str, ...]) -> list[float]:
    return [_number(row, name) for name in names]


def _number(row: _Row, name: str) -> float:
    value = row[name]
    if value is None:
        raise InputError(f"{name} is empty")
    return float(value)
