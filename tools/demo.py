"""Track the shipped landing and say what came out, against the clip's exact truth. Run: `make demo`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from landtool.geometry import Array, Pose
from landtool.io.poses import read_ego
from landtool.io.tables import ReadTable, read_table
from landtool.synth.clips.tables import TRUTH_COLUMNS
from landtool.tracking.ego import EgoTrajectory

ROOT = Path(__file__).parent.parent
CLIP = ROOT / "datasets" / "fixtures" / "approach.mp4"
OUTPUT = ROOT / "runs" / "demo"
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
AHEAD = 15  # frames: half a second at 30 a second


def main() -> int:
    """Run `landtool track` as a user would, then compare its tables with the truth."""
    command = [
        *(str(Path(sys.executable).parent / "landtool"), "track", str(CLIP.relative_to(ROOT))),
        *("--camera", str(CLIP.with_suffix(".camera.yaml").relative_to(ROOT))),
        *("--ego", str(CLIP.with_suffix(".ego.csv").relative_to(ROOT))),
        *("-o", str(OUTPUT.relative_to(ROOT)), "--overwrite"),
    ]
    print("$ landtool " + " ".join(command[1:]), flush=True)
    code = subprocess.run(command, cwd=ROOT, check=False).returncode
    if code:
        return code
    folder = OUTPUT / CLIP.stem
    print("against the truth of the clip, which was generated:")
    for line in compared(folder, CLIP.with_suffix(".truth.csv")):
        print(f"  {line}")
    print(f"watch {(folder / 'annotated.mp4').relative_to(ROOT)}; the tables lie beside it")
    return 0


def compared(folder: Path, truth_file: Path) -> list[str]:
    """Return the errors of a run's poses and tracks against the clip's truth, as text."""
    truth = read_table(truth_file, TRUTH_COLUMNS)
    world_T_body, world_T_pad = _poses(truth, "world_T_body_"), _poses(truth, "world_T_pad_")
    body_T_pad = [body.inverse() @ pad for body, pad in zip(world_T_body, world_T_pad, strict=True)]
    poses = read_table(folder / "poses.csv")
    at, true = _frames(poses), _poses(truth, "camera_T_pad_")
    distance = np.linalg.norm(_places(true), axis=1)[at]
    off = np.linalg.norm(_places(_poses(poses)) - _places(true)[at], axis=1)
    turned = [np.degrees(pose.angle_to(true[frame])) for pose, frame in zip(_poses(poses), at, strict=True)]
    in_body = _seen_from_body(folder) - _places(body_T_pad)[at]
    believed = np.array([ego.apply(pad.translation) for ego, pad in zip(_believed(truth), body_T_pad, strict=True)])
    drift = believed - _places(world_T_pad)
    ahead, held = _tracked(folder, _places(world_T_pad)[:, :2])
    return [
        f"the pad in the camera  {1e3 * np.median(off):.1f} mm off, {100 * np.median(off / distance):.3f} % of the "
        f"distance, and {np.median(turned):.2f} degrees (medians of {len(at)})",
        f"seen from the drone    {1e3 * _rms(np.linalg.norm(in_body, axis=1)):.1f} mm off (RMS)",
        f"the track in the world {1e3 * _rms(held):.0f} mm off (RMS); the drone's own odometry, which drifts, is "
        f"{1e3 * _rms(np.linalg.norm(drift[:, :2], axis=1)):.0f} mm off there",
        f"half a second ahead    {1e3 * _rms(ahead):.0f} mm off (RMS)",
    ]


def _believed(truth: ReadTable) -> list[Pose]:
    """Return where the drone's odometry has the drone in every frame."""
    ego = EgoTrajectory(read_ego(CLIP.with_suffix(".ego.csv")))
    return [pose for t_ns in truth.ints("t_ns") if (pose := ego.at(t_ns or 0)) is not None]


def _poses(table: ReadTable, prefix: str = "") -> list[Pose]:
    values = np.column_stack([table.floats(prefix + name) for name in POSE])
    return [Pose.from_quaternion(row[:3], row[3:]) for row in values]


def _places(poses: Sequence[Pose]) -> Array:
    return np.array([pose.translation for pose in poses])


def _frames(table: ReadTable) -> list[int]:
    return [frame or 0 for frame in table.ints("frame")]


def _seen_from_body(folder: Path) -> Array:
    """Return the pad's places (N, 3) in the body frame."""
    table = read_table(folder / "platform.csv")
    return _places(_poses(table))[[name == "body" for name in table.texts("reference")]]


def _tracked(folder: Path, true_xy: Array) -> tuple[Array, Array]:
    """Return how far the confirmed track is off (N,), later and now, metres."""
    tracks = read_table(folder / "tracks.csv")
    held = np.array([state == "confirmed" for state in tracks.texts("state")])
    frames = np.array(_frames(tracks))
    known = held & (frames + AHEAD < len(true_xy))
    now, later = (np.column_stack([tracks.floats(f"{c}{what}_m") for c in "xy"]) for what in ("", "_pred"))
    missed = np.linalg.norm(later[known] - true_xy[frames[known] + AHEAD], axis=1)
    return missed, np.linalg.norm(now[held] - true_xy[frames[held]], axis=1)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    sys.exit(main())
