"""What a data set's truth.csv says of its pictures, as arrays over all of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PilImage

from landtool.camera import Camera
from landtool.errors import InputError
from landtool.geometry import Array
from landtool.io.labels import picture_size
from landtool.io.tables import Columns, ReadTable, read_table

TRUTH = "truth.csv"
AGAIN = "generate the data set again"
_BOX = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
_CORNERS = tuple(f"{axis}{i}_px" for i in range(4) for axis in "xy")
_CAMERA = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
_PAD = ("camera_T_pad_x_m", "camera_T_pad_y_m", "camera_T_pad_z_m")
_NUMBERS = ("size_px", "visible_fraction", "height_m", "tilt_rad", "yaw_rad", "beta_per_m", "light", "shadow")
# deviation of a Gaussian of sigma 1, a disc of radius 1 and a line of length 1
_BLUR_SIGMA = {"psf_sigma_px": 1.0, "defocus_radius_px": 0.5, "motion_px": 12.0**-0.5}
_COLUMNS: Columns = {
    "file": str,
    "present": int,
    "ground": str,
    "carrier": str,
    "signs": str,
    "applied": str,
} | dict.fromkeys((*_NUMBERS, *_BOX, *_CORNERS, *_CAMERA, *_PAD), float)


@dataclass(frozen=True, eq=False)
class Facts:
    """N pictures of width x height; what is said of a pad is NaN or empty where none is in the picture.

    files: relative to the data set. present: (N,) bool. numbers: columns of truth.csv (N,) by name. blur_px: (N,)
    deviation of everything that blurs. box_px: (N, 4) x_min, y_min, x_max, y_max; centre_px: (N, 2) of the pad, in
    the picture or not; tag_corners_px: (N, 4, 2). ground,
    carrier: names; signs: of each picture.
    """

    width: int
    height: int
    files: tuple[str, ...]
    present: NDArray[np.bool_]
    numbers: dict[str, Array]
    blur_px: Array
    box_px: Array
    centre_px: Array
    tag_corners_px: Array
    ground: tuple[str, ...]
    carrier: tuple[str, ...]
    signs: tuple[tuple[str, ...], ...]

    def __len__(self) -> int:
        return len(self.files)

    def shares(self, points_px: Array) -> Array:
        """Return points (N, 2) as shares of the picture's width and height."""
        shares: Array = (points_px + 0.5) / (self.width, self.height)
        return shares


def read_facts(dataset: Path) -> Facts:
    """Read the truth of a data set.

    Raises UsageError when there is no truth.csv, InputError when it is no such table or empty.
    """
    path = dataset / TRUTH
    table = read_table(path, _COLUMNS)
    if not len(table):
        raise InputError("names no picture", file=path, hint=AGAIN)
    present = np.array([bool(v) for v in table.ints("present")])
    numbers = {name: table.floats(name) for name in _NUMBERS}
    for name in ("size_px", "visible_fraction", "yaw_rad", "shadow"):
        numbers[name] = np.where(present, numbers[name], np.nan)
    box = np.column_stack([table.floats(name) for name in _BOX])
    corners = np.column_stack([table.floats(name) for name in _CORNERS]).reshape(-1, 4, 2)
    width, height = picture_size(dataset / table.texts("file")[0])  # all have one size
    return Facts(
        width=width,
        height=height,
        files=tuple(table.texts("file")),
        present=present,
        numbers=numbers,
        blur_px=_blur(table),
        box_px=np.where(present[:, None], box, np.nan),
        centre_px=np.where(present[:, None], _centres(table, width, height), np.nan),
        tag_corners_px=np.where(present[:, None, None], corners, np.nan),
        ground=tuple(table.texts("ground")),
        carrier=tuple(table.texts("carrier")),
        signs=tuple(tuple(text.split()) for text in table.texts("signs")),
    )


def _centres(table: ReadTable, width: int, height: int) -> Array:
    """Return the pixels (N, 2) of the pads' centres."""
    lenses = np.column_stack([table.floats(name) for name in _CAMERA])
    places = np.column_stack([table.floats(name) for name in _PAD])
    cameras = [Camera(width, height, fx, fy, cx, cy, distortion=tuple(k)) for fx, fy, cx, cy, *k in lenses.tolist()]
    return np.concatenate([camera.project(place) for camera, place in zip(cameras, places, strict=True)])


def measure_brightness(dataset: Path, facts: Facts) -> Array:
    """Return the mean grey level (N,) of every picture. Raises InputError for one that cannot be decoded."""
    return np.array([_brightness(dataset / file) for file in facts.files])


def _brightness(path: Path) -> float:
    try:
        with PilImage.open(path) as stored:
            width, height = stored.size
            stored.draft("L", (width // 8, height // 8))  # a JPEG's mean needs its coarsest coefficients only
            return float(np.asarray(stored.convert("L")).mean())
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"cannot be decoded ({error})", file=path, hint=AGAIN) from error


def _blur(table: ReadTable) -> Array:
    """Return the deviation (N,) in pixels of all the blurs in `applied`, which reads `name=value name=value`."""
    total = np.zeros(len(table))
    for i, text in enumerate(table.texts("applied")):
        for name, _, value in (part.partition("=") for part in text.split()):
            if name in _BLUR_SIGMA:
                total[i] += (_BLUR_SIGMA[name] * float(value)) ** 2
    return np.sqrt(total)
