"""What a training learns from and is judged by: a labelled folder, or pictures the generator draws as it goes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landtool.darknet.data import read_darknet_dataset
from landtool.errors import InputError, UsageError
from landtool.geometry import Array
from landtool.io.labels import YoloDataset, read_yolo
from landtool.pad import PadSpec
from landtool.synth.dataset.backgrounds import find_backgrounds
from landtool.train.generated import GeneratedSamples
from landtool.train.run_folder import fingerprint
from landtool.train.samples import FolderSamples, Samples
from landtool.train.settings import TrainSettings
from landtool.train.validate import Validator

GENERATE = "generate:"
_VALIDATION_SEED = 1_000_003  # added to the seed: pictures never trained on


@dataclass(frozen=True, eq=False)
class TrainingData:
    """names: of the classes. sizes_px: (N, 2) width and height of labelled targets, in pictures of sizes_in (N, 2).

    identity: what tells these data from others, for a training that goes on.
    """

    names: tuple[str, ...]
    samples: Samples
    validator: Validator
    sizes_px: Array
    sizes_in_px: Array
    identity: dict[str, Any]


@contextmanager
def open_data(place: str, settings: TrainSettings) -> Iterator[TrainingData]:
    """Open a data.yaml, a darknet .data file, or `generate:SEED`.

    Raises UsageError for what is not there, InputError naming the file for labels that are wrong and for empty sets.
    """
    if place.startswith(GENERATE):
        with _generated(place, settings) as data:
            yield data
        return
    path = Path(place)
    dataset = read_darknet_dataset(path) if path.suffix == ".data" else read_yolo(path)
    yield _folder(dataset, settings)


def _folder(dataset: YoloDataset, settings: TrainSettings) -> TrainingData:
    train, validation = list(dataset.read("train")), list(dataset.read("val"))
    for split, images in (("train", train), ("val", validation)):
        if not images:
            raise InputError(f"its {split} set is empty", file=dataset.file, hint="a training needs pictures of both")
        if not any(image.boxes for image in images):
            raise InputError(f"its {split} set labels no target", file=dataset.file, hint="see where its labels lie")
    chosen = [validation[i] for i in _evenly(len(validation), settings.validate_on)]
    judged = FolderSamples(chosen)
    identity = {"data": str(dataset.file), "files": fingerprint([image.path for image in (*train, *validation)])}
    sizes = [(b.x_max_px - b.x_min_px, b.y_max_px - b.y_min_px, i.width, i.height) for i in train for b in i.boxes]
    table = np.array(sizes, dtype=np.float64)
    validator = Validator(chosen, [judged.example(i) for i in range(len(chosen))], dataset.names)
    return TrainingData(dataset.names, FolderSamples(train), validator, table[:, :2], table[:, 2:], identity)


@contextmanager
def _generated(place: str, settings: TrainSettings) -> Iterator[TrainingData]:
    text = place.removeprefix(GENERATE) or str(settings.seed)
    if not text.isdecimal():
        raise UsageError(f"'{place}' names no seed", hint="write generate: or generate:7")
    photos = find_backgrounds(settings.backgrounds)
    paths = [Path(photo.path) for photo in photos]
    size = settings.size or (640, 480)
    jobs = max(1, (os.cpu_count() or 2) - 1)
    with GeneratedSamples(
        settings.domain,
        PadSpec(),
        size,
        int(text),
        paths,
        first=settings.first_pictures,
        fresh=settings.fresh_pictures,
        keep=settings.keep_pictures,
        jobs=jobs,
    ) as samples:
        labelled, judged = samples.labelled(int(text) + _VALIDATION_SEED, settings.validate_on)
        boxes = np.concatenate([example.boxes for example in judged])
        if not len(boxes):
            raise InputError("the generator draws no target", hint="see [domain] in the settings")
        identity = {
            "data": f"{GENERATE}{text}",
            "domain": asdict(settings.domain),
            "backgrounds": [photo.sha256 for photo in photos],
        }
        validator = Validator(labelled, judged, ("pad",))
        sizes = boxes[:, 2:] - boxes[:, :2]
        yield TrainingData(
            ("pad",), samples, validator, sizes, np.tile(np.array(size, float), (len(sizes), 1)), identity
        )


def _evenly(total: int, count: int) -> list[int]:
    """Return `count` indices, spread over all of them."""
    return sorted({round(i) for i in np.linspace(0, total - 1, min(total, count))})
