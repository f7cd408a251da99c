"""Made-up clips whose truth and errors are known by construction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from landtool.camera import Camera
from landtool.evaluate.clip_truth import ClipTruth, TrueFrame
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.types import FrameResult, PadPose, PoseMethod, Prediction, Track, TrackState

CAMERA = Camera(640, 480, 400.0, 400.0, 319.5, 239.5)
PAD = PadSpec()
FPS = 20
STEP_NS = 1_000_000_000 // FPS
SPEED_MPS = 2.0


def truth_of(frames: int, *, speed_mps: float = SPEED_MPS, height_m: float = 4.0, **changes: Any) -> ClipTruth:
    """A platform that drives along x of the world, below a drone that stands over the origin, tilted by nothing."""
    return ClipTruth(Path("clip.truth.csv"), tuple(
        true_frame(i, speed_mps * i / FPS, height_m, velocity_mps=np.array([speed_mps, 0.0, 0.0]), **changes)
        for i in range(frames)
    ))  # fmt: skip


def true_frame(index: int, x_m: float = 0.0, height_m: float = 4.0, **changes: Any) -> TrueFrame:
    world_T_pad = Pose(np.eye(3), np.array([x_m, 0.0, 0.0]))
    world_T_body = Pose(np.eye(3), np.array([0.0, 0.0, height_m]))
    camera_T_pad = (world_T_body @ STRAIGHT_DOWN).inverse() @ world_T_pad
    known: dict[str, Any] = {"visible_fraction": 1.0, "hidden": 0.0, "beta_per_m": 0.0, **changes}
    return TrueFrame(index, known.pop("t_ns", index * STEP_NS), camera_T_pad, world_T_pad, world_T_body, **known)


def measured(
    true: Pose, *, off_m: tuple[float, float, float] = (0.0, 0.0, 0.0), turn: Any = (0.0, 0.0, 0.0), **changes: Any
) -> PadPose:
    """A pose off by that, in the camera frame."""
    method: PoseMethod = changes.pop("method", "tag")
    covariance = changes.pop("covariance", np.diag([1e-4] * 3 + [1e-3] * 3))
    found = Pose(rotation_from_rotvec(turn) @ true.rotation, true.translation + np.array(off_m))
    return PadPose(found, covariance, method, 0.0, 0.1)


def tracked(
    place_m: Any, velocity_mps: Any = (0.0, 0.0), *, track_id: int = 1, status: TrackState = "confirmed", **changes: Any
) -> Track:
    """A track in the world, that goes on as it goes."""
    state = np.array([*place_m, *velocity_mps], np.float64)
    covariance: Array = changes.pop("covariance", np.eye(4) * 0.01)
    ahead = tuple(
        Prediction(h, state[:2] + h * state[2:], np.eye(2) * 0.01) for h in changes.pop("horizons_s", (0.5,))
    )  # fmt: skip
    return Track(track_id, status, "world", state, covariance, changes.pop("nis", None), 0.5, state[:2], ahead)


def result(index: int, **changes: Any) -> FrameResult:
    return FrameResult(index, changes.pop("t_ns", index * STEP_NS), stage=changes.pop("stage", "near"), **changes)
