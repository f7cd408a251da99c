from __future__ import annotations

import numpy as np
import pytest

from landtool.dehaze.tables import recover_by_tables


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (9, 1), (3, 2000), (48, 64)])
def test_every_pixel_has_the_value_the_table_says(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    image = rng.integers(0, 256, shape + (3,), np.uint8)
    levels = rng.integers(0, 256, shape, np.uint8)
    tables = rng.integers(0, 256, (3, 65536), np.uint8)
    before = image.copy()
    made = recover_by_tables(image, levels, tables)
    for colour in range(3):
        index = image[..., colour] + 256 * levels.astype(int)
        np.testing.assert_array_equal(made[..., colour], tables[colour][index])
    assert made.dtype == np.uint8
    np.testing.assert_array_equal(image, before)
    assert not np.shares_memory(made, image)


def test_a_part_of_a_picture_is_as_good_as_a_whole_one() -> None:
    rng = np.random.default_rng(6)
    image, levels = rng.integers(0, 256, (40, 60, 3), np.uint8), rng.integers(0, 256, (40, 60), np.uint8)
    tables = rng.integers(0, 256, (3, 65536), np.uint8)
    part = np.s_[5:30:2, 7:50]
    np.testing.assert_array_equal(
        recover_by_tables(image[part], levels[part], tables), recover_by_tables(image, levels, tables)[part]
    )
