"""`landtool track` on the real and path-traced recordings beside the project, with both tone curves."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from apriltag import apriltag

from bench.show import table
from landtool.camera import Camera
from landtool.config import TrackConfig, configured
from landtool.geometry import Array, Pose
from landtool.io.calibration import read_camera, write_camera
from landtool.io.source import open_source
from landtool.io.tables import read_table
from landtool.run.tracking import track
from landtool.types import Frame

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
TONES = ("srgb", "none")


def main() -> None:
    """Print a table for each set that is there."""
    parts: dict[str, Callable[[], None]] = {
        "rendered/clips": _path_traced,
        "tags/wpilib": _wpilib,
        "tags/swatbotics": _swatbotics,
        "mcap": _logs,
    }
    for name, part in parts.items():
        if (SHARED / name).exists():
            part()
        else:
            print(f"\n{name}: not there, left out")


def _tracked(path: Path, folder: Path, values: dict[str, object]) -> Path:
    return track(path, folder, configured(TrackConfig(), {"save": "csv", **values})).folder


def _path_traced() -> None:
    """Range error and frames read on a clip of another renderer, against a whole-frame pass of the library."""
    clip = SHARED / "rendered" / "clips" / "clip2_stop_and_go.mp4"
    with clip.with_suffix(".csv").open() as file:
        truth = list(csv.DictReader(file))
    places = np.array([[float(row[c]) for c in ("tx", "ty", "tz")] for row in truth])
    camera = Camera(640, 480, *(float(truth[0][c]) for c in ("fx", "fy", "cx", "cy")))
    rows = [["AprilTag whole frame, IPPE", *_library_range(clip, camera, places)]]
    with tempfile.TemporaryDirectory() as folder:
        write_camera(camera, Path(folder) / "camera.yaml")
        for tone in TONES:
            values = {"camera": Path(folder) / "camera.yaml", "tags": {"tone": tone}}
            poses = read_table(_tracked(clip, Path(folder) / tone, values) / "poses.csv")
            frames = [frame or 0 for frame in poses.ints("frame")]
            found = np.column_stack([poses.floats(f"{axis}_m") for axis in "xyz"])
            rows.append([f"landtool --tone {tone}", *_range_cells(found, places[frames])])
    table(f"{clip.name}, path-traced: range error", ["", "frames", "median %", "worst %"], rows)


def _range_cells(found: Array, truth: Array) -> list[str]:
    error = 100.0 * np.abs(np.linalg.norm(found, axis=1) / np.linalg.norm(truth, axis=1) - 1.0)
    return [str(len(found)), f"{np.median(error):.3f}", f"{error.max():.3f}"]


def _library_range(clip: Path, camera: Camera, places: Array) -> list[str]:
    library, found, at = apriltag("tag36h11", decimate=1.0), [], []
    for frame in open_source(clip):
        tags = library.detect(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)) if isinstance(frame, Frame) else []
        corners = [tag["lb-rb-rt-lt"][::-1] - 0.5 for tag in tags if tag["id"] == 5]
        if corners:
            found.append(_square_pose(corners[0], camera, 0.16).translation)
            at.append(frame.index)
    return _range_cells(np.array(found), places[at])


def _square_pose(corners: Array, camera: Camera, size_m: float) -> Pose:
    """Return camera_T_tag of one square by IPPE, the lower error."""
    h = size_m / 2.0
    square = np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])
    flat = camera.normalize(corners)
    _, rotvecs, places, _ = cv2.solvePnPGeneric(square, flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    return Pose.from_rotvec(places[0].ravel(), rotvecs[0].ravel())


def _places(folder: Path, camera: Camera, size_m: float) -> dict[int, dict[int, Array]]:
    """Return the place of every tag in every frame, from the corners in tags.csv."""
    tags = read_table(folder / "tags.csv")
    corners = np.stack([tags.floats(f"{axis}{k}_px") for k in range(4) for axis in "xy"], axis=1).reshape(-1, 4, 2)
    found: dict[int, dict[int, Array]] = {}
    for frame, tag_id, square in zip(tags.ints("frame"), tags.ints("tag_id"), corners, strict=True):
        found.setdefault(frame or 0, {})[tag_id or 0] = _square_pose(square, camera, size_m).translation
    return found


def _wpilib() -> None:
    """Two tags of known distance in a hand-held video: how constant the distance measured is."""
    clip = SHARED / "tags" / "wpilib" / "fieldvideo_long.mp4"
    camera = read_camera(clip.parent / "camera_fieldvideo.json")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for tone in TONES:
            values = {"hfov_deg": 50.0, "tags": {"which": "all", "tone": tone}}
            places = _places(_tracked(clip, Path(folder) / tone, values), camera, 0.1651)
            apart = [np.linalg.norm(tags[3] - tags[4]) for tags in places.values() if {3, 4} <= tags.keys()]
            rows.append([tone, str(len(apart)), f"{np.mean(apart):.4f}", f"{1e3 * np.std(apart):.2f}"])
    table("wpilib video, tags 3 and 4, 159 frames", ["tone", "frames with both", "distance m", "std mm"], rows)


def _swatbotics() -> None:
    """72 photographs of a room with tags on the walls: views read, and how distances of fixed tags repeat."""
    folder = SHARED / "tags" / "swatbotics"
    camera = read_camera(folder / "camera.json")
    lines = [line.split() for line in (folder / "mapping" / "groundtruth.txt").read_text().splitlines() if line.strip()]
    truth = [{int(tag) for tag in line[1:]} for line in lines]
    rows = []
    with tempfile.TemporaryDirectory() as output:
        for tone in TONES:
            values = {"hfov_deg": 50.0, "tags": {"which": "all", "tone": tone}}
            places = _places(_tracked(folder / "mapping", Path(output) / tone, values), camera, 0.127)
            read = [set(places.get(index, {})) for index in range(len(truth))]
            right = sum(len(a & b) for a, b in zip(read, truth, strict=True))
            wrong = sum(len(a - b) for a, b in zip(read, truth, strict=True))
            spread = _repeatability(places)
            rows.append([tone, f"{right} of {sum(map(len, truth))}", str(wrong), f"{100 * np.median(spread):.2f}"])
    table("swatbotics mapping, 72 photographs", ["tone", "views read", "wrong", "median std/mean of distances %"], rows)


def _repeatability(places: dict[int, dict[int, Array]]) -> list[float]:
    """Return std/mean of the distance of every pair of tags seen together three times or more."""
    pairs: dict[tuple[int, int], list[float]] = {}
    for tags in places.values():
        for a, b in combinations(sorted(tags), 2):
            pairs.setdefault((a, b), []).append(float(np.linalg.norm(tags[a] - tags[b])))
    return [float(np.std(d) / np.mean(d)) for d in pairs.values() if len(d) >= 3]


def _logs() -> None:
    """Every MCAP log with pictures: how many are read, and their tags."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for log in sorted((SHARED / "mcap").glob("*.mcap")):
            outcome = track(
                log,
                Path(folder) / log.stem,
                configured(TrackConfig(), {"save": "csv", "hfov_deg": 50.0, "tags": {"which": "all"}}),
            )
            rows.append([log.name, str(outcome.counts.decoded), str(outcome.summary.tags), str(outcome.exit_code)])
    table("MCAP logs", ["log", "pictures", "tags", "exit"], rows)
