"""Finds what a folder holds to evaluate with: labelled pictures, recordings with truth, hazy ones and clear twins."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from landtool.errors import InputError, UsageError
from landtool.evaluate.dehazing import FogPair, find_pairs
from landtool.io.coco import read_coco
from landtool.io.images import RECORDING_SUFFIXES, SUFFIXES
from landtool.io.labels import LabelledImage, YoloDataset, pictures_in, read_yolo
from landtool.io.local import local_path
from landtool.io.run_record import sha256_of
from landtool.io.yolo_folder import is_yolo_folder, read_yolo_folder

Split = Literal["auto", "test", "val", "train", "all"]
SPLITS: tuple[Split, ...] = get_args(Split)
TRUTH_END = ".truth.csv"
DATA_FILE = "data.yaml"
_OWN_OUTPUTS = ("run.json", "metrics.json")  # in a folder that landtool wrote: what was made of data is none
_PREFERRED = ("test", "val", "train")  # the first that holds pictures: a network is not to be judged by what it learnt
_HINT = "give a folder of `landtool generate`, a YOLO or COCO dataset, or recordings with their .truth.csv beside them"


@dataclass(frozen=True)
class Stills:
    """Labelled pictures. names: of the classes by their ids. truth, pad: of a generated dataset, else None."""

    name: str
    folder: Path
    names: tuple[str, ...]
    images: tuple[LabelledImage, ...]
    truth: Path | None
    pad: Path | None


@dataclass(frozen=True)
class Clip:
    """A recording with its truth, and what lies beside it: calibration, pad, the drone's own poses, or None."""

    name: str
    path: Path
    truth: Path
    camera: Path | None
    pad: Path | None
    ego: Path | None


@dataclass(frozen=True)
class FogPairs:
    """Pictures in haze, each with the same view in clear air."""

    name: str
    folder: Path
    pairs: tuple[FogPair, ...]


Part = Stills | Clip | FogPairs


@dataclass(frozen=True)
class EvalDataset:
    """Everything found, in the order of the names. notes: what was left out and why, a sentence each."""

    path: Path
    parts: tuple[Part, ...]
    notes: tuple[str, ...]

    @property
    def stills(self) -> tuple[Stills, ...]:
        """The sets of labelled pictures."""
        return tuple(part for part in self.parts if isinstance(part, Stills))

    @property
    def clips(self) -> tuple[Clip, ...]:
        """The recordings with truth."""
        return tuple(part for part in self.parts if isinstance(part, Clip))

    @property
    def fog_pairs(self) -> tuple[FogPairs, ...]:
        """The pictures with and without haze."""
        return tuple(part for part in self.parts if isinstance(part, FogPairs))

    @property
    def digest(self) -> str:
        """SHA-256 over the names and the contents of all files that a score depends on."""
        digest = hashlib.sha256()
        root = self.path if self.path.is_dir() else self.path.parent
        for file in sorted({file.resolve() for part in self.parts for file in _files(part)}):
            name = file.relative_to(root.resolve()).as_posix() if file.is_relative_to(root.resolve()) else file.name
            digest.update(name.encode("utf-8", "surrogateescape") + b"\0" + sha256_of(file).encode() + b"\n")
        for part in self.stills:  # labels by what they say: YOLO and COCO files of the same boxes are the same truth
            said = (part.names, [(image.path.name, image.boxes) for image in part.images])
            digest.update(repr(said).encode("utf-8", "surrogateescape"))
        return digest.hexdigest()


def open_dataset(path: Path, split: Split = "auto") -> EvalDataset:
    """Find what a folder, a data.yaml, a COCO json or a single recording holds. An empty folder gives no parts.

    split: of labelled pictures; auto takes the first of test, val and train that holds any.
    Raises UsageError for what is not there or no dataset, InputError as the readers of its files do.
    """
    notes: list[str] = []
    if local_path(path).is_dir():
        parts = _in_folder(path, path, split, notes, (path.resolve(),))
        return EvalDataset(path, tuple(sorted(parts, key=lambda part: part.name)), tuple(notes))
    if path.suffix in (".yaml", ".yml"):
        found: list[Part] = list(_yolo(path.absolute().parent.name, _read_yolo(path), split, notes))
    elif path.suffix == ".json":
        found = list(_coco(path.stem, path.parent, path, notes))
    else:
        found = [_single(path, notes)]
    return EvalDataset(path, tuple(found), tuple(notes))


def _single(recording: Path, notes: list[str]) -> Clip:
    """Return a recording as a part. Raises UsageError for one without truth, and for something else."""
    if recording.name.endswith(TRUTH_END):
        raise UsageError("is a truth", file=recording, hint="give the recording it is about, or the folder of both")
    found = list(_clips(recording.parent, recording.parent, notes, only=recording))
    if not found and recording.suffix.lower() not in RECORDING_SUFFIXES:
        raise UsageError("is no recording, data.yaml or COCO json", file=recording, hint=_HINT)
    if not found:
        truth = f"{recording.stem}{TRUTH_END}"
        raise UsageError(f"has no truth beside it ({truth})", file=recording, hint=_HINT)
    return found[0]


def _in_folder(folder: Path, root: Path, split: Split, notes: list[str], above: tuple[Path, ...]) -> Iterator[Part]:
    """Yield what is in a folder and below it; above: the folder and those it lies in, links followed."""
    name = _name(folder, root)
    stills = list(_stills(folder, name, split, notes))
    pairs = find_pairs(folder)
    yield from stills
    if pairs:
        yield FogPairs(f"{name} in fog" if stills else name, folder, pairs)
    yield from _clips(folder, root, notes)
    if not stills and not pairs:
        for inner in sorted(entry for entry in folder.iterdir() if entry.is_dir()):
            place = inner.resolve()
            own = any((inner / name).is_file() for name in _OWN_OUTPUTS)
            if not inner.name.startswith(".") and not own and place not in above:  # a link may lead back up
                yield from _in_folder(inner, root, split, notes, (*above, place))


def _stills(folder: Path, name: str, split: Split, notes: list[str]) -> Iterator[Stills]:
    """Yield the labelled pictures of a folder; where they are there as YOLO and as COCO, once."""
    if (folder / DATA_FILE).is_file():
        yield from _yolo(name, _read_yolo(folder / DATA_FILE), split, notes)
    elif is_yolo_folder(folder):
        yield from _yolo(name, read_yolo_folder(folder), split, notes)
    elif (folder / "annotations").is_dir():
        files = sorted((folder / "annotations").glob("*.json"))
        splits = {_split_of(file.stem): file for file in files}
        if len(splits) == len(files) and set(splits) <= set(_PREFERRED):
            files = [splits[given] for given in _chosen(name, list(splits), split, notes)]
        elif split not in ("auto", "all"):
            notes.append(f"{name}: which split its files are is not known, all are taken")
        for file in files:
            yield from _coco(f"{name}/{file.stem}", folder, file, notes)
    elif pictures_in(folder / "images") and not (folder / f"images{TRUTH_END}").is_file():
        notes.append(f"{name}: left out, images has no labels beside it (the folder labels, or a data.yaml)")


def _yolo(name: str, dataset: YoloDataset, split: Split, notes: list[str]) -> Iterator[Stills]:
    filled = [given for given in dataset.splits if dataset.splits[given]]
    chosen = _chosen(name, filled, split, notes)
    notes += [f"{name}: {note}" for note in dataset.notes]
    folder = dataset.file if dataset.file.is_dir() else dataset.file.parent
    images = tuple(image for given in chosen for image in dataset.read(given))
    beside = _if_there(folder / "truth.csv"), _if_there(folder / "pad.toml")
    yield from _filled(Stills(name, folder, dataset.names, images, *beside), notes)


def _read_yolo(file: Path) -> YoloDataset:
    return read_yolo(file, needed=())


def _coco(name: str, folder: Path, file: Path, notes: list[str]) -> Iterator[Stills]:
    coco = read_coco(file)
    if not coco.images:
        notes.append(f"{name}: holds no pictures")
    if lost := [image.path for image in coco.images if not image.path.exists()]:
        more = f", and {len(lost) - 1} more" if lost[1:] else ""
        hint = "put the json back where its pictures are, or the pictures beside it"
        raise InputError(f"names a picture that is not there: {lost[0]}{more}", file=file, hint=hint)
    yield from _filled(Stills(name, folder, coco.names, coco.images, None, None), notes)


def _split_of(stem: str) -> str:
    """Return the split that the name of a COCO json tells: instances_val2017 is val."""
    return stem.rpartition("_")[2].rstrip("0123456789")


def _chosen(name: str, filled: Sequence[str], split: Split, notes: list[str]) -> list[str]:
    """Return which of the splits that hold pictures are taken."""
    if not filled:
        notes.append(f"{name}: holds no pictures")
    if split == "all":
        return list(filled)
    if split != "auto":
        if filled and split not in filled:
            notes.append(f"{name}: has no split {split}, it has {', '.join(filled)}")
        return [given for given in filled if given == split]
    chosen = [given for given in _PREFERRED if given in filled][:1]
    left = [given for given in filled if given not in chosen]
    if left:
        notes.append(f"{name}: its split {chosen[0]} was taken; {' and '.join(left)} with --split all")
    return chosen


def _filled(part: Stills, notes: list[str]) -> Iterator[Stills]:
    """Yield labelled pictures if there are any, and say where nothing is labelled in them."""
    if part.images:
        yield part
    if part.images and not any(image.boxes for image in part.images):
        notes.append(f"{part.name}: nothing is labelled in its pictures ({len(part.images)})")


def _clips(folder: Path, root: Path, notes: list[str], only: Path | None = None) -> Iterator[Clip]:
    """Yield the recordings of a folder that have a truth; of a video and a log of one landing the video."""
    recordings = sorted(file for file in folder.iterdir() if file.suffix.lower() in RECORDING_SUFFIXES)
    for truth in sorted(folder.glob(f"*{TRUTH_END}")):
        stem = truth.name.removesuffix(TRUTH_END)
        own = [file for file in recordings if file.stem == stem] + [p for p in (folder / stem,) if _has_pictures(p)]
        own = [file for file in own if only is None or file == only]
        own.sort(key=lambda file: file.suffix.lower() == ".mcap")
        if not own:
            if only is None:
                notes.append(f"{_name(truth, root)}: no recording beside it")
            continue
        notes += [f"{_name(file, root)}: left out, {own[0].name} shows the same landing" for file in own[1:]]
        beside = (_if_there(folder / f"{stem}.{end}") for end in ("camera.yaml", "pad.toml", "ego.csv"))
        yield Clip(_name(folder / stem, root), own[0], truth, *beside)
    known = {truth.name.removesuffix(TRUTH_END) for truth in folder.glob(f"*{TRUTH_END}")}
    without = [file for file in recordings if file.stem not in known and only is None]
    notes += [f"{_name(file, root)}: left out, it has no truth beside it ({file.stem}{TRUTH_END})" for file in without]


def _has_pictures(folder: Path) -> bool:
    return folder.is_dir() and any(file.suffix.lower() in SUFFIXES for file in folder.iterdir())


def _files(part: Part) -> Iterable[Path]:
    if isinstance(part, Clip):
        given = (part.path, part.truth, part.camera, part.pad, part.ego)
        return (file for file in given if file is not None)
    if isinstance(part, FogPairs):
        return (file for pair in part.pairs for file in (pair.hazy, pair.clear))
    truth = [file for file in (part.truth, part.pad) if file is not None]
    return (*(image.path for image in part.images), *truth)


def _name(path: Path, root: Path) -> str:
    return root.resolve().name if path == root else path.relative_to(root).as_posix()


def _if_there(path: Path) -> Path | None:
    return path if path.is_file() else None
