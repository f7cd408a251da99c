"""One picture of a data set, small, with what its label files say drawn on it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike

from landtool.errors import InputError
from landtool.geometry import Array
from landtool.io.images import PictureError, read_picture
from landtool.io.labels import LabelledImage, read_yolo
from landtool.strokes import DARK, SKY, VERMILLION, YELLOW, Pen
from landtool.synth.preview.facts import AGAIN
from landtool.synth.preview.sheet import fitted
from landtool.types import Image

_APART_PX = 2.0  # the box is drawn this far outside, so that it covers nothing of a small pad
_SEEN_TAG_PX = 6.0  # side of the smallest tag that is not merely covered by its outline


def read_labels(dataset: Path, files: Iterable[str]) -> dict[str, LabelledImage]:
    """Return what the label files of a data set say, by the names that truth.csv has.

    Raises UsageError and InputError as `read_yolo`, and InputError for a picture that is in no split.
    """
    yolo = read_yolo(dataset / "data.yaml")
    by_path = {image.path: image for split in yolo.splits for image in yolo.read(split)}
    missing = [file for file in files if dataset / file not in by_path]
    if missing:
        raise InputError("is in truth.csv, but in no split", file=dataset / missing[0], hint=AGAIN)
    return {file: by_path[dataset / file] for file in files}


def labelled(image: LabelledImage, tag_corners_px: Array, width: int, height: int) -> Image:
    """Return a picture inside width x height pixels, with its labels and the name of its file.

    Yellow: its boxes. Blue: the tag (4, 2), which may be NaN, its first corner red.
    Raises InputError for a picture that cannot be decoded.
    """
    try:
        whole = read_picture(image.path).image
    except PictureError as error:
        raise InputError(str(error), file=image.path, hint=AGAIN) from error
    drawn, scale = fitted(whole, width, height)
    pen = Pen(drawn.shape[1], drawn.shape[0], 1, 11, cv2.FontFace("sans"))
    far = np.array([drawn.shape[1], drawn.shape[0]]) - 1.0
    for box in image.boxes:
        low = _scaled([box.x_min_px, box.y_min_px], scale) - _APART_PX
        high = _scaled([box.x_max_px, box.y_max_px], scale) + _APART_PX
        low, high = np.maximum(low, 0.0), np.minimum(high, far)
        pen.line(drawn, np.array([low, [high[0], low[1]], high, [low[0], high[1]]]), YELLOW, closed=True)
    _tag(drawn, pen, _scaled(tag_corners_px, scale))
    pen.label(drawn, image.path.stem, 0, 0, DARK)
    return drawn


def _scaled(points_px: ArrayLike, scale: float) -> Array:
    """Scale points about the picture's corner at (-0.5, -0.5)."""
    scaled: Array = (np.asarray(points_px, dtype=np.float64) + 0.5) * scale - 0.5
    return scaled


def _tag(image: Image, pen: Pen, corners_px: Array) -> None:
    """Outline the tag; its first corner tells how it lies."""
    if not np.isfinite(corners_px).all():
        return
    side = np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1).min()
    if side >= _SEEN_TAG_PX:
        pen.line(image, corners_px, SKY, closed=True)
        pen.disc(image, corners_px[0], 1.5, VERMILLION)
