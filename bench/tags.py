"""The tag reader by size of the tag, on real photographs, on pictures without a tag, and its time."""

from __future__ import annotations

import itertools
import json
import re
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from apriltag import apriltag
from pupil_apriltags import Detector

from bench.show import median_ms, table
from landtool.camera import Camera
from landtool.geometry import Array
from landtool.pad import PadSpec, PadTag
from landtool.synth.truth import tag_corners_px
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, Region, TagReader, module_px
from landtool.tone import Tone
from landtool.types import Image, TagObservation
from tests.scenes import CAMERA, PAD, photograph, view
from tests.unit.tags.clutter import clutter, photographs

TAGS = Path(__file__).resolve().parents[2] / "shared" / "data" / "tags"
SIDES_PX = (13, 15, 18, 24, 30, 40, 60, 100, 200)
VIEWS = 40
NO_TAG_PICTURES = 1000
NEAR_PX = 6.0
TONES: tuple[Tone, ...] = ("srgb", "none")

Found = list[tuple[int, Array]]
"""Ids and corners (4, 2), OpenCV's pixels."""
Reader = Callable[[Image], Found]


@dataclass(frozen=True, eq=False)
class View:
    """A rendered picture of the pad and its tag's true corners (4, 2)."""

    image: Image
    corners_px: Array

    @property
    def region(self) -> Region:
        """Where the track expects the tag: its box, five modules and eight pixels wider."""
        module = module_px(self.corners_px, PAD.tags[0].family)
        margin = 5.0 * module + 8.0
        x0, y0 = np.maximum(self.corners_px.min(axis=0) - margin, 0).astype(int)
        x1, y1 = np.minimum(self.corners_px.max(axis=0) + margin, [CAMERA.width, CAMERA.height]).astype(int)
        return Region(int(x0), int(y0), int(x1), int(y1), module)


class _Pupil(Detector):  # type: ignore[misc]
    """The binding without its destructor, which crashes now and then."""

    def __del__(self) -> None:
        pass


def main() -> None:
    """Print all tables."""
    views = {side: _views(side) for side in SIDES_PX}
    _by_size(views)
    _times(views)
    _no_tag()
    for part, show in (("aprilrobotics", _aprilrobotics), ("swatbotics", _swatbotics), ("pupil", _other_sets)):
        if (TAGS / part).exists():
            show()
        else:
            print(f"\ntags/{part}: not there, left out")


def _views(side: float) -> list[View]:
    """Pads anywhere in the picture, tilted 0 to 35 degrees, any yaw, noise of 3 grey levels."""
    rng = np.random.default_rng(int(side))
    made = []
    for _ in range(VIEWS):
        distance_m = CAMERA.fx * PAD.tag_size_m(PAD.tags[0]) / side
        reach = (np.array([CAMERA.width, CAMERA.height]) / 2.0 - 0.8 * side - 3.0) / CAMERA.fx
        off = rng.uniform(-reach, reach)
        azimuth, yaw = rng.uniform(0.0, 2.0 * np.pi, 2)
        pose = view(distance_m, rng.uniform(0.0, 35.0), azimuth, yaw, (float(off[0]), float(off[1])))
        made.append(View(photograph(pose, rng), tag_corners_px(CAMERA, pose, PAD, PAD.tags[0])))
    return made


def _grey(image: Image) -> Image:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _found(tags: Sequence[TagObservation]) -> Found:
    return [(tag.tag_id, tag.corners_px) for tag in tags]


def _others() -> dict[str, Reader]:
    """The two bindings over the whole frame, at full resolution; the library's pixel centres lie at +0.5."""
    upstream = apriltag("tag36h11", maxhamming=1, decimate=1.0)
    pupil = _Pupil(families="tag36h11", nthreads=1, quad_decimate=1.0)
    return {
        "apriltag-python": lambda image: [
            (tag["id"], tag["lb-rb-rt-lt"][::-1] - 0.5) for tag in upstream.detect(_grey(image)) if tag["margin"] > 20
        ],
        "pupil-apriltags": lambda image: [
            (tag.tag_id, tag.corners[::-1] - 0.5) for tag in pupil.detect(_grey(image)) if tag.decision_margin > 20
        ],
    }


def _by_size(views: dict[int, list[View]]) -> None:
    ours = {tone: TagReader(ReaderConfig.of_pad(PAD, tone)) for tone in TONES}
    ways: dict[str, Callable[[View], Found]] = {}
    for tone, reader in ours.items():
        ways[f"region {tone}"] = lambda v, r=reader: _found(r.read_region(v.image, v.region))  # type: ignore[misc]
        ways[f"frame {tone}"] = lambda v, r=reader: _found(r.read_frame(v.image))  # type: ignore[misc]
    for name, other in _others().items():
        ways[name] = lambda v, r=other: r(v.image)  # type: ignore[misc]
    rows = []
    for side, shots in views.items():
        cells = [str(side)]
        for way in ways.values():
            errors = [e for shot in shots if (e := _error(way(shot), shot.corners_px)) is not None]
            wide = f"{np.median(errors):.3f} {np.percentile(errors, 95):.3f}" if errors else "-"
            cells.append(f"{len(errors)}/{len(shots)} {wide}")
        rows.append(cells)
    table(
        "Tags read, and their corners' error in pixels, median and 95 %. 640x480, noise 3, tilt 0-35 degrees, "
        "anywhere. The two bindings search the whole frame, in encoded values, where edges lie inside the dark side",
        ["px", *ways],
        rows,
    )


def _error(found: Found, truth: Array) -> Array | None:
    """Return the distances (4,) of the pad's corners from the truth; None where it was not read there."""
    for tag_id, corners in found:
        if tag_id == PAD.tags[0].id and np.linalg.norm(corners.mean(axis=0) - truth.mean(axis=0)) < NEAR_PX:
            return np.asarray(np.linalg.norm(corners - truth, axis=1), np.float64)
    return None


def _times(views: dict[int, list[View]]) -> None:
    reader = TagReader(ReaderConfig.of_pad(PAD))
    whole = apriltag("tag36h11", maxhamming=1, decimate=1.0)
    rows = []
    for side, shots in views.items():
        shot = shots[0]
        grey, tags = _grey(shot.image), reader.read_region(shot.image, shot.region)
        read = median_ms(lambda s=shot: reader.read_region(s.image, s.region))  # type: ignore[misc]
        frame = median_ms(lambda s=shot: reader.read_frame(s.image), 10)  # type: ignore[misc]
        pose = median_ms(lambda t=tags: _solve(t)) if tags else np.nan  # type: ignore[misc]
        library = median_ms(lambda g=grey: whole.detect(g), 10)  # type: ignore[misc]
        cells = (read, pose, read + pose, frame, library)
        rows.append([str(side), *(f"{cell:.2f}" for cell in cells), f"{(read + pose) / library:.2f}"])
    head = ["px", "region", "pose", "region + pose", "landtool frame", "AprilTag frame", "ratio"]
    table("Processor time, ms, one thread, 640x480; ratio: region + pose to AprilTag over the whole frame", head, rows)


def _solve(tags: Sequence[TagObservation]) -> object:
    corners = pad_corners(tags, CAMERA, PAD)
    return None if corners is None else pad_solutions(corners)


def _no_tag() -> None:
    """Tags seen where there is none; the full test suite does it with 5,000 pictures."""
    real = photographs()
    rows = []
    for name, config in (("pad", ReaderConfig.of_pad(PAD)), ("all", ReaderConfig({"tag36h11": None}))):
        rng, reader = np.random.default_rng(99), TagReader(config)
        seen = sum(len(reader.read_frame(clutter(i, rng, real))) for i in range(NO_TAG_PICTURES))
        rows.append([name, str(NO_TAG_PICTURES), str(seen)])
    table("Pictures without a tag", ["--tags", "pictures", "tags seen"], rows)


def _every_way() -> dict[str, Reader]:
    ways: dict[str, Reader] = {}
    for tone in TONES:
        reader = TagReader(ReaderConfig({"tag36h11": None}, tone))
        ways[f"landtool {tone}"] = lambda image, r=reader: _found(r.read_frame(image))  # type: ignore[misc]
    return ways | _others()


def _picture(path: Path) -> Image:
    image = cv2.imread(str(path))
    if image is None:
        raise FileNotFoundError(path)
    return np.asarray(image, np.uint8)


def _aprilrobotics() -> None:
    photos = []
    for path in sorted((TAGS / "aprilrobotics").glob("*.jpg")):
        numbers = [re.findall(r"[-\d.]+", line) for line in path.with_suffix(".txt").read_text().splitlines() if line]
        photos.append((_picture(path), [(int(n[0]), np.array(n[1:9], float).reshape(4, 2) - 0.5) for n in numbers]))
    rows = []
    for name, way in _every_way().items():
        read, more, apart = 0, 0, []
        for image, listed in photos:
            found = way(image)
            more += len(found)
            for tag_id, theirs in listed:
                near = [c for i, c in found if i == tag_id and np.linalg.norm((c - theirs).mean(axis=0)) < NEAR_PX]
                read += bool(near)
                apart += [np.linalg.norm(near[0] - corner, axis=1).min() for corner in theirs] if near else []
        rows.append([name, f"{read}/47", str(more - read), f"{np.median(apart):.2f}"])
    table("aprilrobotics: tags of the reference list", ["reader", "read", "not listed", "corners apart px"], rows)


def _swatbotics() -> None:
    folder = TAGS / "swatbotics"
    lines = [line.split() for line in (folder / "mapping" / "groundtruth.txt").read_text().splitlines()]
    truth = {line[0]: set(map(int, line[1:])) for line in lines if line and line[0].startswith("IMG")}
    photos = {name: _picture(folder / "mapping" / name) for name in truth}
    height, width = next(iter(photos.values())).shape[:2]
    k = json.loads((folder / "camera.json").read_text())["K"]
    camera = Camera(width, height, k[0][0], k[1][1], k[0][2], k[1][2])
    rows = []
    for name, way in _every_way().items():
        read, wrong, distances = 0, 0, defaultdict(list)
        for photo, image in photos.items():
            found = dict(way(image))
            read, wrong = read + len(truth[photo] & set(found)), wrong + len(set(found) - truth[photo])
            places = {tag_id: _place(tag_id, corners, camera) for tag_id, corners in found.items()}
            for a, b in itertools.combinations(sorted(places), 2):
                distances[a, b].append(float(np.linalg.norm(places[a] - places[b])))
        repeat = [np.std(d) / np.mean(d) for d in distances.values() if len(d) >= 3]
        views = sum(map(len, truth.values()))
        rows.append([name, f"{read}/{views}", str(wrong), f"{100 * np.median(repeat):.2f}", str(len(repeat))])
    head = ["reader", "views read", "wrong", "distance std/mean %", "pairs"]
    table("swatbotics/mapping: tags on the walls of a room", head, rows)


def _place(tag_id: int, corners: Array, camera: Camera) -> Array:
    """Return where a tag of 0.127 m is, metres in the camera frame."""
    pad = PadSpec(diameter_m=0.127, tags=(PadTag(id=tag_id, size=1.0),))
    tag = TagObservation("tag36h11", tag_id, 0, 100.0, corners, np.eye(8))
    solved = pad_corners([tag], camera, pad)
    if solved is None:
        raise ValueError("a corner outside the lens model")
    return pad_solutions(solved)[0].camera_T_pad.translation


def _other_sets() -> None:
    sets = {"swatbotics/clipboard": "*.png", "swatbotics/hallway": "*.jpg", "pupil": "*.png"}
    photos = {name: [_picture(p) for p in sorted((TAGS / name).glob(kind))] for name, kind in sets.items()}
    rows: list[list[str]] = []
    for name, way in _every_way().items():
        rows.append([name, *(str(sum(len(way(image)) for image in images)) for images in photos.values())])
    table("Tags read, sets without a list", ["reader", *sets], rows)
