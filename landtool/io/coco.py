"""Labelled pictures as COCO json, written a piece at a time and read; boxes in pixels, OpenCV's convention.

COCO counts from the picture's top-left corner, where OpenCV has (-0.5, -0.5).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from landtool.errors import InputError, UsageError
from landtool.io.labels import LabelledBox, LabelledImage

_HINT = "give a COCO json with images, annotations and categories"


@dataclass(frozen=True)
class CocoDataset:
    """A COCO json as read. names: of the classes, by `LabelledBox.class_id`, in the order of the categories' ids."""

    file: Path
    names: tuple[str, ...]
    images: tuple[LabelledImage, ...]


def write_coco(path: Path, names: Sequence[str], images: Callable[[], Iterable[LabelledImage]]) -> None:
    """Write COCO json; ids count from 1. `images` is called twice, so that none has to be kept in memory.

    A picture's file_name is its path as it is given.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        categories = [{"id": i, "name": name, "supercategory": ""} for i, name in enumerate(names, start=1)]
        file.write(f'{{\n"categories": {json.dumps(categories)},\n"images": [')
        _write_list(file.write, (_image(i, image) for i, image in enumerate(images(), start=1)))
        file.write('],\n"annotations": [')
        _write_list(file.write, _annotations(images()))
        file.write("]\n}\n")


def read_coco(path: Path, folder: Path | None = None) -> CocoDataset:
    """Read COCO json; pictures lie in `folder`.

    By default it is the first that holds any of them: that of the json, the one above it, and in each `images`,
    `images/<split>` and `<split>`, the split being the json's name or the last part of it, as of instances_val.json;
    that of the json when none of them is anywhere.

    Raises UsageError when it cannot be opened, InputError naming the file and the line or entry that is wrong.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path, hint=_HINT) from error
    except json.JSONDecodeError as error:
        raise InputError(f"line {error.lineno}: no valid JSON ({error.msg})", file=path, hint=_HINT) from error
    except (UnicodeDecodeError, RecursionError) as error:
        raise InputError("no valid JSON", file=path, hint=_HINT) from error
    try:
        return _dataset(path, data, folder)
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint or _HINT) from error


def _write_list(write: Callable[[str], object], items: Iterable[Mapping[str, Any]]) -> None:
    for i, item in enumerate(items):
        write(f"{',' if i else ''}\n{json.dumps(item, ensure_ascii=False)}")
    write("\n")


def _image(image_id: int, image: LabelledImage) -> dict[str, Any]:
    name = image.path.as_posix()
    return {"id": image_id, "file_name": name, "width": image.width, "height": image.height}


def _annotations(images: Iterable[LabelledImage]) -> Iterator[dict[str, Any]]:
    number = 0
    for image_id, image in enumerate(images, start=1):
        for box in image.boxes:
            number += 1
            w, h = box.x_max_px - box.x_min_px, box.y_max_px - box.y_min_px
            yield {
                "id": number,
                "image_id": image_id,
                "category_id": box.class_id + 1,
                "bbox": [round(v, 4) for v in (box.x_min_px + 0.5, box.y_min_px + 0.5, w, h)],
                "area": round(w * h, 4),
                "iscrowd": int(box.crowd),
            }


def _dataset(path: Path, data: Any, folder: Path | None) -> CocoDataset:
    if not isinstance(data, Mapping):
        raise InputError("is no COCO dataset but a list" if isinstance(data, list) else "is no COCO dataset")
    categories = dict(sorted(_by_id(data, "categories").items()))
    class_of = {key: i for i, key in enumerate(categories)}
    images = _by_id(data, "images")
    boxes: dict[int, list[LabelledBox]] = {key: [] for key in images}
    for key, (where, item) in _by_id(data, "annotations").items():
        image_id, category_id = _int(item, "image_id", where), _int(item, "category_id", where)
        if image_id not in boxes:
            raise InputError(f"{where} (id {key}): there is no image {image_id}")
        if category_id not in class_of:
            raise InputError(f"{where} (id {key}): there is no category {category_id}")
        boxes[image_id].append(_box(item, class_of[category_id], where))
    names = tuple(_text(item, "name", where) for where, item in categories.values())
    if folder is None:
        folder = _picture_folder(path, [_text(item, "file_name", where) for where, item in images.values()])
    labelled = tuple(_labelled(folder, where, item, boxes[key]) for key, (where, item) in images.items())
    return CocoDataset(path, names, labelled)


def _picture_folder(path: Path, files: Sequence[str]) -> Path:
    """Return where the pictures of a json lie, as `read_coco` has it."""
    splits = dict.fromkeys((path.stem, path.stem.rpartition("_")[2]))
    inside = ["", "images", *(f"images/{split}" for split in splits), *splits]
    folders = [base / name for base in (path.parent, path.parent.parent) for name in inside]
    return next((folder for file in files for folder in folders if (folder / file).is_file()), path.parent)


def _by_id(data: Mapping[str, Any], name: str) -> dict[int, tuple[str, Mapping[str, Any]]]:
    """Return the entries of a list by their ids, each with its place, such as `images[3]`."""
    items = data.get(name)
    if not isinstance(items, list):
        raise InputError(f"has no list '{name}'")
    found: dict[int, tuple[str, Mapping[str, Any]]] = {}
    for i, item in enumerate(items):
        where = f"{name}[{i}]"
        if not isinstance(item, Mapping):
            raise InputError(f"{where} is no object")
        key = _int(item, "id", where)
        if key in found:
            raise InputError(f"{where}: id {key} is that of {found[key][0]} already")
        found[key] = where, item
    return found


def _labelled(folder: Path, where: str, item: Mapping[str, Any], boxes: list[LabelledBox]) -> LabelledImage:
    width, height = _int(item, "width", where), _int(item, "height", where)
    if width < 1 or height < 1:
        raise InputError(f"{where}: its size is {width}x{height}")
    return LabelledImage(folder / _text(item, "file_name", where), width, height, tuple(boxes))


def _box(item: Mapping[str, Any], class_id: int, where: str) -> LabelledBox:
    bbox = item.get("bbox")
    if not isinstance(bbox, list) or len(bbox) != 4 or not all(_is_number(v) for v in bbox):
        raise InputError(f"{where}: bbox is not x, y, width, height")
    x, y, w, h = map(float, bbox)
    if w < 0.0 or h < 0.0:
        raise InputError(f"{where}: bbox has a negative size")
    return LabelledBox(class_id, x - 0.5, y - 0.5, x + w - 0.5, y + h - 0.5, bool(item.get("iscrowd", 0)))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _int(item: Mapping[str, Any], key: str, where: str) -> int:
    value = item.get(key)
    if type(value) is not int:
        raise InputError(f"{where}: {key} is no whole number")
    return value


def _text(item: Mapping[str, Any], key: str, where: str) -> str:
    value = item.get(key)
    if not isinstance(value, str) or not value:
        raise InputError(f"{where} has no {key}")
    return value
