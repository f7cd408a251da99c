"""Tags in other people's photographs, read at least as well as the AprilTag library's own programs read them."""

from __future__ import annotations

import itertools
import json
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Array
from landtool.pad import PadSpec, PadTag
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.types import Image
from tests.shared import shared_data

ANY = TagReader(ReaderConfig({"tag36h11": None}))
NEAR_PX = 6.0


def picture(path: Path) -> Image:
    image = cv2.imread(str(path))
    assert image is not None
    return np.asarray(image, np.uint8)


def listed(path: Path) -> list[tuple[int, Array]]:
    """Read a reference file: id and corners (4, 2) in OpenCV's pixels, any order."""
    rows = [
        line.replace(",", " ").replace("(", " ").replace(")", " ").split() for line in path.read_text().splitlines()
    ]
    return [(int(row[0]), np.array(row[1:9], float).reshape(4, 2) - 0.5) for row in rows if row]


def test_aprilrobotics_photographs() -> None:
    folder = shared_data("tags/aprilrobotics")
    read, total, apart = 0, 0, []
    for path in sorted(folder.glob("*.jpg")):
        tags = ANY.read_frame(picture(path))
        for tag_id, corners in listed(path.with_suffix(".txt")):
            total += 1
            near = [t for t in tags if t.tag_id == tag_id and _apart(t.corners_px, corners) < NEAR_PX]
            read += bool(near)
            # the nearest of ours for each of theirs: the order of corners is another convention
            apart += [np.linalg.norm(near[0].corners_px - c, axis=1).min() for c in corners] if near else []
    assert total == 47
    assert read >= 46
    assert np.median(apart) < 0.5


def _apart(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))


@pytest.mark.full
def test_swatbotics_room() -> None:
    folder = shared_data("tags/swatbotics")
    seen = [line.split() for line in (folder / "mapping/groundtruth.txt").read_text().splitlines()]
    truth = {row[0]: set(map(int, row[1:])) for row in seen if row and row[0].startswith("IMG")}
    matrix = json.loads((folder / "camera.json").read_text())["K"]
    read, wrong = 0, 0
    distances = defaultdict(list)
    for name, ids in truth.items():
        image = picture(folder / "mapping" / name)
        height, width = image.shape[:2]
        camera = Camera(width, height, matrix[0][0], matrix[1][1], matrix[0][2], matrix[1][2])
        tags = ANY.read_frame(image)
        found = {tag.tag_id for tag in tags}
        read, wrong = read + len(found & ids), wrong + len(found - ids)
        places = {}
        for tag in tags:
            corners = pad_corners([tag], camera, PadSpec(diameter_m=0.127, tags=(PadTag(id=tag.tag_id, size=1.0),)))
            assert corners is not None
            places[tag.tag_id] = pad_solutions(corners)[0].camera_T_pad.translation
        for a, b in itertools.combinations(sorted(places), 2):
            distances[a, b].append(np.linalg.norm(places[a] - places[b]))
    assert sum(map(len, truth.values())) == 236
    assert read >= 228
    assert wrong == 0
    repeat = [np.std(d) / np.mean(d) for d in distances.values() if len(d) >= 3]
    assert np.median(repeat) < 0.009
