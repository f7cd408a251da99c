"""Small data to evaluate with: the rendered landing with its truth, and some of its pictures with labels."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.io.calibration import write_camera
from landtool.io.labels import LabelledBox, yolo_rows
from landtool.pad import PadSpec
from tests.cli.landing import APPROACH, CAMERA, TIMES_NS, Landing

PLACE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
BOX = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
BOXES, POSES, FOG = ("box",), ("camera_T_pad", "world_T_pad", "world_T_body"), ("beta_per_m",)
CLOCK = ("frame", "t_ns")
COUNT = len(TIMES_NS)


def box_px(camera_T_pad: Pose, camera: Camera = CAMERA) -> Array:
    """Return the edges (4,) of the pad's ring in the picture."""
    angle = np.linspace(0.0, 2.0 * np.pi, 64)
    rim = 0.5 * PadSpec().diameter_m * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(64)])
    seen = camera.project(rim @ camera_T_pad.rotation.T + camera_T_pad.translation)
    return np.concatenate([seen.min(axis=0), seen.max(axis=0)])


def write_truth(
    path: Path, groups: Sequence[str] = (*CLOCK, *POSES, *BOXES, *FOG), frames: Sequence[int] = range(COUNT)
) -> Path:
    """Write the landing's truth: some groups of columns, of some frames; beyond the last one it goes on."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(name for group in groups for name in _names(group))
        for frame in frames:
            rows.writerow(cell for group in groups for cell in _cells(group, frame))
    return path


def _names(group: str) -> tuple[str, ...]:
    if group in POSES:
        return tuple(f"{group}_{name}" for name in PLACE)
    return BOX if group == "box" else (group,)


def _cells(group: str, frame: int) -> Iterator[float]:
    t_ns = TIMES_NS[frame] if frame < COUNT else TIMES_NS[-1] + (frame - COUNT + 1) * 33_000_000
    world_T_body, world_T_pad = APPROACH.pose_at(t_ns * 1e-9)
    camera_T_pad = APPROACH.camera_T_pad(t_ns * 1e-9)
    poses = {"camera_T_pad": camera_T_pad, "world_T_pad": world_T_pad, "world_T_body": world_T_body}
    if group in poses:
        yield from (*poses[group].translation, *poses[group].quaternion_wxyz)
    elif group == "box":
        yield from box_px(camera_T_pad)
    else:
        yield {"frame": frame, "t_ns": t_ns, "beta_per_m": 0.0}[group]


def add_clip(landing: Landing, folder: Path, name: str = "a") -> Path:
    """Write the recording with its truth and calibration beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.mp4").write_bytes((landing.folder / "clip.mp4").read_bytes())
    write_camera(CAMERA, folder / f"{name}.camera.yaml")
    write_truth(folder / f"{name}.truth.csv")
    return folder / f"{name}.mp4"


def add_stills(landing: Landing, folder: Path, frames: Sequence[int] = (0, 13), name: str = "pad") -> Path:
    """Write pictures of the landing with a box each, as a YOLO dataset of one class."""
    for part in ("images", "labels"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    for frame in frames:
        assert cv2.imwrite(str(folder / f"images/{frame}.png"), landing.pictures[frame])
        box = LabelledBox(0, *map(float, box_px(APPROACH.camera_T_pad(TIMES_NS[frame] * 1e-9))))
        (folder / f"labels/{frame}.txt").write_text(yolo_rows([box], CAMERA.width, CAMERA.height))
    (folder / "data.yaml").write_text(f"test: images\nnames: [{name}]\n")
    return folder
