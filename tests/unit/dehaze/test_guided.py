from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from landtool.dehaze.guided import guided_coefficients
from landtool.types import Image


def dense(guide: Image, p: NDArray[np.float32], radius: int, epsilon: float) -> NDArray[np.float64]:
    """The filter by its definition, window by window."""
    i = guide / 255.0
    height, width = i.shape

    def windows() -> list[tuple[slice, slice]]:
        return [
            (slice(max(y - radius, 0), y + radius + 1), slice(max(x - radius, 0), x + radius + 1))
            for y in range(height)
            for x in range(width)
        ]

    a = np.array([np.mean(i[w] * p[w]) - i[w].mean() * p[w].mean() for w in windows()])
    a = (a / np.array([i[w].var() + epsilon for w in windows()])).reshape(i.shape)
    b = np.array([p[w].mean() for w in windows()]).reshape(i.shape)
    b -= a * np.array([i[w].mean() for w in windows()]).reshape(i.shape)
    a_mean, b_mean = (np.array([v[w].mean() for w in windows()]).reshape(i.shape) for v in (a, b))
    return np.asarray(a_mean * i + b_mean)


@pytest.mark.parametrize("radius", [1, 3, 60])
@pytest.mark.parametrize("shape", [(1, 1), (1, 12), (3, 40), (14, 17)])
def test_it_is_the_filter_of_its_definition(shape: tuple[int, int], radius: int) -> None:
    rng = np.random.default_rng(1)
    guide, values = rng.integers(0, 256, shape, np.uint8), rng.random(shape, np.float32)
    made = guided_coefficients(guide, values, radius, 1e-3).applied(guide)
    np.testing.assert_allclose(made, dense(guide, values, radius, 1e-3), atol=1e-5)
    assert made.dtype == np.float32


def test_even_pictures_stay_even_with_the_least_epsilon() -> None:
    guide, values = np.full((50, 60), 77, np.uint8), np.full((50, 60), 0.3, np.float32)
    with np.errstate(all="raise"):
        np.testing.assert_allclose(guided_coefficients(guide, values, 9, 1e-8).applied(guide), 0.3, atol=1e-6)


def test_coefficients_are_interpolated_to_a_larger_guide() -> None:
    ramp = np.tile(np.arange(0, 240, 2, dtype=np.uint8), (40, 1))
    # what goes with the guide goes with it at every size
    values = (0.5 + ramp[::4, ::4] / 1000).astype(np.float32)
    made = guided_coefficients(ramp[::4, ::4], values, 4, 1e-8).applied(ramp)
    np.testing.assert_allclose(made, 0.5 + ramp / 1000, atol=1e-3)
