from __future__ import annotations

import numpy as np
import pytest

from landtool.dehaze.recovery import recover


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (4, 1), (4, 3), (3, 4), (4, 4), (3, 2000), (170, 300)])
def test_it_is_the_equation_within_half_a_grey_level(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, shape + (3,), np.uint8)
    t, air = rng.random(shape, np.float32), np.array([0.4, 0.6, 0.9])
    before = image.copy()
    made = recover(image, air, t, 0.1)
    exact = ((image / 255.0 - air) / np.maximum(t, 0.1)[..., None] + air) * 255.0
    np.testing.assert_allclose(made, np.clip(exact, 0, 255), atol=0.501)
    assert made.dtype == np.uint8
    np.testing.assert_array_equal(image, before)


def test_clear_air_leaves_a_picture_as_it_is() -> None:
    image = np.random.default_rng(2).integers(0, 256, (50, 60, 3), np.uint8)
    made = recover(image, np.array([0.3, 0.5, 0.7]), np.ones((50, 60), np.float32), 0.1)
    np.testing.assert_array_equal(made, image)
    assert not np.shares_memory(made, image)
