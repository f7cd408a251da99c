from __future__ import annotations

import cv2
import numpy as np
import pytest

from landtool.dehaze.statistics import DARK, SHARES, SMALL, small_copy, statistics
from landtool.types import Image
from tests.unit.dehaze.hazy import hazy_picture

pytestmark = [pytest.mark.usefixtures("strict"), pytest.mark.filterwarnings("error")]
N = len(SHARES)
# where the quantiles of each map are
DARK_CHANNEL, LACK, MOST, STEPS, CONTRAST = (slice(k * N, k * N + N) for k in range(3, 8))
CELLS_LOW, CELLS_SPREAD, CELLS_BRIGHTEST = (slice(8 * N + 9 * k, 8 * N + 9 * k + 9) for k in range(3))
LACK_OF_CLASS, SHARE_OF_CLASS = slice(99, 104), slice(104, 109)
SLOPES_OF_DARK, SLOPES_OF_LUMA, SLOPES_OF_LACK = (slice(k, k + 2) for k in (109, 111, 113))


def random_small(seed: int) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (SMALL[1], SMALL[0], 3), np.uint8)


@pytest.mark.parametrize(
    "image",
    [
        *(np.random.default_rng(1).integers(0, 256, s + (3,), np.uint8) for s in ((1, 1), (1, 33), (33, 1), (3, 2000))),
        *(np.full((40, 60, 3), level, np.uint8) for level in (0, 128, 255)),
        np.full((40, 60, 3), (255, 0, 0), np.uint8),
        hazy_picture(1),
    ],
    ids=["1x1", "1xN", "Nx1", "3x2000", "black", "grey", "white", "blue", "hazy"],
)
def test_any_picture_has_finite_numbers_in_range(image: Image) -> None:
    before = image.copy()
    known = statistics(small_copy(image))
    assert known.shape == (115,)
    assert known.dtype == np.float32
    assert np.isfinite(known).all()
    assert known[:109].min() >= 0.0
    assert known[:109].max() <= 1.0
    assert np.abs(known[109:]).max() <= 0.75
    np.testing.assert_array_equal(image, before)


def test_the_quantiles_are_those_of_the_colours_and_maps() -> None:
    small = small_copy(hazy_picture(2))
    known = statistics(small)
    padded = np.pad(small.min(axis=2), 2, constant_values=255)
    dark = np.lib.stride_tricks.sliding_window_view(padded, (5, 5)).min(axis=(2, 3))
    least, most = small.min(axis=2), small.max(axis=2)
    luma = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(int)
    across, down = np.abs(np.diff(luma, axis=1))[:-1], np.abs(np.diff(luma, axis=0))[:, :-1]
    tile = (SMALL[1] // 4, 4, SMALL[0] // 4, 4)
    contrast = most.reshape(tile).max(axis=(1, 3)) - least.reshape(tile).min(axis=(1, 3))
    maps = [
        (slice(0, N), small[..., 0]),
        (slice(N, 2 * N), small[..., 1]),
        (slice(2 * N, 3 * N), small[..., 2]),
        (DARK_CHANNEL, dark),
        (LACK, most - least),
        (MOST, most),
        (STEPS, np.minimum(2 * across + 2 * down, 255)),
        (CONTRAST, contrast),
    ]
    for place, values in maps:
        wanted = np.quantile(values, SHARES, method="inverted_cdf") / 255.0
        np.testing.assert_allclose(known[place], wanted, atol=1.01 / 255.0)
    assert SHARES[DARK] < 0.05


def test_cells_say_where_it_is_dark_rough_and_bright() -> None:
    small = np.full((SMALL[1], SMALL[0], 3), 100, np.uint8)
    small[:20, -26:] = random_small(1)[:20, -26:]  # the upper right ninth
    small[45:, 30:48] = 20  # inside the lower middle one
    small[50, 5] = 250  # the lower left one
    known = statistics(small)
    rough, dark, bright = 2, 7, 6
    assert known[CELLS_SPREAD].argmax() == rough
    assert known[CELLS_LOW][dark] == pytest.approx(20 / 255)
    assert known[CELLS_BRIGHTEST][bright] == pytest.approx(250 / 255)
    for place, others in ((CELLS_LOW, (0, 1, 3, 4, 5, 6, 8)), (CELLS_BRIGHTEST, (0, 1, 3, 4, 5, 7, 8))):
        np.testing.assert_allclose(known[place][list(others)][:2], 100 / 255)


@pytest.mark.parametrize(("value", "place"), [(0, 0), (37, 0), (38, 1), (127, 2), (128, 3), (191, 4), (255, 4)])
def test_classes_of_brightness(value: int, place: int) -> None:
    small = np.full((SMALL[1], SMALL[0], 3), value, np.uint8)
    small[..., 0] = 0
    known = statistics(small)
    np.testing.assert_array_equal(known[SHARE_OF_CLASS], np.eye(5)[place])
    np.testing.assert_allclose(known[LACK_OF_CLASS], np.eye(5)[place] * value / 255.0, rtol=2e-3)


def test_slopes_point_to_the_right_and_down() -> None:
    small = np.zeros((SMALL[1], SMALL[0], 3), np.uint8)
    small[:] = np.rint(np.linspace(0, 255, SMALL[0]))[None, :, None]
    # x (x + 1) / 2 is 1 / 6 on the mean
    np.testing.assert_allclose(statistics(small)[SLOPES_OF_LUMA], [0.5, 0.0], atol=0.02)
    np.testing.assert_allclose(statistics(np.ascontiguousarray(small[:, ::-1]))[SLOPES_OF_LUMA], [-0.5, 0], atol=0.02)
    down = np.ascontiguousarray(np.broadcast_to(np.linspace(0, 200, SMALL[1])[:, None, None], small.shape), np.uint8)
    known = statistics(down)
    assert known[SLOPES_OF_DARK][1] > 0.3
    assert abs(known[SLOPES_OF_DARK][0]) < 0.01
    np.testing.assert_allclose(known[SLOPES_OF_LACK], 0.0, atol=1e-6)


def test_a_picture_of_twice_the_size_has_the_same_numbers() -> None:
    image = hazy_picture(3)
    twice = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), np.uint8)
    np.testing.assert_allclose(statistics(small_copy(twice)), statistics(small_copy(image)), atol=0.01)
    smooth = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR), np.uint8)
    assert np.abs(statistics(small_copy(smooth)) - statistics(small_copy(image))).mean() < 0.02


def test_a_view_of_a_picture_is_as_good_as_a_copy() -> None:
    image = hazy_picture(4)
    for view in (image[:, ::-1], image[::-1], image[3:90, 7:101], image[::2, ::3]):
        np.testing.assert_array_equal(small_copy(view), small_copy(np.ascontiguousarray(view)))
