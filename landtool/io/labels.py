"""Labelled pictures in the YOLO layout, written and read; boxes in pixels, OpenCV's convention.

A box file is normalised over the picture's edges, so pixel x (its centre) is (x + 0.5) / W there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from PIL import Image as PilImage
from PIL import UnidentifiedImageError

from landtool.errors import InputError, UsageError
from landtool.io.images import SUFFIXES, natural_key

SPLITS = ("train", "val", "test")
_TOLERANCE = 0.01  # of the picture, by which a box may stick out of it
_HINT = "give the data.yaml of a YOLO dataset"


@dataclass(frozen=True)
class LabelledBox:
    """What is where: edges in pixels, clipped to the picture [-0.5, W - 0.5]. crowd: COCO's mark of a group."""

    class_id: int
    x_min_px: float
    y_min_px: float
    x_max_px: float
    y_max_px: float
    crowd: bool = False


@dataclass(frozen=True)
class LabelledImage:
    """A picture's file, its size in pixels, and what is in it; no boxes make it a background."""

    path: Path
    width: int
    height: int
    boxes: tuple[LabelledBox, ...]


@dataclass(frozen=True)
class YoloDataset:
    """A dataset as its data.yaml tells it.

    names: by class id. splits: the pictures of each, in natural order of their names where a folder is named.
    keypoints: numbers behind the box in a row of its labels, 0 where they have none. notes: what was taken for granted.
    """

    file: Path
    names: tuple[str, ...]
    splits: Mapping[str, tuple[Path, ...]]
    keypoints: int = 0
    notes: tuple[str, ...] = ()

    def read(self, split: str) -> Iterator[LabelledImage]:
        """Yield the pictures of a split with their boxes; a picture without a label file is a background.

        Raises UsageError for a split there is none of, InputError naming file and line for a broken label.
        """
        if split not in self.splits:
            raise UsageError(f"has no split '{split}'", file=self.file, hint=f"it has {', '.join(self.splits)}")
        for path in self.splits[split]:
            width, height = picture_size(path)
            rows = label_rows(label_path(path), len(self.names), self.keypoints)
            boxes = tuple(_in_pixels(class_id, edges, width, height) for class_id, edges in rows)
            yield LabelledImage(path, width, height, boxes)


def data_yaml(names: Sequence[str], splits: Sequence[str]) -> str:
    """Return the data.yaml of a dataset that has the folders images/<split> beside it."""
    # no `path`: without one every reader takes the file's own folder, and some take a relative one from elsewhere
    lines = [*(f"{split}: images/{split}" for split in splits), "names:"]
    return "\n".join([*lines, *(f"  {i}: {name}" for i, name in enumerate(names))]) + "\n"


def yolo_rows(boxes: Sequence[LabelledBox], width: int, height: int) -> str:
    """Return the content of a label file: `class cx cy w h` a line, empty without boxes."""
    return "".join(_yolo_row(box, width, height) for box in boxes)


def label_path(image: Path) -> Path:
    """Return where a picture's labels are: the last folder `images` of its path becomes `labels`, the ending .txt."""
    parts = list(image.parts)
    for i in range(len(parts) - 2, -1, -1):
        if parts[i] == "images":
            parts[i] = "labels"
            break
    return Path(*parts).with_suffix(".txt")


def picture_size(path: Path) -> tuple[int, int]:
    """Return width and height from a picture's header. Raises InputError when it is no picture or not there."""
    try:
        with PilImage.open(path) as picture:
            return picture.size
    except FileNotFoundError:
        raise InputError("does not exist", file=path, hint="the dataset names it") from None
    except (UnidentifiedImageError, OSError, ValueError) as error:
        raise InputError("is no image that can be read", file=path, hint="replace or remove it") from error


def pictures_in(folder: Path) -> list[Path]:
    """Return all pictures in and below a folder, in natural order of their names."""
    inside = [path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()]
    return sorted(inside, key=lambda path: natural_key(path.relative_to(folder).as_posix()))


def read_yolo(data_yaml: Path, needed: Sequence[str] = ("train", "val")) -> YoloDataset:
    """Read a YOLO data.yaml and find its pictures; labels are read by `YoloDataset.read`.

    needed: splits there must be.
    Raises UsageError when a file cannot be opened, InputError naming file and key for what is wrong in it.
    """
    try:
        return _dataset(data_yaml, _parsed(data_yaml), needed)
    except InputError as error:
        raise InputError(error.reason, file=error.file or data_yaml, hint=error.hint or _HINT) from error


def _dataset(file: Path, data: Mapping[str, Any], needed: Sequence[str]) -> YoloDataset:
    for key in (*needed, "names"):
        if data.get(key) in (None, "", [], {}):
            raise InputError(f"has no '{key}'")
    if not any(data.get(split) for split in SPLITS):
        raise InputError(f"names no pictures: it has none of {', '.join(SPLITS)}")
    names = _names(data["names"])
    if data.get("nc", len(names)) != len(names):
        raise InputError(f"nc = {data['nc']}, but the number of names is {len(names)}")
    root = file.parent / str(data.get("path") or ".")
    splits = {split: _pictures(root, data[split], split) for split in SPLITS if data.get(split)}
    return YoloDataset(file, names, splits, _keypoints(data.get("kpt_shape")))


def _parsed(file: Path) -> Mapping[str, Any]:
    try:
        data = yaml.safe_load(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=file, hint=_HINT) from error
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        raise InputError(f"is no valid YAML{f' (line {mark.line + 1})' if mark else ''}") from error
    if not isinstance(data, Mapping):
        raise InputError("is no dataset")
    return data


def _names(names: Any) -> tuple[str, ...]:
    if isinstance(names, list):
        names = dict(enumerate(names))
    if not isinstance(names, Mapping) or sorted(map(str, names)) != sorted(map(str, range(len(names)))):
        raise InputError("names must be a list, or count 0, 1, 2 ...")
    return tuple(str(name) for _, name in sorted(names.items(), key=lambda item: int(item[0])))


def _keypoints(shape: Any) -> int:
    if shape is None:
        return 0
    if isinstance(shape, list) and len(shape) == 2 and all(type(v) is int and v > 0 for v in shape):
        return int(shape[0] * shape[1])
    raise InputError("kpt_shape must be two whole numbers")


def _pictures(root: Path, place: Any, split: str) -> tuple[Path, ...]:
    """Return the pictures of a folder, of a list of files in a .txt, or of a list of those."""
    found: list[Path] = []
    for item in place if isinstance(place, list) else [place]:
        path = root / str(item)
        if path.is_dir():
            found += pictures_in(path)
        elif path.suffix == ".txt" and path.is_file():
            lines = path.read_text(encoding="utf-8-sig").splitlines()
            # relative to the list where they begin with a dot, as YOLO tools have it
            found += [(path.parent if line.startswith("./") else root) / line for line in map(str.strip, lines) if line]
        else:
            raise InputError(f"{split}: {item} does not exist", hint=f"looked in {root}")
    return tuple(found)


def label_rows(path: Path, classes: int, keypoints: int = 0) -> list[tuple[int, tuple[float, float, float, float]]]:
    """Return class and normalised edges x_min, y_min, x_max, y_max of every row; no file has no rows.

    Raises InputError naming file and line for what is no row, or of another class than the first `classes`.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from error
    except UnicodeDecodeError as error:
        raise InputError("is no UTF-8 text", file=path, hint="a label file is text") from error
    rows = []
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                rows.append(_row(line.split(), classes, keypoints))
            except InputError as error:
                raise InputError(f"line {number}: {error.reason}", file=path, hint=error.hint) from error
    return rows


def _row(cells: list[str], classes: int, keypoints: int) -> tuple[int, tuple[float, float, float, float]]:
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        raise InputError("holds something that is no number", hint="a row is: class cx cy w h") from None
    if len(values) < 5 or (keypoints and len(values) != 5 + keypoints):
        wanted = 5 + keypoints
        raise InputError(f"{len(values)} numbers where {wanted} are needed", hint="a row is: class cx cy w h")
    if not values[0].is_integer() or not 0 <= values[0] < classes:
        raise InputError(f"class {cells[0]} is none of the {classes} of the dataset", hint="they count from 0")
    polygon = len(values) > 6 and not keypoints
    edges = _edges_of_polygon(values[1:]) if polygon else _edges_of_box(*values[1:5])
    if not all(math.isfinite(v) and -_TOLERANCE <= v <= 1.0 + _TOLERANCE for v in edges):
        raise InputError("the box lies outside the picture", hint="coordinates are shares of it, 0 to 1")
    left, top, right, bottom = (min(max(v, 0.0), 1.0) for v in edges)
    return int(values[0]), (left, top, right, bottom)


def _edges_of_box(cx: float, cy: float, w: float, h: float) -> tuple[float, float, float, float]:
    if w < 0.0 or h < 0.0:
        raise InputError("width or height is negative", hint="a row is: class cx cy w h")
    return cx - w / 2.0, cy - h / 2.0, cx + w / 2.0, cy + h / 2.0


def _edges_of_polygon(values: list[float]) -> tuple[float, float, float, float]:
    if len(values) % 2:
        raise InputError("a polygon with half a point", hint="a polygon's row is: class x y x y x y ...")
    return min(values[::2]), min(values[1::2]), max(values[::2]), max(values[1::2])


def _in_pixels(class_id: int, edges: tuple[float, float, float, float], width: int, height: int) -> LabelledBox:
    x0, y0, x1, y1 = edges
    return LabelledBox(class_id, x0 * width - 0.5, y0 * height - 0.5, x1 * width - 0.5, y1 * height - 0.5)


def _yolo_row(box: LabelledBox, width: int, height: int) -> str:
    # a pixel's centre at x lies (x + 0.5) / W of the way across the picture
    cx = ((box.x_min_px + box.x_max_px) / 2.0 + 0.5) / width
    cy = ((box.y_min_px + box.y_max_px) / 2.0 + 0.5) / height
    w, h = (box.x_max_px - box.x_min_px) / width, (box.y_max_px - box.y_min_px) / height
    return f"{box.class_id} {cx:.8f} {cy:.8f} {w:.8f} {h:.8f}\n"
