from __future__ import annotations

import numpy as np
import pytest

from landtool.dehaze.noise import quieter
from landtool.geometry import Array
from landtool.types import Image
from tests.unit.dehaze.hazy import hazy_picture

pytestmark = [pytest.mark.usefixtures("strict"), pytest.mark.filterwarnings("error")]


def noisy(values: Array, sigma: float, *, grey: bool, seed: int = 1) -> Image:
    """A picture (H, W, 3) of grey levels (H, W), with the same noise in all colours or with each its own."""
    noise = sigma * np.random.default_rng(seed).standard_normal(values.shape + (1 if grey else 3,))
    return np.rint(np.clip(values[..., None] + np.broadcast_to(noise, values.shape + (3,)), 0, 255)).astype(np.uint8)


def flat(height: int = 240, width: int = 320) -> Array:
    return np.full((height, width), 120.0)


@pytest.mark.parametrize("sigma", [1.0, 2.0, 4.0, 5.0])
def test_noise_below_the_threshold_is_halved_at_least(sigma: float) -> None:
    image = noisy(flat(), sigma, grey=False)
    quiet = quieter(image, 3.0 * sigma)
    assert quiet.std() < 0.5 * image.std()
    assert quiet.mean() == pytest.approx(image.mean(), abs=0.3)


@pytest.mark.parametrize("threshold", [0.5, 3.0, 6.0])
def test_strong_edges_stay_as_strong(threshold: float) -> None:
    values = np.full((40, 60), 40.0)
    values[:, 30:] = 220.0
    image = noisy(values, 0.0, grey=True)
    quiet = quieter(image, threshold)
    change = np.abs(quiet.astype(int) - image)
    assert change[:, 29:31].max() <= 1
    assert change[:, :28].max() == 0
    assert change[:, 32:].max() == 0


@pytest.mark.parametrize("threshold", [0.5, 4.0, 16.0])
def test_nothing_is_taken_back_by_more_than_half_the_threshold(threshold: float) -> None:
    # d - d^3 / (d^2 + T^2) is largest at d = T
    image = np.random.default_rng(3).integers(0, 256, (40, 60, 3), np.uint8)
    assert np.abs(quieter(image, threshold).astype(int) - image).max() <= threshold / 2 + 0.5


def test_a_threshold_of_nothing_gives_the_picture_itself() -> None:
    image = hazy_picture(1)
    same = quieter(image, 0.0)
    assert np.shares_memory(same, image)
    np.testing.assert_array_equal(same, image)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 2000), (41, 23)])
def test_any_shape_keeps_it_and_the_input_its_values(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(2).integers(0, 256, shape + (3,), np.uint8)
    before = image.copy()
    quiet = quieter(image, 6.0)
    assert quiet.shape == image.shape
    assert quiet.dtype == np.uint8
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("rows", [1, 2, 3, 7, 100])
def test_rows_are_those_of_the_whole(rows: int) -> None:
    image = np.random.default_rng(4).integers(0, 256, (23, 31, 3), np.uint8)
    whole = quieter(image, 5.0)
    parts = [quieter(image, 5.0, slice(top, top + rows)) for top in range(0, 23, rows)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    np.testing.assert_array_equal(quieter(image[::-1, ::-1], 5.0), quieter(image[::-1, ::-1].copy(), 5.0))
