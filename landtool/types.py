"""The values that travel through the pipeline. Frames of reference are defined in docs/conventions.md.

Pixels follow OpenCV: integer centres, the image spans [-0.5, W - 0.5].
Time is integer nanoseconds on the source's own clock.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array, Pose

Image = NDArray[np.uint8]
Status = Literal["ok", "damaged"]
PoseMethod = Literal["tag", "target", "box"]
TrackState = Literal["tentative", "confirmed", "coasting"]
Reference = Literal["body", "world"]
Stage = Literal["far", "near"]
Search = Literal["frame", "region"]


@dataclass(frozen=True, eq=False)
class Frame:
    """One decoded picture.

    index: 0-based place in the source, lost frames counted. t_ns: the source's own time, None where it has no clock.
    image: (H, W, 3) BGR uint8. file: the image's name in a folder, else empty.
    damage: what is wrong with a picture that was decoded all the same; empty when nothing is.
    """

    index: int
    t_ns: int | None
    image: Image
    file: str = ""
    damage: str = ""

    @property
    def status(self) -> Status:
        """`damaged` when the decoder reported damage."""
        return "damaged" if self.damage else "ok"


@dataclass(frozen=True)
class LostFrame:
    """A frame the source holds but that no picture could be got from; `reason` says why."""

    index: int
    t_ns: int | None
    reason: str
    file: str = ""


@dataclass(frozen=True)
class Detection:
    """A detector's box: edges in pixels (OpenCV convention), score in [0, 1]."""

    label: str
    score: float
    x_min_px: float
    y_min_px: float
    x_max_px: float
    y_max_px: float


@dataclass(frozen=True, eq=False)
class TagObservation:
    """One decoded tag in one image.

    corners_px: (4, 2) float64, OpenCV pixels: the upright tag's top-left, top-right, bottom-right, bottom-left.
    hamming: corrected bits. margin: the decoder's mean distance of a bit from its threshold, grey levels.
    covariance_px2: (8, 8) float64 of x0 y0 x1 y1 ... y3, of the corners' measurement noise.
    """

    family: str
    tag_id: int
    hamming: int
    margin: float
    corners_px: Array
    covariance_px2: Array


@dataclass(frozen=True, eq=False)
class PadPose:
    """The pad in the camera frame, as measured in one image.

    covariance: (6, 6), of a left perturbation (dt, dw) in the camera frame: t + dt in m, exp(dw) R in rad.
    ambiguity: weighted reprojection error of the better of the two solutions over the other's, in [0, 1]; near 1
    nothing in this image tells them apart. reproj_px: RMS distance over the corners, pixels.
    alternative: the solution not chosen, None where there is only one. better_fit_rejected: the solution chosen
    fits the corners less well, but the past or the drone's attitude supports it.
    """

    camera_T_pad: Pose
    covariance: Array
    method: PoseMethod
    ambiguity: float
    reproj_px: float
    alternative: Pose | None = None
    better_fit_rejected: bool = False


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where a platform will be `horizon_s` later, in its track's reference frame: xy_m (2,), covariance (2, 2) m^2."""

    horizon_s: float
    xy_m: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Track:
    """The platform in the reference frame at one moment, and where it will be.

    state: (4,) x, y in m and vx, vy in m/s. covariance: (4, 4). nis: normalised innovation squared of this frame's
    measurement, None without one. predicted_xy_m: (2,) the place `horizon_s` later. predictions: the same at every
    horizon that was asked for.
    """

    track_id: int
    status: TrackState
    reference: Reference
    state: Array
    covariance: Array
    nis: float | None
    horizon_s: float
    predicted_xy_m: Array
    predictions: tuple[Prediction, ...] = ()


@dataclass(frozen=True)
class FrameResult:
    """What is known about one frame, without its image. Truth has the same type.

    pose: of the pad that is landed on, other_poses: of further pads in view. world_T_body: the drone's own pose where
    it is known. body_T_pad: the pad as seen from the drone. world_T_pad: in the world, where the drone's own pose is
    known. altitude_m: how high the drone is above the pad, known or estimated, what the stage was chosen by.
    """

    index: int
    t_ns: int | None
    file: str = ""
    status: Status = "ok"
    reason: str = ""
    haze: float | None = None
    dehazed: bool = False
    stage: Stage | None = None
    search: Search | None = None
    detections: tuple[Detection, ...] = ()
    tags: tuple[TagObservation, ...] = ()
    pose: PadPose | None = None
    other_poses: tuple[PadPose, ...] = ()
    altitude_m: float | None = None
    world_T_body: Pose | None = None
    body_T_pad: Pose | None = None
    world_T_pad: Pose | None = None
    tracks: tuple[Track, ...] = ()
    stage_seconds: dict[str, float] = field(default_factory=dict)
