from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from landtool.detect import nms
from landtool.detect.nms import suppress
from landtool.geometry import Array


def plain_iou(a: Array, b: Array) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    shared = max(width, 0.0) * max(height, 0.0)
    union = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - shared
    return float(shared / union) if union > 0 else 0.0


def plain(boxes: Array, scores: Array, classes: NDArray[np.int64], iou: float, most: int) -> list[int]:
    kept: list[int] = []
    for index in sorted(range(len(boxes)), key=lambda i: (-scores[i], i)):
        if all(classes[index] != classes[k] or plain_iou(boxes[k], boxes[index]) <= iou for k in kept):
            kept.append(index)
    return kept[:most]


# coarse numbers, so that boxes coincide, touch, are empty, and scores are equal
side = st.integers(0, 12)
box = st.tuples(side, side, side, side, st.integers(0, 4), st.integers(0, 2))


@settings(max_examples=300, deadline=None)
@given(st.lists(box, max_size=25), st.sampled_from([0.0, 0.2, 0.45, 0.5, 1.0]), st.integers(1, 8), st.integers(1, 30))
def test_it_equals_the_plain_version(rows: list[tuple[int, ...]], iou: float, most: int, block: int) -> None:
    table = np.array(rows, dtype=np.float64).reshape(-1, 6)
    boxes = np.column_stack([table[:, :2], table[:, :2] + table[:, 2:4]])
    scores, classes = table[:, 4] / 4, table[:, 5].astype(np.int64)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nms, "_BLOCK", block)
        kept = suppress(boxes, scores, classes, iou=iou, most=most).tolist()
    assert kept == plain(boxes, scores, classes, iou, most)


def test_many_boxes_do_not_take_long() -> None:
    rng = np.random.default_rng(1)
    corner = rng.uniform(0, 600, (6300, 2))
    boxes = np.column_stack([corner, corner + rng.uniform(5, 60, (6300, 2))])
    scores, classes = rng.random(6300), np.zeros(6300, dtype=np.int64)
    start = time.perf_counter()
    kept = suppress(boxes, scores, classes, iou=0.45, most=300)
    assert time.perf_counter() - start < 2.0  # about 0.03 s; a quadratic table in Python takes minutes
    assert len(kept) == 300
    assert (np.diff(scores[kept]) <= 0).all()
