"""Made-up landings: results of frames whose truth is known by construction."""

from __future__ import annotations

from typing import Any

import numpy as np

from landtool.geometry import Pose
from landtool.types import FrameResult, PadPose, Prediction, Reference, Track, TrackState

FPS = 20
STEP_NS = 1_000_000_000 // FPS
HORIZON_S = 0.5


def result(index: int, **changes: Any) -> FrameResult:
    """Frame `index` of 20 a second, near, nothing in it."""
    return FrameResult(index, changes.pop("t_ns", index * STEP_NS), stage=changes.pop("stage", "near"), **changes)


def measured(
    index: int,
    height_m: float,
    method: Any = "tag",
    *,
    drone_m: tuple[float, float] | None = (0.0, 0.0),
    pad_m: tuple[float, float] = (0.0, 0.0),
    tilt_rad: float = 0.0,
    **changes: Any,
) -> FrameResult:
    """The pad at `pad_m` in the world, the drone `height_m` over `drone_m`; without it where it is nobody knows.

    tilt_rad: the drone's pitch.
    """
    place = np.array([*(drone_m or (0.0, 0.0)), height_m])
    world_T_body = Pose.from_rotvec(place, [0.0, tilt_rad, 0.0])
    world_T_pad = Pose(np.eye(3), np.array([*pad_m, 0.0]))
    body_T_pad = world_T_body.inverse() @ world_T_pad
    turned = changes.pop("better_fit_rejected", False)
    pose = PadPose(
        Pose(np.eye(3), np.array([0.0, 0.0, height_m])), np.eye(6), method, 0.0, 0.1, better_fit_rejected=turned
    )
    known = None if drone_m is None else world_T_pad
    return result(index, pose=pose, body_T_pad=body_T_pad, world_T_pad=known, **changes)


def track(
    place_m: tuple[float, float] = (0.0, 0.0),
    ahead_m: tuple[float, float] = (0.0, 0.0),
    status: TrackState = "confirmed",
    *,
    reference: Reference = "world",
    nis: float | None = None,
    track_id: int = 1,
    sigma_m: float | None = None,
) -> Track:
    """A track that is at `place_m` and will be at `ahead_m` in half a second."""
    ahead = np.array(ahead_m)
    told = () if sigma_m is None else (Prediction(HORIZON_S, ahead, np.eye(2) * sigma_m**2),)
    state = np.array([*place_m, 0.0, 0.0])
    return Track(track_id, status, reference, state, np.eye(4) * 0.01, nis, HORIZON_S, ahead, told)
