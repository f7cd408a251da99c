"""What an ONNX file says about itself in its metadata: texts that are Python literals, as Ultralytics writes them."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from landtool.errors import InputError

Preprocess = Literal["letterbox", "stretch"]
Anchors = tuple[tuple[tuple[float, float], ...], ...]
_LONGEST = 1_000_000  # characters of a value: the names of thousands of classes fit in


@dataclass(frozen=True)
class ModelMetadata:
    """The entries landtool understands; None where the model says nothing.

    names: of the classes, in their order. imgsz: width and height of the input, pixels. end2end: the network gives
    final boxes. anchors: width and height in input pixels, for each raw output head. test_input, test_output: the
    test vector, see landtool.detect.vector.
    """

    names: tuple[str, ...] | None = None
    imgsz: tuple[int, int] | None = None
    stride: int | None = None
    end2end: bool = False
    preprocess: Preprocess | None = None
    layout: str | None = None
    anchors: Anchors | None = None
    cfg_sha256: str | None = None
    test_input: dict[str, Any] | None = None
    test_output: dict[str, Any] | None = None


def parse_metadata(props: Mapping[str, str], file: Path | None = None) -> ModelMetadata:
    """Return the metadata in `props`. Raises InputError for a value that is no literal of its kind, or another task."""
    reader = _Reader(props, file)
    task = props.get("task", "detect")
    if task != "detect":
        raise InputError(f"is a network for '{task[:40]}'", file=file, hint="give one that was made to detect boxes")
    arguments = reader.literal("args", dict)
    return ModelMetadata(
        names=reader.names(),
        imgsz=reader.imgsz(),
        stride=reader.positive("stride"),
        end2end=bool(reader.literal("end2end", bool)) or (arguments or {}).get("nms") is True,
        preprocess=reader.preprocess(),
        layout=props.get("landtool.layout"),
        anchors=reader.anchors(),
        cfg_sha256=props.get("landtool.cfg_sha256"),
        test_input=reader.literal("landtool.test_input", dict),
        test_output=reader.literal("landtool.test_output", dict),
    )


@dataclass(frozen=True)
class _Reader:
    props: Mapping[str, str]
    file: Path | None

    def literal(self, key: str, *kinds: type) -> Any:
        """Return the literal under `key`, None where there is none."""
        text = self.props.get(key)
        if text is None:
            return None
        try:
            value = ast.literal_eval(text) if len(text) <= _LONGEST else None
        # deep nesting exhausts the parser's stack or memory
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            value = None
        if not isinstance(value, kinds):
            raise self.refused(key)
        return value

    def refused(self, key: str) -> InputError:
        text = self.props[key]
        shown = text if len(text) <= 60 else f"{text[:57]}..."
        return InputError(f"metadata '{key}' cannot be used: {shown!r}", file=self.file, hint="export the model again")

    def names(self) -> tuple[str, ...] | None:
        value = self.literal("names", dict, list, tuple)
        if value is None:
            return None
        if isinstance(value, dict):
            if sorted(value, key=str) != sorted(range(len(value)), key=str):
                raise self.refused("names")
            value = [value[i] for i in range(len(value))]
        if not value or not all(isinstance(name, str) for name in value):
            raise self.refused("names")
        return tuple(value)

    def imgsz(self) -> tuple[int, int] | None:
        value = self.literal("imgsz", list, tuple, int)
        if value is None:
            return None
        height_width = (value, value) if isinstance(value, int) else tuple(value)
        if len(height_width) != 2 or not all(type(side) is int and 0 < side <= 2**16 for side in height_width):
            raise self.refused("imgsz")
        return height_width[1], height_width[0]

    def positive(self, key: str) -> int | None:
        value = self.literal(key, int, float)
        if value is None:
            return None
        if not 1 <= value <= 1024 or value != int(value):
            raise self.refused(key)
        return int(value)

    def preprocess(self) -> Preprocess | None:
        said = self.props.get("landtool.preprocess")
        for known in get_args(Preprocess):
            if said == known:
                return known  # type: ignore[no-any-return]
        if said is not None:
            raise self.refused("landtool.preprocess")
        return None

    def anchors(self) -> Anchors | None:
        key = "landtool.anchors"
        value = self.literal(key, list, tuple)
        if value is None:
            return None
        try:
            heads = tuple(tuple((float(w), float(h)) for w, h in head) for head in value)
        except (TypeError, ValueError):
            raise self.refused(key) from None
        if not all(0.0 < side < 1e6 for head in heads for pair in head for side in pair):
            raise self.refused(key)
        return heads
