"""Photographs to lay under the pad: those of a folder, or those that scikit-image brings along."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from pathlib import Path

from landtool.errors import InputError, UsageError
from landtool.io.images import SUFFIXES, PictureError, natural_key, read_picture
from landtool.io.local import local_path
from landtool.io.run_record import HashedFile

SCIKIT_IMAGE = "scikit-image"
_SMALLEST_PX = 64
# Its photographs in colour or of surfaces; the rest is masks, drawings and text
_SCIKIT_IMAGE_FILES = (
    "astronaut.png",
    "brick.png",
    "chelsea.png",
    "coffee.png",
    "coins.png",
    "grass.png",
    "gravel.png",
    "motorcycle_left.png",
    "rocket.jpg",
)


def find_backgrounds(places: Sequence[str]) -> tuple[HashedFile, ...]:
    """Return the photographs of all places, each a folder with its subfolders or `scikit-image`; all are decoded once.

    Raises UsageError for a place that is not there, InputError for a folder without images or with a broken one.
    """
    found: dict[Path, HashedFile] = {}
    for place in places:
        for path in _of_scikit_image() if place == SCIKIT_IMAGE else _of_folder(place):
            _refuse_useless(path)
            found[path] = HashedFile.of(path)
    return tuple(found.values())


def _of_folder(place: str) -> list[Path]:
    folder = local_path(place)
    if not folder.is_dir():
        raise UsageError("is no folder", file=place, hint=f"give a folder of photographs, or {SCIKIT_IMAGE}")
    files = [path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()]
    visible = [path for path in files if not any(part.startswith(".") for part in path.relative_to(folder).parts)]
    if not visible:
        raise InputError("holds no photographs", file=place, hint=f"known are {', '.join(SUFFIXES)}")
    return sorted(visible, key=lambda path: natural_key(path.relative_to(folder).as_posix()))


def _of_scikit_image() -> list[Path]:
    found = importlib.util.find_spec("skimage")  # its files are enough: not imported
    if found is None or found.origin is None:
        hint = "python -m pip install scikit-image, or give a folder of photographs"
        raise UsageError("scikit-image is not installed", hint=hint)
    folder = Path(found.origin).parent / "data"
    files = [folder / name for name in _SCIKIT_IMAGE_FILES if (folder / name).is_file()]
    if not files:
        raise InputError("holds none of scikit-image's photographs", file=folder, hint="install scikit-image again")
    return files


def _refuse_useless(path: Path) -> None:
    try:
        picture = read_picture(path)
    except PictureError as error:
        raise InputError(str(error), file=path, hint="remove it from the folder of backgrounds") from error
    height, width = picture.image.shape[:2]
    if picture.damage:
        raise InputError(picture.damage, file=path, hint="remove it from the folder of backgrounds")
    if min(height, width) < _SMALLEST_PX:
        reason = f"is {width}x{height} pixels, too small for a background"
        raise InputError(reason, file=path, hint=f"remove it; {_SMALLEST_PX} pixels a side are needed")
