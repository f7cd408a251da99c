from __future__ import annotations

import numpy as np
import pytest

from landtool.dehaze.airlight import airlight


def test_mean_and_brightest_of_the_pixels_where_the_dark_channel_is_brightest() -> None:
    image = np.full((10, 10, 3), 20, np.uint8)
    image[0, :2] = [[100, 120, 140], [200, 120, 140]]
    image[5, 5] = 255  # bright, but not where it is hazy
    dark = np.full((10, 10), 20, np.uint8)
    dark[0, :2] = 90, 100
    np.testing.assert_allclose(airlight(image, dark, "mean", 0.02), np.array([150, 120, 140]) / 255)
    np.testing.assert_allclose(airlight(image, dark, "brightest", 0.02), np.array([200, 120, 140]) / 255)
    np.testing.assert_allclose(airlight(image, dark, "mean", 0.01), np.array([200, 120, 140]) / 255)


def test_pixels_equally_hazy_count_alike() -> None:
    rng = np.random.default_rng(3)
    image, dark = rng.integers(0, 256, (40, 50, 3), np.uint8), rng.integers(0, 4, (40, 50), np.uint8)
    expected = image[dark == 3].mean(axis=0) / 255
    np.testing.assert_allclose(airlight(image, dark, "mean", 0.001), expected)
    np.testing.assert_allclose(airlight(image[::-1], dark[::-1], "mean", 0.001), expected)


@pytest.mark.parametrize("share", [0.0, 1.0])
@pytest.mark.parametrize("shape", [(1, 1), (3, 5)])
def test_no_share_is_one_pixel_and_the_whole_share_all(shape: tuple[int, int], share: float) -> None:
    image = np.random.default_rng(4).integers(0, 256, shape + (3,), np.uint8)
    dark = np.arange(shape[0] * shape[1], dtype=np.uint8).reshape(shape)
    expected = image.reshape(-1, 3)[-1] if share == 0.0 else image.mean(axis=(0, 1))
    np.testing.assert_allclose(airlight(image, dark, "mean", share), expected / 255)
