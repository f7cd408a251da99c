"""A test vector: what the network gave for a known picture when it was exported, compared each time it is loaded.

It goes through the whole preprocessing, so that an output layout, a channel order, a scaling or a letterbox other
than those of the export are found before a wrong box is. Its two metadata entries are Python literals:

    landtool.test_input    {'picture': 'pattern-1', 'input': [W, H]}    made by `test_picture`, for an input of W x H
    landtool.test_output   {'values': [[i, v], ...], 'tolerance': t}    element i of all outputs, flattened and joined

The distance of two outputs is the root mean square, over these elements, of |a - b| / (1 + |b|).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from landtool.detect.layouts import input_spec, told_layout
from landtool.detect.preprocess import InputSpec, Preprocessor
from landtool.detect.session import Outputs, Session
from landtool.errors import InputError
from landtool.geometry import Array
from landtool.types import Image

_PICTURE = "pattern-1"
_SMALL_INPUT = (256, 192)  # where the size is free: a fraction of a frame's time at every start
# In float32 other processors sum in another order, which changes a relative 1e-5 or so.
_EXACT_TOLERANCE = 1e-3
# With int8 another processor rounds, or saturates, otherwise: what is asked is to be much nearer to the right
# preprocessing than to any wrong one.
_ROUNDED_SHARE = 0.25
_EVEN, _TELLING = 16, 8  # elements spread evenly, and those that tell each wrong preprocessing best


def test_picture(width: int, height: int) -> Image:
    """Return a picture (height, width, 3) BGR uint8 whose channels differ and have no symmetry."""
    y, x = np.mgrid[:height, :width]
    blue = 7 * x + 3 * y
    green = x * x // 16 + 5 * y
    red = 11 * y + 2 * x + 37 * (x // 16) * (y // 16)
    return np.asarray(np.stack([blue, green, red], axis=-1) & 255, dtype=np.uint8)


def test_vector(session: Session) -> dict[str, str]:
    """Return the metadata entries of a network's test vector; its metadata must name its layout.

    Raises InputError for a network that gives much the same whatever it is fed with.
    """
    spec, size = _told_spec(session), _input_size(session)
    right = _flat(replay(session, spec, size))
    wrong = [_flat(replay(session, other, size)) for other in _other_specs(spec, session)]
    strangeness = [np.abs(other - right) / (1.0 + np.abs(right)) for other in wrong]
    telling = [np.argsort(-strange, kind="stable")[:_TELLING] for strange in strangeness]
    chosen = np.unique(np.concatenate([np.linspace(0, right.size - 1, _EVEN).astype(np.int64), *telling]))
    nearest = min(_distance(other[chosen], right[chosen]) for other in wrong)
    if not nearest > _EXACT_TOLERANCE / _ROUNDED_SHARE:
        reason = f"its output hardly depends on its input ({nearest:.2g}), so that no test vector can tell"
        raise InputError(reason, file=session.model.file, hint="train it first")
    tolerance = _ROUNDED_SHARE * nearest if session.model.rounded else _EXACT_TOLERANCE
    values = [[int(index), float(f"{right[index]:.9g}")] for index in chosen]
    return {
        "landtool.test_input": repr({"picture": _PICTURE, "input": list(size)}),
        "landtool.test_output": repr({"values": values, "tolerance": float(f"{tolerance:.3g}")}),
    }


def vector_size(session: Session) -> tuple[int, int] | None:
    """Return the input's width and height of a model's test vector, None without a vector.

    Raises InputError for one that cannot be replayed.
    """
    said = session.model.metadata.test_input
    if said is None or session.model.metadata.test_output is None:
        return None
    match said:
        case {"picture": "pattern-1", "input": [int(width), int(height)]} if min(width, height) > 0:
            size = (width, height)
        case _:
            raise _unusable(session)
    if max(size) > 8192 or session.fixed_size not in (None, size):
        raise _unusable(session)
    return size


def check_test_vector(session: Session, outputs: Outputs | None = None) -> None:
    """Replay a model's test vector, unless `outputs` of its replay are given; nothing to do without a vector.

    Raises InputError when the network gives other numbers than at its export.
    """
    size = vector_size(session)
    if size is None:
        return
    places, expected, tolerance = _stored(session)
    values = _flat(replay(session, _told_spec(session), size) if outputs is None else outputs)
    if places.max() >= values.size:
        raise InputError(f"its test vector is of a larger output than {values.size} numbers", **_blame(session))
    distance = _distance(values[places], expected)
    if not distance <= tolerance:
        reason = f"gives other numbers than when it was exported (off by {distance:.2g}, allowed {tolerance:.2g})"
        raise InputError(reason, **_blame(session))


def replay(session: Session, spec: InputSpec, size: tuple[int, int]) -> Outputs:
    """Run the network on the test picture, half as high as the input, so that letterbox and stretch differ."""
    picture = test_picture(size[0], max(size[1] // 4 * 2, 1))
    tensor, _ = Preprocessor(spec, session.dtype).prepare(picture, size)
    return session.run(tensor)


def _told_spec(session: Session) -> InputSpec:
    layout = told_layout(session.model.metadata, None)
    if layout is None:
        raise InputError("has a test vector, but names no landtool.layout", **_blame(session))
    return input_spec(layout, session.model.metadata)


def _other_specs(spec: InputSpec, session: Session) -> list[InputSpec]:
    """Return the mistakes a test vector must tell: the other channel order, aspect and range of values."""
    others = [
        replace(spec, order="bgr" if spec.order == "rgb" else "rgb"),
        replace(spec, preprocess="stretch" if spec.preprocess == "letterbox" else "letterbox"),
    ]
    return others if session.dtype == np.uint8 else [*others, replace(spec, full_range=not spec.full_range)]


def _input_size(session: Session) -> tuple[int, int]:
    return session.fixed_size or _SMALL_INPUT


def _stored(session: Session) -> tuple[Any, Array, float]:
    """Return the places (N,), the values (N,) and the tolerance of a model's test vector."""
    said = session.model.metadata.test_output or {}
    try:
        pairs = np.array(said["values"], dtype=np.float64).reshape(-1, 2)
        places, tolerance = pairs[:, 0].astype(np.int64), float(said["tolerance"])
        usable = len(pairs) > 0 and places.min() >= 0 and 0.0 < tolerance < 1.0 and np.isfinite(pairs).all()
    except (KeyError, TypeError, ValueError, OverflowError):
        usable = False
    if not usable:
        raise _unusable(session)
    return places, pairs[:, 1], tolerance


def _flat(outputs: Outputs) -> Array:
    return np.concatenate([array.astype(np.float64).ravel() for array in outputs.arrays])


def _distance(values: Array, expected: Array) -> float:
    return float(np.sqrt(np.mean((np.abs(values - expected) / (1.0 + np.abs(expected))) ** 2)))


def _unusable(session: Session) -> InputError:
    return InputError("its test vector cannot be used", **_blame(session))


def _blame(session: Session) -> dict[str, Any]:
    return {"file": session.model.file, "hint": "export it again with landtool export"}
