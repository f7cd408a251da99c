"""The tables beside a clip: the truth of every frame, and the drone's own odometry."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from landtool.geometry import Array, Pose
from landtool.io.poses import CSV_COLUMNS
from landtool.io.tables import Cell, Columns, format_cell
from landtool.synth.clips.take import FrameTruth, Take

_POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
_PAIRS = ("camera_T_pad", "world_T_pad", "world_T_body", "world_T_camera")

TRUTH_COLUMNS: Columns = {
    "frame": int,
    "t_ns": int,
    **{f"{pair}_{name}": float for pair in _PAIRS for name in _POSE},
    **dict.fromkeys(("vx_mps", "vy_mps", "vz_mps", "visible_fraction", "hidden"), float),
    "occluded": int,
    **dict.fromkeys(("x_min_px", "y_min_px", "x_max_px", "y_max_px"), float),
    **{f"{axis}{i}_px": float for i in range(4) for axis in "xy"},
    "beta_per_m": float,
}


def truth_text(truths: Iterable[FrameTruth], beta_per_m: float) -> str:
    """Return the truth of all frames as CSV."""
    return _csv(tuple(TRUTH_COLUMNS), (_truth_row(truth, beta_per_m) for truth in truths))


def ego_text(take: Take) -> str:
    """Return the drone's own odometry as CSV, from before the first picture to after the last."""
    return _csv(CSV_COLUMNS, _ego_rows(take))


def _ego_rows(take: Take) -> Iterator[list[Cell]]:
    for t_ns in take.errors.t_ns.tolist():
        yield [int(t_ns), *_cells(take.odometry(int(t_ns)).world_T_body)]


def _truth_row(truth: FrameTruth, beta_per_m: float) -> list[Cell]:
    return [
        truth.index,
        truth.t_ns,
        *(cell for pair in _PAIRS for cell in _cells(getattr(truth, pair))),
        *(float(v) for v in truth.pad_velocity_mps),
        float(truth.visible_fraction),
        float(truth.hidden),
        int(truth.occluded),
        *_pixels(truth.box_px, 4),
        *_pixels(truth.tag_corners_px, 8),
        beta_per_m,
    ]


def _cells(pose: Pose) -> list[Cell]:
    return [float(v) for v in (*pose.translation, *pose.quaternion_wxyz)]


def _pixels(values: Array | None, count: int) -> list[Cell]:
    return [None] * count if values is None else [float(v) for v in values.ravel()]


def _csv(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    lines = [",".join(columns), *(",".join(map(format_cell, row)) for row in rows)]
    return "\n".join(lines) + "\n"
