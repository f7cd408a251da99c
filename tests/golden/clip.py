"""A shipped clip tracked as a user would, and its truth as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.config import TrackConfig, configured
from landtool.geometry import Array, Pose
from landtool.io.calibration import read_camera
from landtool.io.poses import read_ego
from landtool.io.tables import ReadTable, read_table
from landtool.pad import PadSpec
from landtool.run.recording import RunOutcome
from landtool.run.tracking import track
from landtool.synth.clips.tables import TRUTH_COLUMNS
from landtool.tracking.ego import EgoTrajectory

FIXTURES = Path(__file__).resolve().parents[2] / "datasets" / "fixtures"
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


@dataclass(frozen=True, eq=False)
class TrackedClip:
    """A clip by its name in datasets/fixtures, and what `landtool track` made of it."""

    name: str
    outcome: RunOutcome

    @cached_property
    def truth(self) -> ReadTable:
        return read_table(FIXTURES / f"{self.name}.truth.csv", TRUTH_COLUMNS)

    @cached_property
    def camera(self) -> Camera:
        return read_camera(FIXTURES / f"{self.name}.camera.yaml")

    @cached_property
    def pad(self) -> PadSpec:
        return PadSpec.read(FIXTURES / f"{self.name}.pad.toml")

    @cached_property
    def ego(self) -> EgoTrajectory:
        """What the drone says of itself."""
        return EgoTrajectory(read_ego(FIXTURES / f"{self.name}.ego.csv"))

    def table(self, name: str) -> ReadTable:
        return read_table(self.outcome.folder / f"{name}.csv")

    def true_poses(self, of: str) -> list[Pose]:
        """The poses of every frame, by the columns' first part, such as `camera_T_pad`."""
        return poses_of(self.truth, f"{of}_")

    def true_corners_px(self) -> Array:
        """The tag's corners (N, 4, 2)."""
        return corners_of(self.truth)

    @cached_property
    def measured_poses(self) -> dict[int, Pose]:
        """`camera_T_pad` by the frame's number."""
        poses = self.table("poses")
        return dict(zip(poses.ints("frame"), poses_of(poses), strict=True))

    def position_errors(self) -> Array:
        """(M,) of the measured poses against the truth, in shares of the distance."""
        truth = self.true_poses("camera_T_pad")
        return np.array([share_off(pose, truth[frame]) for frame, pose in self.measured_poses.items()])

    def poses_of_true_corners(self) -> dict[int, Pose]:
        """The poses the measured frames would have if their corners were read without any error.

        The truth is of one moment; a camera that reads its rows one after another shows each corner at another one.
        """
        corners, points = self.true_corners_px(), self.pad.tag_corners_m(self.pad.tags[0])
        return {frame: _solved(points, corners[frame], self.camera) for frame in self.measured_poses}


def tracked(name: str, folder: Path, **settings: object) -> TrackedClip:
    """Track a clip of the fixtures into a folder; settings replace those for the files beside a video."""
    files = {"camera": FIXTURES / f"{name}.camera.yaml", "pad": FIXTURES / f"{name}.pad.toml"}
    values = {**files, "ego": str(FIXTURES / f"{name}.ego.csv"), "save": ("csv",), **settings}
    suffix = "mp4" if values.get("camera") else "mcap"
    config = configured(TrackConfig(), {key: value for key, value in values.items() if value is not None})
    return TrackedClip(name, track(FIXTURES / f"{name}.{suffix}", folder / name, config))


def poses_of(table: ReadTable, prefix: str = "") -> list[Pose]:
    return [Pose.from_quaternion(row[:3], row[3:]) for row in columns(table, [prefix + name for name in POSE])]


def corners_of(table: ReadTable) -> Array:
    return columns(table, [f"{axis}{i}_px" for i in range(4) for axis in "xy"]).reshape(-1, 4, 2)


def columns(table: ReadTable, names: list[str]) -> Array:
    return np.column_stack([table.floats(name) for name in names])


def share_off(pose: Pose, truth: Pose) -> float:
    """How far a place is from the true one, in shares of the true distance."""
    return float(np.linalg.norm(pose.translation - truth.translation) / np.linalg.norm(truth.translation))


def _solved(points_m: Array, corners_px: Array, camera: Camera) -> Pose:
    lens = np.array(camera.distortion)
    done, rotvec, place = cv2.solvePnP(points_m, corners_px, camera.matrix, lens, flags=cv2.SOLVEPNP_IPPE)
    assert done
    return Pose.from_rotvec(place.ravel(), rotvec.ravel())
