"""The output layouts landtool reads, in one table, and the choice between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from landtool.detect import decode
from landtool.detect.decode import Decoded
from landtool.detect.metadata import ModelMetadata
from landtool.detect.preprocess import InputSpec
from landtool.detect.session import Outputs
from landtool.errors import InputError, UsageError

_GRIDS = ((8, 16, 32), (16, 32), (8, 16, 32, 64))


@dataclass(frozen=True)
class Layout:
    """One way of writing boxes.

    classes: how many classes the outputs would have in this layout, 0 where they don't say, None where they cannot
    be of it. likely: whether shapes and names speak for it. suppressed: the network suppressed overlaps itself.
    input: what networks of this layout are fed with, unless their metadata says how.
    """

    name: str
    shape: str
    classes: Callable[[Outputs], int | None]
    likely: Callable[[Outputs], bool]
    decode: Callable[[Outputs], Decoded]
    suppressed: bool = False
    input: InputSpec = field(default_factory=InputSpec)


def input_spec(layout: Layout, metadata: ModelMetadata) -> InputSpec:
    """Return how the network wants its pictures: as its metadata says, else as is usual in its family."""
    return layout.input if metadata.preprocess is None else replace(layout.input, preprocess=metadata.preprocess)


def named_layout(name: str) -> Layout:
    """Return the layout of that name. Raises UsageError for an unknown one."""
    if name not in LAYOUTS:
        raise UsageError(f"unknown layout '{name}'", hint=f"known: {', '.join(LAYOUTS)}")
    return LAYOUTS[name]


def told_layout(metadata: ModelMetadata, wanted: str | None) -> Layout | None:
    """Return the layout that `wanted` or the metadata names; None when neither does."""
    if wanted is not None:
        return named_layout(wanted)
    if metadata.layout is not None:
        if metadata.layout not in LAYOUTS:
            reason = f"metadata 'landtool.layout' names the unknown layout '{metadata.layout[:40]}'"
            raise InputError(reason, hint=f"known: {', '.join(LAYOUTS)}")
        return LAYOUTS[metadata.layout]
    return LAYOUTS["end2end"] if metadata.end2end else None


def choose_layout(outputs: Outputs, metadata: ModelMetadata, wanted: str | None) -> Layout:
    """Return the layout of a network from what it gave for a picture.

    Raises UsageError where several fit, InputError where none does, or where the names do not match the classes.
    """
    told = told_layout(metadata, wanted)
    count = None if metadata.names is None else len(metadata.names)
    if told is not None:
        classes = told.classes(outputs)
        if classes is None:
            raise InputError(f"its output {outputs} is not of the layout {told.name}, {told.shape}", hint=_hint())
        _refuse_other_count(count, classes)
        return told
    fitting = {name: layout.classes(outputs) for name, layout in LAYOUTS.items() if layout.likely(outputs)}
    fitting = {name: classes for name, classes in fitting.items() if classes is not None}
    if not fitting:
        raise InputError(f"no known layout fits its output {outputs}", hint=_hint())
    matching = [name for name, classes in fitting.items() if count is None or classes in (0, count)]
    if not matching:
        _refuse_other_count(count, next(iter(fitting.values())))
    if len(matching) > 1:
        raise UsageError(
            f"its output {outputs} could be {' or '.join(matching)}", hint=f"choose with --layout {matching[0]}"
        )
    return LAYOUTS[matching[0]]


def _hint() -> str:
    return f"name the right one with --layout: {', '.join(LAYOUTS)}"


def _refuse_other_count(names: int | None, classes: int | None) -> None:
    if names is not None and classes and names != classes:
        reason = f"its metadata names {_counted(names)}, but its output has {classes}"
        raise InputError(reason, hint="export it again with the right names")


def _counted(classes: int) -> str:
    return "1 class" if classes == 1 else f"{classes} classes"


def _shape(outputs: Outputs) -> tuple[int, ...]:
    """Return the shape of the only output, () where there are several."""
    return outputs.arrays[0].shape if len(outputs.arrays) == 1 else ()


def _cells(outputs: Outputs, strides: tuple[int, ...]) -> int:
    return sum((outputs.width // s) * (outputs.height // s) for s in strides)


def _beyond(channels: int, fixed: int) -> int | None:
    """Return how many channels there are beyond the fixed ones, None without any."""
    return channels - fixed if channels > fixed else None


def _channels_first_classes(outputs: Outputs) -> int | None:
    shape = _shape(outputs)
    return _beyond(shape[1], 4) if len(shape) == 3 else None


def _channels_first_likely(outputs: Outputs) -> bool:
    shape = _shape(outputs)
    return len(shape) == 3 and shape[2] >= 4 * shape[1]


def _final_classes(outputs: Outputs) -> int | None:
    shape = _shape(outputs)
    return 0 if len(shape) == 3 and shape[2] == 6 else None


def _final_likely(outputs: Outputs) -> bool:
    # one class with objectness has six columns, too, but a row for every cell
    shape = _shape(outputs)
    if len(shape) != 3 or shape[2] != 6:
        return False
    return all(shape[1] not in (_cells(outputs, s), 3 * _cells(outputs, s)) for s in _GRIDS)


def _objectness_classes(outputs: Outputs) -> int | None:
    shape = _shape(outputs)
    return _beyond(shape[2], 5) if len(shape) == 3 else None


def _objectness_likely(outputs: Outputs) -> bool:
    shape = _shape(outputs)
    if len(shape) != 3:
        return False
    three_a_cell = any(shape[1] == 3 * _cells(outputs, strides) for strides in _GRIDS)
    return three_a_cell or (_grid_likely(outputs) and outputs.names[0] != _YOLOX_OUTPUT)


def _grid_classes(outputs: Outputs) -> int | None:
    return _objectness_classes(outputs) if _grid_likely(outputs) else None


def _grid_likely(outputs: Outputs) -> bool:
    shape = _shape(outputs)
    return len(shape) == 3 and shape[1] == _cells(outputs, decode.YOLOX_STRIDES)


_YOLOX_OUTPUT = "output"  # its own exporter's name; YOLOv6 has the same shape with decoded boxes, and "outputs"


def _shares_classes(outputs: Outputs) -> int | None:
    shapes = sorted((array.shape for array in outputs.arrays), key=len)
    if len(shapes) != 2 or len(shapes[0]) != 3 or len(shapes[1]) != 4 or shapes[1][2:] != (1, 4):
        return None
    return shapes[0][2] if shapes[0][1] == shapes[1][1] else None


def _heads_classes(outputs: Outputs) -> int | None:
    channels = set()
    for index, array in enumerate(outputs.arrays):
        known = outputs.anchors is not None and index < len(outputs.anchors)
        anchors = len(outputs.anchors[index]) if known and outputs.anchors is not None else 3
        if array.ndim == 5 and array.shape[1] == anchors:
            channels.add(array.shape[4])
        elif array.ndim == 4 and anchors and array.shape[1] % anchors == 0:
            channels.add(array.shape[1] // anchors)
        else:
            return None
    return _beyond(channels.pop(), 5) if len(channels) == 1 else None


def _zoo_classes(outputs: Outputs) -> int | None:
    if len(outputs.arrays) != 3:
        return None
    picks, boxes, scores = decode.zoo_parts(outputs)
    fits = picks.dtype.kind == "i" and picks.shape[-1:] == (3,) and boxes.ndim == scores.ndim == 3
    return scores.shape[1] if fits and boxes.shape[1:] == (scores.shape[2], 4) else None


def _always(_outputs: Outputs) -> bool:
    return True


_YOLOX_INPUT = InputSpec(at="corner", order="bgr", full_range=True)
_STRETCHED = InputSpec(preprocess="stretch")
_ZOO_INPUT = InputSpec(grey=128)
_TABLE = (
    Layout("yolov8", "[1, 4+classes, N]", _channels_first_classes, _channels_first_likely, decode.channels_first),
    Layout("end2end", "[1, N, 6]", _final_classes, _final_likely, decode.final_boxes, suppressed=True),
    Layout("yolov5", "[1, N, 5+classes]", _objectness_classes, _objectness_likely, decode.with_objectness),
    Layout("yolox", "[1, N, 5+classes]", _grid_classes, _grid_likely, decode.yolox_grid, input=_YOLOX_INPUT),
    Layout(
        "darknet", "[1, N, classes] and [1, N, 1, 4]", _shares_classes, _always, decode.shares_of_input,
        input=_STRETCHED,
    ),
    Layout("heads-v3", "[1, 3*(5+classes), h, w] ...", _heads_classes, _always, decode.heads_v3),
    Layout("heads-v5", "[1, 3*(5+classes), h, w] ...", _heads_classes, _always, decode.heads_v5),
    Layout(
        "zoo-tiny-yolov3", "boxes [1, N, 4], scores [1, classes, N], picks", _zoo_classes, _always, decode.zoo_picks,
        suppressed=True, input=_ZOO_INPUT,
    ),
)  # fmt: skip
LAYOUTS: dict[str, Layout] = {layout.name: layout for layout in _TABLE}


def read_boxes(layout: Layout, outputs: Outputs) -> Decoded:
    """Return boxes (N, 4), edges in input pixels, and scores (N, classes). Raises InputError for what is neither."""
    if not all(array.dtype.kind != "f" or np.isfinite(array).all() for array in outputs.arrays):
        raise InputError("the network's output is not finite (NaN or infinite)", hint="train or export it again")
    boxes, scores = layout.decode(outputs)
    # int8 networks overshoot by a level
    if scores.size and not -0.01 <= scores.min() <= scores.max() <= 1.01:
        reason = f"its scores lie between {scores.min():.3g} and {scores.max():.3g}, not 0 and 1"
        raise InputError(reason, hint=_hint())
    return boxes, scores
