"""The folder in which the docs' examples run: the files they name, made of the fixtures."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap_protobuf.writer import Writer

from landtool.io.calibration import read_camera, write_camera
from landtool.io.source import open_source
from landtool.io.video_out import VideoWriter
from landtool.types import Frame
from tests.red_box import red_box
from tests.shared import ROOT

FIXTURES = ROOT / "datasets" / "fixtures"
DOCS = ROOT / "docs"
PAGES = sorted([ROOT / "README.md", *DOCS.glob("*.md")])
# What the docs call a copy of a fixture
COPIES = {"flight.mp4": "approach.mp4", "fog.mp4": "hover-fog.mp4", "camera.yaml": "approach.camera.yaml"}
PICTURES = 6
FENCE = re.compile(r"^( *)```([\w-]*) *([^\n]*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
DAMAGE = slice(200_000, 200_400)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page. kind: the first word behind the fence; says: the rest of that line."""

    kind: str
    says: str
    text: str


def blocks(page: Path, kind: str | None = None) -> list[Block]:
    """Return a page's fenced blocks in order, those in lists too; of one kind, or all."""
    found = FENCE.findall(page.read_text(encoding="utf-8"))
    made = [Block(name, says, re.sub(f"^{indent}", "", text, flags=re.M)) for indent, name, says, text in found]
    return [block for block in made if kind in (None, block.kind)]


def named_blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Yield the files a page shows: blocks whose first line is a comment that names them."""
    for block in blocks(page):
        name = re.match(r"# ([\w./-]*\.\w+)\b", block.text)
        if name:
            yield name[1], block.text


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with every file the examples take."""
    folder = tmp_path_factory.mktemp("recordings")
    clip = FIXTURES / "approach.mp4"
    for fixture in FIXTURES.glob("approach.*"):
        shutil.copy(fixture, folder)
    for name, source in COPIES.items():
        shutil.copy(FIXTURES / source, folder / name)
    data = bytearray(clip.read_bytes())
    (folder / "unfinished.mp4").write_bytes(data[:300_000])
    data[DAMAGE] = bytes(DAMAGE.stop - DAMAGE.start)
    (folder / "damaged.mp4").write_bytes(data)
    camera = read_camera(FIXTURES / "approach.camera.yaml")
    write_camera(camera.scaled(1280, 960), folder / "large.camera.yaml")
    pictures = _first_pictures(clip)
    _write_pictures(folder / "photos", pictures)
    _write_stereo(folder / "stereo.mcap", pictures)
    (folder / "films").mkdir()
    shutil.copy(clip, folder / "films")
    for name in ("left", "right"):
        _write_short_clip(folder / f"{name}.mp4", pictures)
    red_box(folder / "signs.onnx")
    for page in PAGES:
        for name, text in named_blocks(page):
            if name.endswith(".toml"):
                (folder / name).write_text(text, encoding="utf-8")
    return folder


def _first_pictures(clip: Path) -> list[Frame]:
    with open_source(clip) as source:
        frames = (frame for frame in source if isinstance(frame, Frame))
        return [frame for _, frame in zip(range(PICTURES), frames, strict=False)]


def _write_pictures(folder: Path, pictures: list[Frame]) -> None:
    folder.mkdir()
    for frame in pictures:
        (folder / f"img{frame.index + 1}.png").write_bytes(_encoded(frame, ".png"))


def _write_stereo(path: Path, pictures: list[Frame]) -> None:
    with path.open("wb") as file, Writer(file) as writer:
        for frame in pictures:
            t_ns = frame.t_ns or 0
            for topic in ("/left/image", "/right/image"):
                message = CompressedImage(format="jpeg", data=_encoded(frame, ".jpg"))
                message.timestamp.FromNanoseconds(t_ns)
                writer.write_message(topic, message, log_time=t_ns, publish_time=t_ns)


def _write_short_clip(path: Path, pictures: list[Frame]) -> None:
    height, width = pictures[0].image.shape[:2]
    with VideoWriter(path, width, height, Fraction(1, 15360)) as video:
        for frame in pictures:
            video.write(frame.image, frame.t_ns)


def _encoded(frame: Frame, suffix: str) -> bytes:
    done, data = cv2.imencode(suffix, frame.image)
    assert done
    return np.asarray(data).tobytes()
