"""How each family of networks writes its boxes: from raw outputs to edges in input pixels and a score a class.

Every function returns boxes (N, 4) x_min, y_min, x_max, y_max, continuous edges of the input (pixel i spans
[i, i + 1]), and scores (N, classes) in [0, 1].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.detect.session import Outputs
from landtool.errors import InputError

Floats = NDArray[np.floating[Any]]
Decoded = tuple[Floats, Floats]
YOLOX_STRIDES = (8, 16, 32)
_LARGEST_EXPONENT = 20.0  # of a side: any picture is smaller, and float32 holds it


def channels_first(outputs: Outputs) -> Decoded:
    """[1, 4 + classes, N]: cx, cy, w, h in input pixels, class scores."""
    (array,) = outputs.arrays
    values = array[0]
    return _edges(values[0], values[1], values[2], values[3]), values[4:].T


def final_boxes(outputs: Outputs) -> Decoded:
    """[1, N, 6]: edges in input pixels, score, class; suppressed already."""
    (array,) = outputs.arrays
    rows = array[0]
    classes = np.rint(rows[:, 5]).astype(np.int64)
    if len(rows) and not 0 <= classes.min() <= classes.max() < 2**16:
        raise InputError("its last column holds no class numbers", hint="name the layout with --layout")
    scores = np.zeros((len(rows), int(classes.max(initial=0)) + 1), dtype=rows.dtype)
    scores[np.arange(len(rows)), classes] = rows[:, 4]
    return rows[:, :4], scores


def with_objectness(outputs: Outputs) -> Decoded:
    """[1, N, 5 + classes]: cx, cy, w, h in input pixels, objectness, class scores given an object."""
    (array,) = outputs.arrays
    rows = array[0]
    return _edges(*rows[:, :4].T), rows[:, 4:5] * rows[:, 5:]


def yolox_grid(outputs: Outputs) -> Decoded:
    """[1, N, 5 + classes]: offsets from the cells of strides 8, 16 and 32, logarithms of the sides in strides."""
    (array,) = outputs.arrays
    rows = array[0]
    cells, strides = [], []
    for stride in YOLOX_STRIDES:
        y, x = np.mgrid[: outputs.height // stride, : outputs.width // stride]
        cells.append(np.column_stack([x.ravel(), y.ravel()]).astype(rows.dtype))
        strides.append(np.full(x.size, stride, dtype=rows.dtype))
    stride_px = np.concatenate(strides)
    # c = (cell + t) stride, side = exp(t) stride
    centre = (np.concatenate(cells) + rows[:, :2]).T * stride_px
    side = np.exp(np.minimum(rows[:, 2:4], _LARGEST_EXPONENT)).T * stride_px
    return _edges(*centre, *side), rows[:, 4:5] * rows[:, 5:]


def shares_of_input(outputs: Outputs) -> Decoded:
    """From confs [1, N, classes] and boxes [1, N, 1, 4]: edges as shares of the input's width and height."""
    confs, boxes = sorted(outputs.arrays, key=lambda array: array.ndim)
    size = np.array([outputs.width, outputs.height] * 2, dtype=boxes.dtype)
    return boxes[0, :, 0, :] * size, confs[0]


def zoo_picks(outputs: Outputs) -> Decoded:
    """From boxes [1, N, 4] y_min, x_min, y_max, x_max, scores [1, classes, N] and picks [..., 3] image, class, box."""
    picks, boxes, scores = zoo_parts(outputs)
    chosen = picks.reshape(-1, 3)
    count, classes = boxes.shape[1], scores.shape[1]
    valid = (chosen >= 0).all() and (chosen[:, 1] < classes).all() and (chosen[:, 2] < count).all()
    if not valid:
        raise InputError("it picks boxes it does not give", hint="name the layout with --layout")
    picked = np.zeros((len(chosen), classes), dtype=scores.dtype)
    picked[np.arange(len(chosen)), chosen[:, 1]] = scores[0, chosen[:, 1], chosen[:, 2]]
    return boxes[0, chosen[:, 2]][:, [1, 0, 3, 2]], picked


def zoo_parts(outputs: Outputs) -> list[NDArray[Any]]:
    """Return the three outputs of the zoo's network as picks (integers), boxes and scores."""
    return sorted(outputs.arrays, key=lambda array: (array.dtype.kind == "f", array.shape[-1:] != (4,)))


def heads_v3(outputs: Outputs) -> Decoded:
    """Raw heads of YOLOv3: c = (sigma(t) + cell) stride, side = exp(t) anchor."""
    return _heads(outputs, "v3")


def heads_v5(outputs: Outputs) -> Decoded:
    """Raw heads of YOLOv5: c = (2 sigma(t) - 0.5 + cell) stride, side = (2 sigma(t))^2 anchor."""
    return _heads(outputs, "v5")


def _heads(outputs: Outputs, version: str) -> Decoded:
    anchors = outputs.anchors
    if anchors is None or len(anchors) != len(outputs.arrays):
        said = "no anchors" if anchors is None else f"anchors for {len(anchors)} outputs, not {len(outputs.arrays)}"
        hint = "export it with decoded boxes, or add the metadata landtool.anchors: [[[w, h], ...], ...]"
        raise InputError(f"gives raw outputs, but {said}", hint=hint)
    parts = [_head(a, p, outputs, version) for a, p in zip(outputs.arrays, anchors, strict=True)]
    return np.concatenate([boxes for boxes, _ in parts]), np.concatenate([scores for _, scores in parts])


def _head(array: Floats, anchors: Sequence[tuple[float, float]], outputs: Outputs, version: str) -> Decoded:
    count = len(anchors)
    if array.ndim == 4:  # [1, anchors * (5 + classes), h, w]
        if array.shape[1] % count:
            raise InputError(f"{count} anchors do not divide an output of {array.shape[1]} channels")
        array = array[0].reshape(count, -1, *array.shape[2:]).transpose(0, 2, 3, 1)
    else:  # [1, anchors, h, w, 5 + classes]
        array = array[0]
    if len(array) != count:
        raise InputError(f"{count} anchors for an output of {len(array)}")
    _, rows, columns, channels = array.shape
    y, x = np.mgrid[:rows, :columns]
    cell = np.stack([x, y], axis=-1).astype(array.dtype)
    stride = np.array([outputs.width / columns, outputs.height / rows], dtype=array.dtype)
    size = np.array(anchors, dtype=array.dtype)[:, None, None, :]
    if version == "v3":
        centre = (_sigmoid(array[..., :2]) + cell) * stride
        side = np.exp(np.minimum(array[..., 2:4], _LARGEST_EXPONENT)) * size
    else:
        centre = (2.0 * _sigmoid(array[..., :2]) - 0.5 + cell) * stride
        side = (2.0 * _sigmoid(array[..., 2:4])) ** 2 * size
    scores = _sigmoid(array[..., 4:5]) * _sigmoid(array[..., 5:])
    boxes = _edges(*centre.reshape(-1, 2).T, *side.reshape(-1, 2).T)
    return boxes, scores.reshape(-1, channels - 5)


def _edges(centre_x: Floats, centre_y: Floats, width: Floats, height: Floats) -> Floats:
    """Return boxes (N, 4) from centres and sides (N,)."""
    boxes = np.empty((len(centre_x), 4), dtype=centre_x.dtype)
    half = width * 0.5
    np.subtract(centre_x, half, out=boxes[:, 0])
    np.add(centre_x, half, out=boxes[:, 2])
    half = height * 0.5
    np.subtract(centre_y, half, out=boxes[:, 1])
    np.add(centre_y, half, out=boxes[:, 3])
    return boxes


def _sigmoid(values: Floats) -> Floats:
    # tanh form of 1 / (1 + exp(-v)): it cannot overflow
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * values)))
