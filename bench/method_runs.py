"""Landings with truth, tracked as `landtool track` does: what was found in every frame beside what is true."""

from __future__ import annotations

import csv
import hashlib
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from apriltag import apriltag

from landtool.camera import Camera
from landtool.config import TrackConfig, configured
from landtool.geometry import Array, Pose, rotation_from_quaternion
from landtool.io.calibration import read_camera, write_camera
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.run.tracking import track
from landtool.synth.clips.config import ClipConfig
from landtool.synth.clips.scenarios import ScenarioName
from landtool.synth.clips.write import write_clip
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.types import Frame, FrameResult, Image, LostFrame, PadPose, TagObservation, Track

Way = Literal["ego", "alone", "paper ego", "paper alone"]
WAYS: tuple[Way, ...] = ("ego", "alone", "paper ego", "paper alone")
DURATION_S, FPS, START_M = 10.0, 15, 20.0
PROCESSES = 2
RENDERED = Path(__file__).resolve().parents[2] / "shared" / "data" / "rendered" / "clips"


@dataclass(frozen=True)
class Clip:
    """A recording with its truth. ego: the drone's own poses, None where there are none."""

    name: str
    path: Path
    camera: Path
    pad: Path | None
    ego: Path | None


@dataclass(frozen=True)
class Recipe:
    """A clip to make. fog_per_m: extinction."""

    scenario: ScenarioName
    seed: int
    fog_per_m: float = 0.0

    @property
    def name(self) -> str:
        """A name for a table."""
        return f"{self.scenario}{' in fog' if self.fog_per_m else ''} {self.seed}"


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true of a clip's N frames. t_s: (N,). camera_T_pad: N. places_m: (N, 2) of the pad by reference frame."""

    t_s: Array
    camera_T_pad: tuple[Pose, ...]
    visible: Array
    places_m: dict[str, Array]

    def later_m(self, reference: str, frame: int, horizon_s: float) -> Array | None:
        """Return the true place (2,) some time after a frame, None after the clip's end."""
        at = self.t_s[frame] + horizon_s
        if at > self.t_s[-1]:
            return None
        return np.array([np.interp(at, self.t_s, places) for places in self.places_m[reference].T])

    def velocity_mps(self, reference: str) -> Array:
        """Return the true velocities (N, 2)."""
        return np.asarray(np.gradient(self.places_m[reference], self.t_s, axis=0))


@dataclass(frozen=True, eq=False)
class Seen:
    """What one frame gave. library, tag: poses of AprilTag's own corners by IPPE, and of landtool's corners alone."""

    index: int
    pose: PadPose | None
    tracks: tuple[Track, ...]
    library: Pose | None = None
    tag: Pose | None = None


@dataclass(frozen=True, eq=False)
class Landing:
    """One clip followed one way. fx_px: of its camera."""

    clip: str
    way: Way
    fx_px: float
    truth: Truth
    frames: tuple[Seen, ...]


def landings(recipes: Sequence[Recipe], ways: Sequence[Way] = WAYS) -> list[Landing]:
    """Make the clips, where they are not there from before, and follow each of them in every way."""
    with ProcessPoolExecutor(PROCESSES) as pool:
        clips = list(pool.map(made, recipes))
        return list(pool.map(followed, [c for c in clips for _ in ways], [w for _ in clips for w in ways]))


def made(recipe: Recipe) -> Clip:
    """Return a clip of the cache in the system's temporary folder, made if it is not there."""
    config = ClipConfig(
        recipe.scenario, DURATION_S, Fraction(FPS), height_start_m=START_M, fog_beta=recipe.fog_per_m, seed=recipe.seed
    )
    digest = hashlib.sha256(repr(sorted(config.as_values().items())).encode()).hexdigest()[:16]
    path = Path(tempfile.gettempdir()) / "landtool-bench" / f"{digest}.mp4"
    path.parent.mkdir(exist_ok=True)
    if not path.exists():
        write_clip(config, path, overwrite=True)
    camera, pad, ego = (path.with_suffix(ending) for ending in (".camera.yaml", ".pad.toml", ".ego.csv"))
    return Clip(recipe.name, path, camera, pad, ego)


def rendered(folder: Path) -> list[Clip]:
    """Return the path-traced clips beside the project, their cameras written into a folder."""
    clips = []
    for path in sorted(RENDERED.glob("*.mp4")):
        first = _rows(path.with_suffix(".csv"))[0]
        fx, fy, cx, cy = (float(first[name]) for name in ("fx", "fy", "cx", "cy"))
        distortion = tuple(float(first[name]) for name in ("k1", "k2", "p1", "p2", "k3"))
        camera = folder / f"{path.stem}.camera.yaml"
        write_camera(Camera(640, 480, fx, fy, cx, cy, distortion=distortion), camera)
        clips.append(Clip(path.stem, path, camera, None, None))
    return clips


def followed(clip: Clip, way: Way) -> Landing:
    """Run `landtool track` on a clip."""
    camera, pad = read_camera(clip.camera), PadSpec() if clip.pad is None else PadSpec.read(clip.pad)
    values: dict[str, object] = {"camera": clip.camera, "save": "csv"}
    if clip.pad is not None:
        values["pad"] = clip.pad
    if way in ("ego", "paper ego"):
        values["ego"] = str(clip.ego)
    if way in ("paper ego", "paper alone"):
        values |= {"policy": "paper", "tracker": {"measurement": "paper"}}
    seen: list[Seen] = []

    def keep(frame: Frame | LostFrame, result: FrameResult) -> None:
        by_library = by_tag = None
        if way == "alone" and isinstance(frame, Frame):
            by_tag = _of_tags(result.tags, camera, pad)
            by_library = _of_library(frame.image, camera, pad) if by_tag is not None else None
        seen.append(Seen(result.index, result.pose, result.tracks, by_library, by_tag))

    with tempfile.TemporaryDirectory() as folder:
        track(clip.path, Path(folder) / "out", configured(TrackConfig(), values), on_frame=keep)
    truth = _generated(clip.path) if clip.pad else _path_traced(clip.path)
    return Landing(clip.name, way, camera.fx, truth, tuple(seen))


def _of_tags(tags: Sequence[TagObservation], camera: Camera, pad: PadSpec) -> Pose | None:
    corners = pad_corners(tags, camera, pad)
    solutions = () if corners is None else pad_solutions(corners)
    return solutions[0].camera_T_pad if solutions else None


@cache
def _library() -> apriltag:
    return apriltag("tag36h11", decimate=1.0)


def _of_library(image: Image, camera: Camera, pad: PadSpec) -> Pose | None:
    """Return the pose by AprilTag over the whole frame and IPPE, the lower reprojection error."""
    spec = pad.tags[0]
    found = [tag for tag in _library().detect(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)) if tag["id"] == spec.id]
    if not found:
        return None
    corners = camera.normalize(found[0]["lb-rb-rt-lt"][::-1] - 0.5)
    points = pad.tag_corners_m(spec)
    _, rotvecs, places, _ = cv2.solvePnPGeneric(points, corners, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    return Pose.from_rotvec(places[0].ravel(), rotvecs[0].ravel())


def _generated(path: Path) -> Truth:
    rows = _rows(path.with_suffix(".truth.csv"))
    pads = tuple(_pose(row, "camera_T_pad_{}_m", "camera_T_pad_q{}") for row in rows)
    world = np.array([[float(row["world_T_pad_x_m"]), float(row["world_T_pad_y_m"])] for row in rows])
    t_s = np.array([int(row["t_ns"]) for row in rows]) * 1e-9
    return Truth(t_s, pads, _column(rows, "visible_fraction"), {"world": world, "body": _in_body(pads)})


def _path_traced(path: Path) -> Truth:
    rows = _rows(path.with_suffix(".csv"))
    pads = tuple(_pose(row, "t{}", "q{}") for row in rows)
    return Truth(_column(rows, "t"), pads, _column(rows, "visible_fraction"), {"body": _in_body(pads)})


def _in_body(camera_T_pad: Sequence[Pose]) -> Array:
    return np.array([(STRAIGHT_DOWN @ pose).translation[:2] for pose in camera_T_pad])


def _pose(row: dict[str, str], place: str, turn: str) -> Pose:
    quaternion = np.array([float(row[turn.format(axis)]) for axis in "wxyz"])
    rotation = rotation_from_quaternion(quaternion / np.linalg.norm(quaternion))
    return Pose(rotation, np.array([float(row[place.format(axis)]) for axis in "xyz"]))


def _column(rows: Sequence[dict[str, str]], name: str) -> Array:
    return np.array([float(row[name]) for row in rows])


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
