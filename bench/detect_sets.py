"""The pictures a detector is scored on, with their boxes: path-traced ones, our own, and a YOLO dataset's."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from landtool.config import GenerateConfig
from landtool.errors import InputError
from landtool.io.images import PictureError, read_picture
from landtool.io.labels import LabelledBox, LabelledImage, read_yolo
from landtool.io.source import open_source
from landtool.pad import PadSpec
from landtool.synth.dataset import DatasetRequest
from landtool.synth.domain import Domain
from landtool.synth.fog import KOSCHMIEDER
from landtool.synth.make_sample import make_sample
from landtool.types import Frame, Image

RENDERED = Path(__file__).resolve().parents[2] / "shared" / "data" / "rendered"
FIXTURES = Path(__file__).resolve().parents[1] / "datasets" / "fixtures"
SIZE = (640, 480)
LEAST_VISIBLE = 0.2  # of the pad
OWN_IMAGES, OWN_SEED = 1120, 0  # `landtool generate images -n 1120`
FOGGY, FOG_SEED, BETA_PER_M, HEIGHT_M = 150, 4, 0.1, 10.0
PAD = PadSpec()


@dataclass(frozen=True, eq=False)
class PictureSet:
    """Pictures by their place in `truth`. names: of the classes by their ids. clip: they follow each other."""

    name: str
    truth: Sequence[LabelledImage]
    picture: Callable[[int], Image]
    names: tuple[str, ...] = ("pad",)
    clip: bool = False


def path_traced_sets() -> list[PictureSet]:
    """Return the sets of the other renderer that lie beside the project, none where they do not."""
    clip = RENDERED / "clips" / "clip2_stop_and_go.mp4"
    sets = []
    if (RENDERED / "stills").exists():
        sets.append(_of_csv("path-traced stills", RENDERED / "stills" / "labels.csv"))
    if clip.exists():
        sets.append(_of_clip("path-traced clip", clip))
    if (RENDERED / "fog").exists():
        fog = RENDERED / "fog" / "labels.csv"
        sets += [_of_csv("path-traced fog", fog), _of_csv("the same, clear", fog, "clear")]
    return sets


def own_clips() -> list[PictureSet]:
    """Return the clips shipped as fixtures; frames that show less than LEAST_VISIBLE of the pad count neither way."""
    return [_own_clip(table.with_name(table.name.replace(".truth.csv", ".mp4"))) for table in _fixture_tables()]


def own_test_set() -> PictureSet:
    """Return the test split of `landtool generate images -n 1120`, made in memory."""
    request = DatasetRequest(OWN_IMAGES, OWN_SEED, SIZE, GenerateConfig().split, Domain(), PAD)
    chosen = [index for index, split in enumerate(request.split_of_images()) if split == "test"]
    return made_set("own test split", request.domain, request.seed, chosen)


def own_fog_set() -> PictureSet:
    """Return pictures through even fog of beta 0.1 from 10 m over the pad, whose diameter is 1 m."""
    visibility_m = KOSCHMIEDER / BETA_PER_M
    domain = Domain(
        height_m=(HEIGHT_M, HEIGHT_M),
        fog=1.0,
        visibility_m=(visibility_m, visibility_m),
        fog_banks=0.0,
        small_print=0.0,
        absent=0.0,
    )
    return made_set(f"own fog, beta {BETA_PER_M:g}, {HEIGHT_M:g} m", domain, FOG_SEED, range(FOGGY))


def yolo_set(data_yaml: Path, split: str) -> PictureSet:
    """Return a split of a YOLO dataset. Raises UsageError and InputError as `read_yolo`."""
    dataset = read_yolo(data_yaml)
    truth = list(dataset.read(split))
    return PictureSet(f"{data_yaml.parent.name} {split}", truth, lambda i: _read(truth[i].path), dataset.names)


def _of_csv(name: str, table: Path, column: str = "file") -> PictureSet:
    truth = []
    for row in _rows(table):
        path = RENDERED / row[column]
        truth.append(LabelledImage(path, *SIZE, _boxes(row) if row["present"] == "1" else ()))
    return PictureSet(name, truth, lambda i: _read(truth[i].path))


def _of_clip(name: str, clip: Path) -> PictureSet:
    return _clip(name, clip, [_boxes(row) for row in _rows(clip.with_suffix(".csv"))])


def _fixture_tables() -> list[Path]:
    return sorted(FIXTURES.glob("*.truth.csv"))


def _own_clip(clip: Path) -> PictureSet:
    return _clip(clip.stem, clip, [_own_boxes(row) for row in _rows(clip.with_suffix(".truth.csv"))])


def _own_boxes(row: dict[str, str]) -> tuple[LabelledBox, ...]:
    if not row["x_min_px"]:
        return ()
    x0, y0, x1, y1 = (float(row[f"{name}_px"]) for name in ("x_min", "y_min", "x_max", "y_max"))
    return (LabelledBox(0, x0, y0, x1, y1, crowd=float(row["visible_fraction"]) < LEAST_VISIBLE),)


def _clip(name: str, clip: Path, boxes: Sequence[tuple[LabelledBox, ...]]) -> PictureSet:
    frames = [frame.image for frame in open_source(clip) if isinstance(frame, Frame)]
    if len(frames) != len(boxes):
        raise InputError(f"has {len(frames)} frames, its table {len(boxes)} rows", file=clip)
    truth = [LabelledImage(Path(f"{clip.stem}-{i:03d}"), *SIZE, each) for i, each in enumerate(boxes)]
    return PictureSet(name, truth, frames.__getitem__, clip=True)


def _rows(table: Path) -> list[dict[str, str]]:
    with table.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _boxes(row: dict[str, str]) -> tuple[LabelledBox, ...]:
    # there a pixel's centre lies at +0.5
    x0, y0, x1, y1 = (float(row[name]) - 0.5 for name in ("x_min", "y_min", "x_max", "y_max"))
    return (LabelledBox(0, x0, y0, x1, y1),)


def made_set(name: str, domain: Domain, seed: int, indices: Sequence[int]) -> PictureSet:
    """Return some of the pictures of a domain and a seed, made in memory."""
    truth, files = [], []
    for index in indices:
        sample = make_sample(domain, PAD, SIZE, seed, index)
        box = sample.truth.box_px
        boxes = () if box is None else (LabelledBox(0, *box.tolist()),)
        truth.append(LabelledImage(Path(f"{index:06d}"), *SIZE, boxes))
        files.append(sample.jpeg)
    return PictureSet(name, truth, lambda i: _decoded(files[i]))


def _decoded(jpeg: bytes) -> Image:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def _read(path: Path) -> Image:
    try:
        return read_picture(path).image
    except PictureError as error:
        raise InputError(str(error), file=path) from error
