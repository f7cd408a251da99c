"""A YOLO dataset without a data.yaml: the folders images and labels side by side."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from landtool.errors import InputError, UsageError
from landtool.io.labels import SPLITS, YoloDataset, label_path, label_rows, pictures_in

CLASSES_FILE = "classes.txt"
_MOST_CLASSES = 10_000  # without a list of names; beyond, a label file is broken rather than its dataset large


def is_yolo_folder(folder: Path) -> bool:
    """Return whether a folder holds the folders images and labels."""
    return (folder / "images").is_dir() and (folder / "labels").is_dir()


def read_yolo_folder(folder: Path) -> YoloDataset:
    """Find the pictures of a folder and name its classes; `file` of the dataset is the folder.

    Names are the lines of classes.txt, in the folder or in labels; without one the class ids, but a single class 0 is
    `pad`. Splits are the folders train, val and test in images; without them everything is test. Notes say so.
    Raises UsageError for a folder without images and labels, InputError naming file and line for a broken one.
    """
    if not is_yolo_folder(folder):
        raise UsageError("has no folders images and labels", file=folder, hint="give the folder of a YOLO dataset")
    images = folder / "images"
    splits = {split: tuple(pictures_in(images / split)) for split in SPLITS if (images / split).is_dir()}
    notes = []
    if not splits:
        splits = {"test": tuple(pictures_in(images))}
        notes.append("it is not split: all its pictures count as test")
    elif left := len(pictures_in(images)) - sum(map(len, splits.values())):
        notes.append(f"pictures outside of {', '.join(splits)} are left out: {left}")
    given = [file for file in (folder / CLASSES_FILE, folder / "labels" / CLASSES_FILE) if file.is_file()]
    if given:
        names = _listed(given[0])
    else:
        names = _counted(path for pictures in splits.values() for path in pictures)
        notes.append(f"there is no {CLASSES_FILE}: {_said(names)}")
    return YoloDataset(folder, names, splits, notes=tuple(notes))


def _listed(file: Path) -> tuple[str, ...]:
    try:
        lines = [line.strip() for line in file.read_text(encoding="utf-8-sig").splitlines()]
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=file) from error
    except UnicodeDecodeError as error:
        raise InputError("is no UTF-8 text", file=file, hint="give one class a line") from error
    while lines and not lines[-1]:
        lines.pop()
    if not lines:
        raise InputError("is empty", file=file, hint="give one class a line, or remove it")
    for number, name in enumerate(lines, start=1):
        if not name or name in lines[: number - 1]:
            reason = f"line {number}: {f'{name} is named twice' if name else 'is empty'}"
            raise InputError(reason, file=file, hint="give one class a line")
    return tuple(lines)


def _counted(pictures: Iterable[Path]) -> tuple[str, ...]:
    """Return a name for every class up to the largest that is labelled."""
    classes = (class_id for picture in pictures for class_id, _ in label_rows(label_path(picture), _MOST_CLASSES))
    largest = max(classes, default=0)
    return ("pad",) if largest == 0 else tuple(map(str, range(largest + 1)))


def _said(names: tuple[str, ...]) -> str:
    if names == ("pad",):
        return "its class 0 is 'pad'"
    # a network's 'pad' is none of these, so that it finds nothing
    return f"its classes are named 0 to {len(names) - 1}; add {CLASSES_FILE}, a name a line, for what they are"
