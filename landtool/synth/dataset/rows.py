"""truth.csv: its columns, and what a picture's truth becomes in them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from landtool.geometry import Array
from landtool.io.labels import LabelledBox
from landtool.io.tables import Cell, Columns
from landtool.synth.sample import Truth

TruthRow = Mapping[str, Cell]
_BOX = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
_POSE = tuple(f"camera_T_pad_{name}" for name in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"))
_CORNERS = tuple(f"{axis}{i}_px" for i in range(4) for axis in "xy")
_CAMERA = ("fx_px", "fy_px", "cx_px", "cy_px")
_LENS = ("k1", "k2", "p1", "p2", "k3")
_AIRLIGHT = ("airlight_b", "airlight_g", "airlight_r")


def _floats(*names: str) -> Columns:
    return dict.fromkeys(names, float)


TRUTH_COLUMNS: Columns = {
    "file": str,
    "split": str,
    "present": int,
    **_floats("visible_fraction", *_BOX, *_POSE, *_CORNERS),
    **_floats("height_m", "distance_m", "tilt_rad", "yaw_rad", "size_px", "hidden", "shadow"),
    **_floats("beta_per_m", *_AIRLIGHT, "light"),
    "ground": str,
    "carrier": str,
    "signs": str,
    "applied": str,
    **_floats(*_CAMERA, *_LENS),
}


def truth_row(file: str, split: str, truth: Truth) -> TruthRow:
    """Return the row of a picture, its path relative to the dataset; what there is nothing to say of is None."""
    pose = truth.camera_T_pad
    place = None if pose is None else [*pose.translation, *pose.quaternion_wxyz]
    seen = truth.present  # without a pad, numbers about it would be mistaken for measurements
    camera = truth.camera
    row: dict[str, Cell] = {
        "file": file,
        "split": split,
        "present": int(seen),
        "visible_fraction": float(truth.visible_fraction),
        **_named(_BOX, truth.box_px),
        **_named(_POSE, place),
        **_named(_CORNERS, truth.tag_corners_px),
        **{name: float(getattr(truth, name)) if seen else None for name in ("height_m", "distance_m")},
        "tilt_rad": float(truth.tilt_rad),
        **{name: float(getattr(truth, name)) if seen else None for name in ("yaw_rad", "size_px", "hidden", "shadow")},
        "beta_per_m": float(truth.beta_per_m),
        **_named(_AIRLIGHT, truth.airlight),
        "light": float(truth.light),
        "ground": truth.ground or None,
        "carrier": truth.carrier or None,
        "signs": _words(truth.signs),
        "applied": _words(f"{name}={_short(value)}" for name, value in truth.applied),
        **_named(_CAMERA, (camera.fx, camera.fy, camera.cx, camera.cy)),
        **_named(_LENS, camera.distortion[:5]),
    }
    return row


def boxes_of(row: TruthRow) -> tuple[LabelledBox, ...]:
    """Return the row's box as labels: one of class 0, or none."""
    values = [row[name] for name in _BOX]
    if any(value is None for value in values):
        return ()
    x0, y0, x1, y1 = (float(value) for value in values if value is not None)
    return (LabelledBox(0, x0, y0, x1, y1),)


def _named(names: tuple[str, ...], values: Array | list[float] | tuple[float, ...] | None) -> dict[str, Cell]:
    if values is None:
        return dict.fromkeys(names)
    flat = [float(v) for part in values for v in (part if hasattr(part, "__iter__") else (part,))]
    return dict(zip(names, flat, strict=True))


def _words(words: Iterable[str]) -> str | None:
    """Return words with a space between; a space inside of one becomes a hyphen."""
    return " ".join("-".join(word.split()) for word in words) or None


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
