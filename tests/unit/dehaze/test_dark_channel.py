from __future__ import annotations

import numpy as np
import pytest

from landtool.dehaze.dark_channel import dark_channel, least_colour


@pytest.mark.parametrize("patch_px", [1, 3, 15])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 2000), (20, 31)])
def test_it_is_the_least_of_all_colours_in_the_patch_that_lie_in_the_picture(
    shape: tuple[int, int], patch_px: int
) -> None:
    image = np.random.default_rng(1).integers(0, 256, shape + (3,), np.uint8)
    dark, half = dark_channel(image, patch_px), patch_px // 2
    for y, x in np.argwhere(np.ones(shape))[:: max(shape[0] * shape[1] // 200, 1)]:
        patch = image[max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1]
        assert dark[y, x] == patch.min()


def test_the_least_colour_of_a_large_picture() -> None:
    image = np.random.default_rng(2).integers(0, 256, (301, 403, 3), np.uint8)
    np.testing.assert_array_equal(least_colour(image), image.min(axis=2))
