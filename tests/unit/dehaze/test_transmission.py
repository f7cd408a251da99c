from __future__ import annotations

import numpy as np

from landtool.dehaze.transmission import transmission


def test_it_is_one_minus_the_hazy_part_of_the_airlight() -> None:
    image = np.random.default_rng(1).integers(60, 130, (20, 30, 3), np.uint8)
    air = np.array([0.5, 0.6, 0.7])
    t = transmission(image, air, 5, 0.95)
    patch = image[3:8, 10:15] / 255.0
    np.testing.assert_allclose(t[5, 12], 1.0 - 0.95 * (patch / air).min(), atol=1e-6)
    assert t.dtype == np.float32


def test_a_picture_as_bright_as_the_air_lets_through_what_omega_leaves() -> None:
    image = np.full((9, 9, 3), 128, np.uint8)
    np.testing.assert_allclose(transmission(image, np.full(3, 128 / 255), 15, 0.95), 0.05, atol=1e-6)
    np.testing.assert_array_equal(transmission(image, np.full(3, 0.2), 15, 0.95), 0.0)


def test_black_air_divides_nothing_by_zero() -> None:
    with np.errstate(all="raise"):
        t = transmission(np.zeros((4, 4, 3), np.uint8), np.zeros(3), 3, 1.0)
    np.testing.assert_array_equal(t, 1.0)
