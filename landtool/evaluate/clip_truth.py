"""What is true of every frame of a clip, as read from its truth.csv; frames are matched by their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from landtool.camera import Camera
from landtool.errors import InputError
from landtool.evaluate.facts import Facts
from landtool.evaluate.true_motion import TrueMotion
from landtool.evaluate.true_pad import TruePad
from landtool.geometry import Array, Pose
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.io.tables import Cell, Columns, column_names, numbered_rows
from landtool.types import Reference

SAME_MOMENT_NS = 1_000_000  # of a truth without numbers: recordings hold their times in milliseconds at the coarsest
LEAST_VISIBLE = 0.2  # of a pad, from which on a box of it is asked for
_PLACE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
_HINT = "docs/generate.md lists the columns of a clip's truth"


def _pose(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{part}" for part in _PLACE)


# what a row may tell: its columns, which are all there or none, and what cannot be told without them
GROUPS: dict[str, tuple[tuple[str, ...], str]] = {
    "frame": (("frame",), "the clock's rate"),
    "t_ns": (("t_ns",), "velocities, lag, predictions and the clock"),
    "camera_T_pad": (_pose("camera_T_pad"), "poses, tags, and tracks in the body's axes"),
    "world_T_pad": (_pose("world_T_pad"), "tracks in the world"),
    "world_T_body": (_pose("world_T_body"), ""),
    "velocity": (("vx_mps", "vy_mps", "vz_mps"), ""),
    "visible_fraction": (("visible_fraction",), ""),
    "hidden": (("hidden",), ""),
    "occluded": (("occluded",), ""),
    "box": (("x_min_px", "y_min_px", "x_max_px", "y_max_px"), "detection"),
    "tag_corners": (tuple(f"{axis}{i}_px" for i in range(4) for axis in "xy"), ""),
    "beta_per_m": (("beta_per_m",), "parts by fog"),
}
_POSES = ("camera_T_pad", "world_T_pad", "world_T_body")
_WHOLE = ("frame", "t_ns", "occluded")


@dataclass(frozen=True, eq=False)
class TrueFrame:
    """What is true of one frame; None is unknown, of a box and tag corners also that there are none.

    index: the frame's number. t_ns: its time by the truth's clock. velocity_mps: (3,) of the platform in the world.
    visible_fraction: share of the pad in the picture and not hidden. hidden: share of the part in the picture that
    something hides; occluded: whether that is more than half. box_px: (4,) edges x_min, y_min, x_max, y_max.
    tag_corners_px: (4, 2) of the pad's first tag, where the picture shows them. beta_per_m: the fog's extinction.
    """

    index: int | None = None
    t_ns: int | None = None
    camera_T_pad: Pose | None = None
    world_T_pad: Pose | None = None
    world_T_body: Pose | None = None
    velocity_mps: Array | None = None
    visible_fraction: float | None = None
    hidden: float | None = None
    occluded: bool | None = None
    box_px: Array | None = None
    tag_corners_px: Array | None = None
    beta_per_m: float | None = None

    @property
    def facts(self) -> Facts:
        """What parts of the data this frame belongs to."""
        box, pose = self.box_px, self.camera_T_pad
        return Facts(
            None if pose is None else float(np.linalg.norm(pose.translation)),
            None if box is None else float(max(box[2] - box[0], box[3] - box[1])),
            None if pose is None else tilt_deg(pose),
            self.beta_per_m,
        )

    def pad(self, camera: Camera) -> TruePad | None:
        """Return the true pad as a camera sees it, None where its pose is unknown."""
        if self.camera_T_pad is None:
            return None
        hidden = self.hidden if self.hidden is not None or self.occluded is None else 1.0 if self.occluded else None
        return TruePad(camera, self.camera_T_pad, self.facts, self.visible_fraction, hidden, self.tag_corners_px)


@dataclass(frozen=True, eq=False)
class ClipTruth:
    """The truth of a clip's N frames in order of their numbers, or of their times where they have none.

    missing: of the groups of columns that are not there, what cannot be told without them, a sentence each. has_boxes:
    a frame without a box is known to show none; else nothing is known of boxes.
    """

    path: Path
    frames: tuple[TrueFrame, ...]
    missing: tuple[str, ...] = ()
    has_boxes: bool = True

    @cached_property
    def numbered(self) -> bool:
        """Whether its frames have numbers; else they are matched by their times."""
        return self.frames[0].index is not None

    @cached_property
    def has_poses(self) -> bool:
        """Whether it tells of a pose anywhere."""
        return any(frame.camera_T_pad is not None or frame.world_T_pad is not None for frame in self.frames)

    @cached_property
    def _rows(self) -> dict[int | None, int]:
        return {frame.index: row for row, frame in enumerate(self.frames)}

    @cached_property
    def _times_ns(self) -> Array:
        return np.array([np.nan if frame.t_ns is None else frame.t_ns for frame in self.frames], np.float64)

    def row(self, index: int, t_ns: int | None = None) -> int | None:
        """Return which of the N rows is about a frame of the recording, None where none is."""
        if self.numbered:
            return self._rows.get(index)
        if t_ns is None:
            return None
        nearest = int(np.argmin(np.abs(self._times_ns - t_ns)))
        return nearest if abs(self._times_ns[nearest] - t_ns) <= SAME_MOMENT_NS else None

    def at(self, index: int, t_ns: int | None = None) -> TrueFrame | None:
        """Return what is true of a frame of the recording, None where nothing is known."""
        row = self.row(index, t_ns)
        return None if row is None else self.frames[row]

    def facts(self, index: int, t_ns: int | None = None) -> Facts:
        """Return the facts of a frame of the recording; those of one without truth are unknown."""
        frame = self.at(index, t_ns)
        return Facts() if frame is None else frame.facts

    def labelled(self, index: int, path: Path, width: int, height: int, t_ns: int | None = None) -> LabelledImage:
        """Return a frame of width x height pixels as a labelled picture of class 0; without a box it is a background.

        A pad of which less than LEAST_VISIBLE is seen counts neither way, as a crowd does.
        Raises KeyError for a frame there is no truth of, and for all of them where nothing is known of boxes.
        """
        frame = self.at(index, t_ns)
        if frame is None or not self.has_boxes:
            raise KeyError(index)
        hardly = frame.visible_fraction is not None and frame.visible_fraction < LEAST_VISIBLE
        if frame.box_px is None:
            return LabelledImage(path, width, height, ())
        x0, y0, x1, y1 = frame.box_px.tolist()
        return LabelledImage(path, width, height, (LabelledBox(0, x0, y0, x1, y1, crowd=hardly),))

    @cached_property
    def start_ns(self) -> int | None:
        """The time of its first frame, None without a clock."""
        return self.frames[0].t_ns

    def motion(self, reference: Reference, body_T_camera: Pose) -> TrueMotion:
        """Return how the pad moves in the plane of a reference frame.

        Velocities in the world are those of the truth where it tells them, else slopes of the places.
        """
        poses = [_in(reference, frame, body_T_camera) for frame in self.frames]
        places = np.array([(np.nan, np.nan) if pose is None else pose.translation[:2] for pose in poses])
        told = [frame.velocity_mps for frame in self.frames] if reference == "world" else []
        velocities = np.array([v[:2] for v in told if v is not None]) if told else np.zeros((0, 2))
        return TrueMotion(self._times_ns, places, velocities if len(velocities) == len(self.frames) else None)


def tilt_deg(camera_T_pad: Pose) -> float:
    """Return the angle between the pad's normal and the line of sight, 0 where the camera is straight above it."""
    ray = camera_T_pad.translation / np.linalg.norm(camera_T_pad.translation)
    return float(np.degrees(np.arccos(np.clip(-ray @ camera_T_pad.rotation[:, 2], -1.0, 1.0))))


def read_clip_truth(path: Path) -> ClipTruth:
    """Read the truth of a clip: `frame` or `t_ns`, and poses or boxes; every other group of GROUPS may be missing.

    Raises UsageError when the file cannot be opened, InputError naming the line that is wrong or twice there.
    """
    try:
        return _read(path)
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint or _HINT) from error


def _read(path: Path) -> ClipTruth:
    groups = _groups(column_names(path))
    columns: Columns = {name: int if group in _WHOLE else float for group in groups for name in GROUPS[group][0]}
    rows = [(line, _frame(line, row, groups)) for line, row in numbered_rows(path, columns)]
    if not rows:
        raise InputError("holds no frames")
    key = "index" if "frame" in groups else "t_ns"
    rows.sort(key=lambda row: getattr(row[1], key))
    _refuse_repeated(rows, key, groups)
    lost = [name for name in GROUPS if name not in groups and GROUPS[name][1]]
    missing = tuple(f"{path.name} has no {name}: {GROUPS[name][1]} cannot be told from it" for name in lost)
    return ClipTruth(path, tuple(frame for _, frame in rows), missing, "box" in groups)


def _groups(names: Sequence[str]) -> tuple[str, ...]:
    """Return the groups of columns that are there."""
    groups = []
    for group, (columns, _) in GROUPS.items():
        there = [name for name in columns if name in names]
        if there and len(there) < len(columns):
            lost = ", ".join(name for name in columns if name not in names)
            raise InputError(f"line 1: there is {there[0]}, but not {lost}")
        groups += [group] if there else []
    if not {"frame", "t_ns"} & set(groups):
        raise InputError("line 1: neither a column frame nor t_ns says which frames the rows are about")
    if not {"camera_T_pad", "world_T_pad", "box"} & set(groups):
        raise InputError("line 1: there are neither poses of the pad nor boxes")
    return tuple(groups)


def _frame(line: int, row: dict[str, Cell], groups: Sequence[str]) -> TrueFrame:
    told: dict[str, Array] = {}
    for group in groups:
        columns = GROUPS[group][0]
        cells = [row[name] for name in columns]
        if all(cell is not None for cell in cells):
            told[group] = np.array([float(cell) for cell in cells if cell is not None])
        elif any(cell is not None for cell in cells):
            raise InputError(f"line {line}: {columns[cells.index(None)]} is empty, but not all of {group}")
    index, t_ns = row.get("frame"), row.get("t_ns")
    for name, value in (("frame", index), ("t_ns", t_ns)):
        if name in groups and value is None:
            raise InputError(f"line {line}: {name} is empty")
    if isinstance(index, int) and index < 0:
        raise InputError(f"line {line}: frame {index} is negative", hint="frames count from 0")
    poses = {name: _checked_pose(line, name, told.get(name)) for name in _POSES}
    corners = told.get("tag_corners")
    return TrueFrame(
        None if index is None else int(index),
        None if t_ns is None else int(t_ns),
        poses["camera_T_pad"],
        poses["world_T_pad"],
        poses["world_T_body"],
        told.get("velocity"),
        _share(line, "visible_fraction", told),
        _share(line, "hidden", told),
        bool(told["occluded"][0]) if "occluded" in told else None,
        _box(line, told.get("box")),
        None if corners is None else corners.reshape(4, 2),
        float(told["beta_per_m"][0]) if "beta_per_m" in told else None,
    )


def _checked_pose(line: int, name: str, values: Array | None) -> Pose | None:
    if values is None:
        return None
    if abs(float(np.linalg.norm(values[3:])) - 1.0) > 0.01:
        raise InputError(f"line {line}: the quaternion of {name} is not of length 1", hint="w comes first")
    if name == "camera_T_pad" and not values[:3].any():
        raise InputError(f"line {line}: the pad's centre is in the camera itself")
    return Pose.from_quaternion(values[:3], values[3:])


def _share(line: int, name: str, told: dict[str, Array]) -> float | None:
    if name not in told:
        return None
    value = float(told[name][0])
    if not 0.0 <= value <= 1.0 + 1e-9:
        raise InputError(f"line {line}: {name} = {value:g} is no share", hint="it is 0 to 1")
    return value


def _box(line: int, box: Array | None) -> Array | None:
    if box is not None and not (box[2:] >= box[:2]).all():
        raise InputError(f"line {line}: the box ends before it begins")
    return box


def _refuse_repeated(rows: Sequence[tuple[int, TrueFrame]], key: str, groups: Sequence[str]) -> None:
    for (_, before), (line, frame) in pairwise(rows):
        if getattr(frame, key) == getattr(before, key):
            name = "frame" if key == "index" else key
            raise InputError(f"line {line}: {name} {getattr(frame, key)} is there twice", hint="keep one line of them")
        if "t_ns" in groups and not (frame.t_ns or 0) > (before.t_ns or 0):
            raise InputError(f"line {line}: the time is not after that of the frame before")


def _in(reference: Reference, frame: TrueFrame, body_T_camera: Pose) -> Pose | None:
    if reference == "world":
        return frame.world_T_pad
    return None if frame.camera_T_pad is None else body_T_camera @ frame.camera_T_pad
