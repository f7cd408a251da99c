"""What `inspect` finds out, as values. Names end in their units, for they are the keys of `landtool info --json`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from landtool.camera import Camera
from landtool.inspect.advice import TagRange, TrackAdvice
from landtool.inspect.clock import Clock
from landtool.pad import PadSpec
from landtool.types import Frame, LostFrame

Kind = Literal["video", "images", "mcap", "calibration", "pad", "mount", "ego", "settings"]
Watch = Callable[[Iterable[Frame | LostFrame], int | None], Iterable[Frame | LostFrame]]


@dataclass(frozen=True)
class Request:
    """What is known besides the input. size: width and height in pixels that hfov_deg is for, when it is no recording.

    camera, camera_name, hfov_deg, topic, fps as `landtool track` takes them. pad: the target ranges are told for;
    pad_file: where it was read, None for the default.
    scan: decode every picture. watch: passes the frames of a scan on, given their declared number.
    """

    camera: Path | None = None
    camera_name: str | None = None
    hfov_deg: float | None = None
    size: tuple[int, int] | None = None
    topic: str | None = None
    fps: float | None = None
    pad: PadSpec = field(default_factory=PadSpec)
    pad_file: Path | None = None
    scan: bool = False
    watch: Watch = lambda frames, _total: frames


@dataclass(frozen=True)
class CameraFacts:
    """A camera. name: in a Kalibr camchain, else empty. Fields of view: None where the lens model has no inverse."""

    name: str
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    hfov_deg: float | None
    vfov_deg: float | None
    model: str
    distortion: tuple[float, ...]
    assumed: str

    @classmethod
    def of(cls, camera: Camera, name: str = "") -> CameraFacts:
        """Tell what a camera is."""
        w, h = camera.width - 0.5, camera.height - 0.5
        across = _angle_deg(camera, (-0.5, camera.cy), (w, camera.cy))
        down = _angle_deg(camera, (camera.cx, -0.5), (camera.cx, h))
        parameters = camera.fx, camera.fy, camera.cx, camera.cy
        size = camera.width, camera.height
        return cls(name, *size, *parameters, across, down, camera.model, camera.distortion, camera.assumed)


def _angle_deg(camera: Camera, one_px: tuple[float, float], other_px: tuple[float, float]) -> float | None:
    """Angle between the rays of two pixels on either side of the centre."""
    a, b = camera.unproject([one_px, other_px])
    angle = math.degrees(math.atan2(math.hypot(*_cross(a, b)), float(a @ b)))
    return angle if math.isfinite(angle) else None


def _cross(a: Iterable[float], b: Iterable[float]) -> tuple[float, float, float]:
    (ax, ay, az), (bx, by, bz) = a, b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@dataclass(frozen=True)
class Fault:
    """A frame of a scan that is damaged, or lost: no picture could be got from it."""

    frame: int
    t_ns: int | None
    file: str
    lost: bool
    reason: str


@dataclass(frozen=True)
class Scan:
    """What decoding everything found. sizes: width, height, pictures of each; faults: the first ones."""

    decoded: int
    damaged: int
    lost: int
    skipped: int
    truncated: bool
    sizes: tuple[tuple[int, int, int], ...]
    faults: tuple[Fault, ...]


@dataclass(frozen=True)
class Topic:
    """A topic of a log. role: what landtool can use it for. calibration: of an image topic, the topic that is its."""

    name: str
    type: str
    encoding: str
    messages: int
    role: str
    calibration: str
    clock: Clock | None


@dataclass(frozen=True)
class Log:
    """An MCAP log. first_ns, last_ns: times of logging. topic: the image topic the recording's other facts are of."""

    profile: str
    library: str
    indexed: bool
    cut: bool
    lost_chunks: int
    first_ns: int | None
    last_ns: int | None
    topics: tuple[Topic, ...]
    topic: str


@dataclass(frozen=True)
class Recording:
    """A video, folder of images, image or MCAP log. None: not known, or without a scan not cheap to know.

    rotation_deg: clockwise, applied already. frames_found: packets, files or messages. damaged_packets: those of a
    video that show damage without decoding. camera: the one given, else the recording's own. ranges: of `pad`'s tags.
    """

    width_px: int | None
    height_px: int | None
    encoding: str
    profile: str
    pixel_format: str
    rotation_deg: int
    frames_declared: int | None
    frames_found: int
    key_frames: int | None
    damaged_packets: int | None
    duration_ns: int | None
    clock: Clock | None
    scan: Scan | None
    log: Log | None
    camera: CameraFacts | None
    pad: str
    ranges: tuple[TagRange, ...]


@dataclass(frozen=True)
class Calibration:
    """A calibration file's cameras."""

    cameras: tuple[CameraFacts, ...]


@dataclass(frozen=True)
class PadTagFacts:
    """A tag on a pad: edge of its border, place of its centre and turn, as in a pad file."""

    family: str
    tag_id: int
    size_mm: float
    x_mm: float
    y_mm: float
    yaw_deg: float


@dataclass(frozen=True)
class Pad:
    """A target. None: not on it. extent_mm: side of the square that holds everything printed.

    whole_from_m: distance from which a camera sees the whole of it; None without a camera, and then no ranges.
    """

    name: str
    diameter_mm: float
    extent_mm: float
    board_mm: float | None
    ring_outer_mm: float | None
    ring_inner_mm: float | None
    letter_height_mm: float | None
    letter_width_mm: float | None
    letter_stroke_mm: float | None
    quiet_zone_mm: float | None
    tags: tuple[PadTagFacts, ...]
    camera: CameraFacts | None
    whole_from_m: float | None
    ranges: tuple[TagRange, ...]


@dataclass(frozen=True)
class Mount:
    """A camera's place on the body. off_down_deg: angle of its optical axis from straight down.

    axis_body, image_top_body: the optical axis and the image's upward direction in the body frame.
    """

    translation_m: tuple[float, ...]
    quaternion_wxyz: tuple[float, ...]
    off_down_deg: float
    axis_body: tuple[float, ...]
    image_top_body: tuple[float, ...]


@dataclass(frozen=True)
class Ego:
    """The drone's own poses. low_m, high_m: corners of the box they fill; path_m: length of the way."""

    poses: int
    clock: Clock | None
    low_m: tuple[float, ...]
    high_m: tuple[float, ...]
    path_m: float


@dataclass(frozen=True)
class Settings:
    """A settings file of `landtool track`. values: by name, `tracker.horizon_s` for one inside a table."""

    values: dict[str, object]


@dataclass(frozen=True)
class Facts:
    """What an input is. bytes: its size. damaged: cut, or part of it cannot be read. notes: one sentence each."""

    path: Path
    kind: Kind
    format: str
    bytes: int
    damaged: bool
    notes: tuple[str, ...]
    facts: Recording | Calibration | Pad | Mount | Ego | Settings
    track: TrackAdvice
