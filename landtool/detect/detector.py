"""Finds objects in pictures with a network stored as ONNX."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landtool.detect.config import BOUNDS, DetectorConfig
from landtool.detect.layouts import Layout, choose_layout, input_spec, read_boxes, told_layout
from landtool.detect.model_file import read_model
from landtool.detect.nms import suppress
from landtool.detect.preprocess import InputSpec, Placement, Preprocessor
from landtool.detect.search import Region
from landtool.detect.session import Outputs, Session
from landtool.detect.vector import check_test_vector, replay, vector_size
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.geometry import Array
from landtool.types import Detection, Image

__all__ = ["BOUNDS", "SHIPPED_MODEL", "Detector", "DetectorConfig"]

SHIPPED_MODEL = "pad-tiny-yolov3.onnx"
_USUAL_STRIDE = 32  # of every family in the table of layouts; larger networks say theirs in their metadata


class Detector:
    """One network, loaded, checked and ready. Not to be shared between threads: it reuses its input arrays.

    names: of the classes; numbers where the model names none. imgsz: width and height of its input, pixels.
    layout: the name of the one its output is read by.
    Raises UsageError for a size, a layout or a path that must change, InputError for a model that cannot be used.
    """

    def __init__(self, config: DetectorConfig | None = None) -> None:
        self.config = config or DetectorConfig()
        self._session = Session(read_model(_model_path(self.config.model)), threads=self.config.threads or 1)
        self._stride = self._session.model.metadata.stride or _USUAL_STRIDE
        with self._named():
            self.imgsz = self._input_size()
            self._layout = self._checked_layout()
        self.layout = self._layout.name
        spec = input_spec(self._layout, self._session.model.metadata)
        self._preprocessor = Preprocessor(spec, self._session.dtype)

    @property
    def names(self) -> tuple[str, ...] | None:
        """The names of the classes, in order; None where the model has none and labels are numbers."""
        return self._session.model.metadata.names

    def detect(self, image: Image) -> tuple[Detection, ...]:
        """Return what is in a picture (H, W, 3) BGR uint8, best first. Raises InputError for output that is none."""
        return self._look(image, self.imgsz, 0, 0)

    def detect_region(self, image: Image, region: Region) -> tuple[Detection, ...]:
        """Return what is in a part of a picture (H, W, 3) BGR uint8, in pixels of the whole picture, best first.

        A network of free input size looks at the region at the picture's own scale, or smaller if the region
        exceeds `imgsz`; the region grows to whole strides. One of fixed size looks at it scaled to its input.
        A box that reaches beyond the region ends at its rim.
        """
        height, width = image.shape[:2]
        x0, y0, x1, y1 = max(region.x0, 0), max(region.y0, 0), min(region.x1, width), min(region.y1, height)
        if x0 >= x1 or y0 >= y1:
            return ()
        size = self.imgsz
        if self._session.fixed_size is None:
            size, scale = self._region_size(x1 - x0, y1 - y0)
            x0, x1 = _grown(x0, x1, int(size[0] / scale), width)
            y0, y1 = _grown(y0, y1, int(size[1] / scale), height)
        return self._look(image[y0:y1, x0:x1], size, x0, y0)

    def _look(self, image: Image, size: tuple[int, int], x0: int, y0: int) -> tuple[Detection, ...]:
        if image.ndim != 3 or image.shape[2] != 3 or image.size == 0 or image.dtype != np.uint8:
            raise InputError(f"a picture of shape {image.shape} and type {image.dtype} is no BGR picture")
        tensor, placement = self._preprocessor.prepare(image, size)
        with self._named():
            return self._detections(self._session.run(tensor), placement, np.array([x0, y0, x0, y0]))

    def _detections(self, outputs: Outputs, placement: Placement, origin: Array) -> tuple[Detection, ...]:
        boxes, scores = read_boxes(self._layout, outputs)
        best = scores[:, 0] if scores.shape[1] == 1 else scores.max(axis=1)
        good = np.flatnonzero(best >= self.config.conf)
        if good.size == 0:
            return ()
        classes: NDArray[np.int64] = scores[good].argmax(axis=1)
        best = np.clip(best[good], 0.0, 1.0)
        in_input = boxes[good].astype(np.float64)
        iou = 1.0 if self._layout.suppressed else self.config.iou
        kept = suppress(in_input, best, classes, iou=iou, most=self.config.max_boxes)
        in_picture = placement.to_picture(in_input[kept]) + origin
        # what lies in the padding only has nothing left
        there = (in_picture[:, 2] > in_picture[:, 0]) & (in_picture[:, 3] > in_picture[:, 1])
        return tuple(
            Detection(self._label(int(kind)), float(score), *map(float, box))
            for kind, score, box in zip(classes[kept][there], best[kept][there], in_picture[there], strict=True)
        )

    def _label(self, kind: int) -> str:
        if self.names is None:
            return str(kind)
        if kind >= len(self.names):
            reason = f"it found class {kind}, but its metadata names {len(self.names)} only"
            raise InputError(reason, hint="export it again with the right names")
        return self.names[kind]

    def _input_size(self) -> tuple[int, int]:
        """Return the width and height of the input: its own, the wanted one, or the metadata's."""
        fixed, wanted = self._session.fixed_size, self.config.imgsz
        if fixed is not None:
            if wanted not in (None, fixed):
                raise UsageError(f"its input is always {fixed[0]}x{fixed[1]} pixels", hint="leave --imgsz out")
            return fixed
        size = wanted or self._session.model.metadata.imgsz
        if size is None:
            raise UsageError("its input has no size of its own", hint="give one with --imgsz, for example 640x640")
        if any(side % self._stride for side in size):
            hint = f"give {' x '.join(str(_up(side, self._stride)) for side in size)} or others of its multiples"
            raise UsageError(f"an input of {size[0]}x{size[1]} is no multiple of its stride {self._stride}", hint=hint)
        return size

    def _checked_layout(self) -> Layout:
        """Return the layout, after a first run that shows what the network gives, and whether it is what it was."""
        size = vector_size(self._session)
        told = told_layout(self._session.model.metadata, None if size is not None else self.config.layout)
        spec = InputSpec() if told is None else input_spec(told, self._session.model.metadata)
        outputs = replay(self._session, spec, size or self.imgsz)
        layout = choose_layout(outputs, self._session.model.metadata, self.config.layout)
        check_test_vector(self._session, None if told is None else outputs)
        read_boxes(layout, outputs)
        return layout

    def _region_size(self, width: int, height: int) -> tuple[tuple[int, int], float]:
        """Return the input's size for a region of width x height pixels, and its scale, input over picture."""
        scale = min(1.0, self.imgsz[0] / width, self.imgsz[1] / height)
        # rounded down at first: 640 pixels at 640 / 640 must not take another stride
        sides = (_up(math.floor(width * scale), self._stride), _up(math.floor(height * scale), self._stride))
        return (min(sides[0], self.imgsz[0]), min(sides[1], self.imgsz[1])), scale

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Name the model's file in errors that don't."""
        try:
            yield
        except LandtoolError as error:
            if error.file is not None:
                raise
            raise type(error)(error.reason, file=self._session.model.file, hint=error.hint) from error


def _model_path(path: Path | None) -> Path:
    if path is not None:
        return path
    shipped = Path(str(resources.files("landtool"))) / "models" / SHIPPED_MODEL
    if not shipped.is_file():
        raise UsageError("the network of the package is missing", file=shipped, hint="give one with --model")
    return shipped


def _grown(low: int, high: int, length: int, limit: int) -> tuple[int, int]:
    """Return a span of `length` around low to high, within 0 to limit, or all of that where it is shorter."""
    length = max(min(length, limit), high - low)
    start = min(max((low + high - length) // 2, 0), limit - length)
    return start, start + length


def _up(side: int, stride: int) -> int:
    return max(-(-side // stride), 1) * stride
