"""Errors of poses against the truth, of clips and of single pictures: a row a picture, found or not."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from landtool.camera import Camera
from landtool.evaluate.clip_truth import ClipTruth, tilt_deg
from landtool.evaluate.pose_difference import (
    PoseDifference,
    half_turned,
    mirrored,
    place_nees,
    pose_difference,
    rotation_nees,
    turn_told,
)
from landtool.evaluate.true_pad import TruePad
from landtool.geometry import Pose
from landtool.io.tables import Columns, Row
from landtool.pad import PadSpec
from landtool.types import FrameResult, PadPose, PoseMethod, Stage

POSE_ERROR_COLUMNS: Columns = {
    "model": str,
    "clip": str,
    "frame": int,
    "t_ns": int,
    "method": str,
    "stage": str,
    **dict.fromkeys(("distance_m", "tilt_deg", "size_px", "fog_per_m", "visible"), float),
    **dict.fromkeys(("place_m", "along_m", "across_m", "normal_deg", "rotation_deg"), float),
    "flipped": int,
    "nees_place": float,
    "nees_rotation": float,
}
"""The columns of pose_errors.csv."""


@dataclass(frozen=True)
class PoseError:
    """What became of the pad's pose in one picture; None where there is none, or where the method does not tell it.

    clip: the clip's name, of a still its path. size_px: diameter the pad would have if it faced the camera where it
    is. visible: share of the pad that is seen. measurable: a pose of six degrees of freedom is to be expected.
    confirmed: a track was, None where nothing is tracked. place_m: of the place, altogether, along and across the line
    of sight. flipped: mirrored, or half a turn off without saying so; half_turn_told: that, but its covariance
    says. nees_place, nees_rotation: normalised errors squared, 3 degrees of freedom each.
    """

    clip: str
    frame: int
    t_ns: int | None
    method: PoseMethod | None
    stage: Stage | None
    distance_m: float
    tilt_deg: float
    size_px: float
    fog_per_m: float | None
    visible: float | None
    measurable: bool
    confirmed: bool | None = None
    place_m: float | None = None
    along_m: float | None = None
    across_m: float | None = None
    normal_deg: float | None = None
    rotation_deg: float | None = None
    mirrored: bool | None = None
    half_turn: bool | None = None
    half_turn_told: bool | None = None
    nees_place: float | None = None
    nees_rotation: float | None = None

    @property
    def flipped(self) -> bool | None:
        """Whether it is one of the pose's look-alikes, and claims not to be."""
        return None if self.mirrored is None else self.mirrored or bool(self.half_turn)

    @property
    def whole(self) -> bool:
        """Whether there is a pose of six degrees of freedom."""
        return self.method in ("tag", "target")

    @property
    def unit(self) -> Hashable:
        """What it is resampled with: the same second of a clip."""
        return unit(self.clip, self.frame, self.t_ns)


def unit(clip: str, frame: int, t_ns: int | None) -> Hashable:
    """Return what a frame is resampled with: the same second of its clip, the frame itself without a clock."""
    return (clip, "frame", frame) if t_ns is None else (clip, "second", t_ns // 1_000_000_000)


def pose_errors(
    clip: str, results: Sequence[FrameResult], truth: ClipTruth, camera: Camera, pad: PadSpec
) -> list[PoseError]:
    """Return a row for every frame of a clip with a true pose in which the pad is seen, or was said to be."""
    rows = []
    for result in results:
        frame = truth.at(result.index, result.t_ns)
        true = None if frame is None else frame.pad(camera)
        if true is not None and (true.visible or result.pose is not None):
            confirmed = any(track.status == "confirmed" for track in result.tracks)
            rows.append(pose_error(clip, result, true, pad, confirmed=confirmed))
    return rows


def still_pose_errors(pictures: Iterable[tuple[str, FrameResult, TruePad]], pad: PadSpec) -> list[PoseError]:
    """Return a row for every single picture (its path, what was found, what is true) in which the pad is seen."""
    return [
        pose_error(path, result, true, pad)
        for path, result, true in pictures
        if true.visible or result.pose is not None
    ]


def pose_error(
    clip: str, result: FrameResult, true: TruePad, pad: PadSpec, *, confirmed: bool | None = None
) -> PoseError:
    """Return how far the pose of one picture is from the true one."""
    pose, camera_T_pad = result.pose, true.camera_T_pad
    row = PoseError(
        *(clip, result.index, result.t_ns, None if pose is None else pose.method, result.stage),
        distance_m=float(np.linalg.norm(camera_T_pad.translation)),
        tilt_deg=tilt_deg(camera_T_pad),
        size_px=true.size_px(pad),
        fog_per_m=true.facts.fog_per_m,
        visible=true.visible_fraction,
        measurable=true.measurable(pad),
        confirmed=confirmed,
    )
    if pose is None:
        return row
    off = pose_difference(pose.camera_T_pad, camera_T_pad)
    placed = replace(
        row,
        place_m=off.place_m,
        along_m=off.along_m,
        across_m=off.across_m,
        nees_place=place_nees(pose, camera_T_pad),
    )
    # a box does not say how the pad is turned
    return placed if pose.method == "box" else _turned(placed, pose, camera_T_pad, off)


def _turned(row: PoseError, pose: PadPose, true: Pose, off: PoseDifference) -> PoseError:
    half, told = half_turned(pose.camera_T_pad, true), turn_told(pose)
    return replace(
        row,
        normal_deg=off.normal_deg,
        rotation_deg=off.rotation_deg,
        mirrored=mirrored(pose.camera_T_pad, true),
        half_turn=half and not told,
        half_turn_told=half and told,
        nees_rotation=rotation_nees(pose, true),
    )


def pose_error_row(model: str, error: PoseError) -> Row:
    """Return a row of pose_errors.csv."""
    e = error
    return (
        *(model, e.clip, e.frame, e.t_ns, e.method, e.stage),
        *(e.distance_m, e.tilt_deg, e.size_px, e.fog_per_m, e.visible),
        *(e.place_m, e.along_m, e.across_m, e.normal_deg, e.rotation_deg),
        *(None if e.flipped is None else int(e.flipped), e.nees_place, e.nees_rotation),
    )
