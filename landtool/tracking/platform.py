"""The platform's track: pad poses in, tracks out, in the body frame or, with the drone's own pose, in the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose
from landtool.tracking.config import TrackerConfig
from landtool.tracking.ego import EgoTrajectory
from landtool.tracking.kalman import KalmanState
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.reference import EgoNoise, to_reference
from landtool.tracking.smooth import RecordedStep, smooth
from landtool.tracking.tracker import Tracker
from landtool.types import PadPose, Track

_UNKNOWN = "the drone's own pose is not known at this time"


@dataclass(frozen=True, eq=False)
class Stepped:
    """What a frame did. said: what a log should hold. taken: the number of the track each pose went to, or None."""

    tracks: tuple[Track, ...]
    said: str
    taken: tuple[int | None, ...] = ()


@dataclass(frozen=True, eq=False)
class ExpectedPad:
    """Where a tracked pad should be in the camera. sigma_m: of its place across the reference plane, one direction.

    age_s: since it was measured last. Its rotation is the last one measured by a tag or the whole target; of a pad
    known by boxes only, that of its last box.
    """

    track_id: int
    confirmed: bool
    camera_T_pad: Pose
    sigma_m: float
    age_s: float


class PlatformTracker:
    """Follows pads through time.

    body_T_camera: the camera's mount. ego: the drone's own motion; with it the reference is the world.
    record: keep what `smoothed` needs, a few hundred bytes a call of `step`.
    """

    def __init__(
        self, config: TrackerConfig, body_T_camera: Pose, ego: EgoTrajectory | None = None, *, record: bool = False
    ) -> None:
        self._since_ns = ego.span_ns[0] if ego else None
        self._tracker = Tracker(config, "world" if ego else "body", self._since_ns)
        self._body_T_camera, self._ego = body_T_camera, ego
        self._ego_noise = EgoNoise(config.ego_position_sigma_m, math.radians(config.ego_attitude_sigma_deg))
        self._delay_ns = round(config.camera_delay_s * 1e9)
        self._rotations: dict[int, tuple[bool, Array]] = {}
        self._told_span = False
        self._recorded: list[RecordedStep] | None = [] if record else None

    def world_T_body(self, t_ns: int | None) -> Pose | None:
        """Return the drone's pose when the picture stamped `t_ns` was exposed, None where it is not known."""
        return self._ego.at(t_ns - self._delay_ns) if self._ego is not None and t_ns is not None else None

    def camera_T_reference(self, t_ns: int | None) -> Pose | None:
        """Return the pose of the tracks' reference frame in the camera, None where it is not known."""
        if self._ego is None:
            return self._body_T_camera.inverse()
        world_T_body = self.world_T_body(t_ns)
        return None if world_T_body is None else (world_T_body @ self._body_T_camera).inverse()

    def placed(self, t_ns: int | None, pose: PadPose | None) -> tuple[Pose | None, Pose | None]:
        """Return (body_T_pad, world_T_pad) of a measured pose, None for what is not known."""
        if pose is None:
            return None, None
        body_T_pad = self._body_T_camera @ pose.camera_T_pad
        world_T_body = self.world_T_body(t_ns)
        return body_T_pad, None if world_T_body is None else world_T_body @ body_T_pad

    def step(self, t_ns: int | None, poses: Sequence[PadPose]) -> Stepped:
        """Advance to a frame's time with the pads that were measured in it; the tracks are as of that time."""
        if t_ns is None:
            self._kept(None, (), ())
            return Stepped((), "no clock, so no track" if poses else "", (None,) * len(poses))
        measurements, said = self._measured(t_ns, poses)
        exposed_ns = t_ns - self._delay_ns
        tracks = self._tracker.step(exposed_ns, measurements, self._tracker.config.camera_delay_s)
        taken = self._tracker.taken
        self._kept(exposed_ns, measurements, tracks)
        self._turn(t_ns, poses, taken)
        said = "; ".join(filter(None, [said, self._tracker.note]))
        return Stepped(tracks, said, taken or (None,) * len(poses))

    def expected(self, t_ns: int | None) -> tuple[ExpectedPad, ...]:
        """Return where each tracked pad should be in the picture stamped `t_ns`, oldest track first.

        None of them without a clock, or when the drone's own pose is not known then.
        """
        camera_T_reference = self.camera_T_reference(t_ns)
        if t_ns is None or camera_T_reference is None:
            return ()
        exposed_ns = t_ns - self._delay_ns
        pads = []
        for pad in self._tracker.expected(exposed_ns):
            if pad.track_id not in self._rotations:
                continue
            reference_T_pad = Pose(self._rotations[pad.track_id][1], np.array([*pad.xy_m, pad.z_m]))
            sigma_m = math.sqrt(0.5 * float(np.trace(pad.covariance)))
            age_s = (exposed_ns - pad.hit_ns) * 1e-9
            pads.append(ExpectedPad(pad.track_id, pad.confirmed, camera_T_reference @ reference_T_pad, sigma_m, age_s))
        return tuple(pads)

    def smoothed(self) -> dict[tuple[int, int], KalmanState]:
        """Return the states of all rows as the whole run says, by (the call of `step`, from 0; the track's number).

        Raises RuntimeError when nothing was recorded.
        """
        if self._recorded is None:
            raise RuntimeError("the tracker recorded nothing to be smoothed")
        return smooth(self._recorded, self._tracker.motion, since_ns=self._since_ns, lead_ns=self._delay_ns)

    def _measured(self, t_ns: int, poses: Sequence[PadPose]) -> tuple[list[PlanarMeasurement], str]:
        """Return the poses as places in the reference frame, and why there are none."""
        if self._ego is None:
            return [to_reference(pose, self._body_T_camera) for pose in poses], ""
        world_T_body = self.world_T_body(t_ns)
        if world_T_body is None:
            return [], self._unknown(t_ns) if poses else ""
        share = self._ego.noise_share(t_ns - self._delay_ns)
        mount, noise = self._body_T_camera, self._ego_noise
        return [to_reference(pose, mount, world_T_body, noise, share) for pose in poses], ""

    def _unknown(self, t_ns: int) -> str:
        """Say that the drone's pose is not known; the first time outside of all its poses also from when to when."""
        assert self._ego is not None
        first_ns, last_ns = self._ego.span_ns
        if self._told_span or first_ns <= t_ns - self._delay_ns <= last_ns:
            return _UNKNOWN
        self._told_span = True
        spoken = f"they are from {first_ns * 1e-9:.3f} to {last_ns * 1e-9:.3f} s, the frame is at {t_ns * 1e-9:.3f} s"
        return f"{_UNKNOWN}: {spoken}"

    def _turn(self, t_ns: int, poses: Sequence[PadPose], taken: Sequence[int]) -> None:
        """Remember how the pads are turned in the reference frame; a box does not say."""
        camera_T_reference = self.camera_T_reference(t_ns)
        if camera_T_reference is None:
            return
        for pose, track_id in zip(poses, taken, strict=False):
            told = pose.method != "box"
            if told or not self._rotations.get(track_id, (False,))[0]:
                self._rotations[track_id] = told, camera_T_reference.rotation.T @ pose.camera_T_pad.rotation
        living = self._tracker.living
        self._rotations = {track_id: turn for track_id, turn in self._rotations.items() if track_id in living}

    def _kept(self, exposed_ns: int | None, measurements: Sequence[PlanarMeasurement], tracks: Sequence[Track]) -> None:
        if self._recorded is not None:
            taken = self._tracker.taken if exposed_ns is not None else ()
            living = tuple(track.track_id for track in tracks)
            self._recorded.append(RecordedStep(exposed_ns, tuple(measurements), taken, living))
