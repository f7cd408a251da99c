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
from landtool.evaluate.clip_truth import ClipTruth, TrueFrame, read_clip_truth
from landtool.geometry import Pose
from landtool.io.calibration import read_camera, write_camera
from landtool.pad import PadSpec
from landtool.run.tracking import track
from landtool.synth.clips.config import ClipConfig
from landtool.synth.clips.scenarios import ScenarioName
from landtool.synth.clips.write import write_clip
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.types import Frame, FrameResult, Image, LostFrame, TagObservation

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
class Landing:
    """One clip followed one way. library, tag: poses by frame, of AprilTag's corners by IPPE, and landtool's alone."""

    clip: str
    way: Way
    camera: Camera
    pad: PadSpec
    truth: ClipTruth
    results: tuple[FrameResult, ...]
    library: dict[int, Pose]
    tag: dict[int, Pose]


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
    results: list[FrameResult] = []
    by_library: dict[int, Pose] = {}
    by_tag: dict[int, Pose] = {}

    def keep(frame: Frame | LostFrame, result: FrameResult) -> None:
        results.append(result)
        if way != "alone" or not isinstance(frame, Frame) or (pose := _of_tags(result.tags, camera, pad)) is None:
            return
        by_tag[result.index] = pose
        if (pose := _of_library(frame.image, camera, pad)) is not None:
            by_library[result.index] = pose

    with tempfile.TemporaryDirectory() as folder:
        track(clip.path, Path(folder) / "out", configured(TrackConfig(), values), on_frame=keep)
    truth = read_clip_truth(clip.path.with_suffix(".truth.csv")) if clip.pad else _path_traced(clip.path)
    return Landing(clip.name, way, camera, pad, truth, tuple(results), by_library, by_tag)


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


def _path_traced(path: Path) -> ClipTruth:
    table = path.with_suffix(".csv")
    frames = []
    for row in _rows(table):
        quaternion = [float(row[f"q{axis}"]) for axis in "wxyz"]
        pad = Pose.from_quaternion([float(row[f"t{axis}"]) for axis in "xyz"], quaternion)
        t_ns, visible = round(float(row["t"]) * 1e9), float(row["visible_fraction"])
        frames.append(TrueFrame(int(row["frame"]), t_ns, pad, visible_fraction=visible))
    return ClipTruth(table, tuple(frames))


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
