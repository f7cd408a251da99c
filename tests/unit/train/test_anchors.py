from __future__ import annotations

import numpy as np
import pytest

from landtool.errors import InputError
from landtool.train.anchors import kmeans_anchors, shape_iou

SHAPES = np.array([[12.0, 12.0], [40.0, 20.0], [30.0, 80.0], [150.0, 140.0]])


def around(shapes: np.ndarray, each: int, spread: float = 0.04) -> np.ndarray:
    """Sizes scattered about some shapes."""
    rng = np.random.default_rng(5)
    return np.concatenate([shape * np.exp(rng.normal(0.0, spread, (each, 2))) for shape in shapes])


def test_the_overlap_of_shapes() -> None:
    iou = shape_iou(np.array([[2.0, 4.0], [1.0, 1.0]]), np.array([[2.0, 4.0], [4.0, 2.0]]))
    assert np.allclose(iou, [[1.0, 4.0 / 12.0], [1.0 / 8.0, 1.0 / 8.0]])


def test_groups_of_sizes_are_found_smallest_first() -> None:
    sizes = around(SHAPES[::-1], 40)
    anchors, fit = kmeans_anchors(sizes, 4, np.random.default_rng(0))
    assert np.allclose(anchors, SHAPES, rtol=0.05)
    assert all(side == round(side) for anchor in anchors for side in anchor)
    assert fit == pytest.approx(shape_iou(sizes, np.array(anchors)).max(axis=1).mean())
    assert fit > 0.92


def test_more_anchors_fit_better_than_few() -> None:
    sizes = np.exp(np.random.default_rng(2).uniform(np.log(8.0), np.log(400.0), (500, 2)))
    fits = [kmeans_anchors(sizes, count, np.random.default_rng(0))[1] for count in (1, 3, 6, 9)]
    assert fits == sorted(fits)
    assert fits[0] < 0.4
    assert fits[-1] > 0.5


def test_the_same_numbers_give_the_same_anchors() -> None:
    sizes = around(SHAPES, 20, spread=0.5)
    first, again = (kmeans_anchors(sizes, 6, np.random.default_rng(3)) for _ in range(2))
    assert first == again


def test_as_many_sizes_as_anchors_are_the_anchors() -> None:
    anchors, fit = kmeans_anchors(np.repeat(SHAPES, 3, axis=0), 4, np.random.default_rng(0))
    assert anchors == tuple(map(tuple, SHAPES))
    assert fit == 1.0


@pytest.mark.parametrize(
    ("sizes", "apart"),
    [
        (np.empty((0, 2)), 0),
        (np.repeat(SHAPES[:2], 50, axis=0), 2),
        # different, but the same anchors in whole pixels
        (np.array([[20.0, 20.1], [20.1, 20.0], [20.2, 20.2], [30.0, 30.0]]), 2),
    ],
)
def test_too_few_sizes_are_refused(sizes: np.ndarray, apart: int) -> None:
    with pytest.raises(InputError, match=rf"differ too little: {apart} anchors .* not 3; use the cfg's anchors"):
        kmeans_anchors(sizes, 3, np.random.default_rng(0))
