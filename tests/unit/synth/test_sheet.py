import math

import numpy as np
import pytest

from landtool.pad import PadSpec
from landtool.synth.grime import grime
from landtool.synth.sheet import Sheet, clean_sheet, glare, random_curl, random_sheet
from landtool.tone import srgb_decode

PAD = PadSpec()


def middles(n: int) -> tuple[np.ndarray, np.ndarray]:
    at = (np.arange(n, dtype=np.float32) + 0.5) / n
    return np.meshgrid(at, at)


def test_a_clean_sheet_has_the_pads_colours_and_lies_flat() -> None:
    sheet = clean_sheet(PAD)
    assert sheet.paper == (1.0, 1.0, 1.0)
    assert sheet.ring == pytest.approx(srgb_decode(np.array([28, 25, 215]) / 255.0))
    assert sheet.ink == pytest.approx(srgb_decode(np.full(3, 20 / 255.0)))
    assert sheet.black == (0.0, 0.0, 0.0)
    assert not sheet.bent
    assert not sheet.height_m(np.linspace(-1, 1, 5), 0.3).any()
    color = np.random.default_rng(0).random((4, 4, 3)).astype(np.float32)
    assert np.array_equal(sheet.blend(color.copy(), *middles(4), 0.25), color)


def test_dirt_covers_in_place_with_columns_along_u_and_rows_along_v() -> None:
    dirt = np.zeros((512, 512, 4), np.float32)
    dirt[:, 256:] = (0.1, 0.2, 0.3, 0.5)  # right half
    dirt[384:, :256] = (0.0, 0.0, 0.0, 1.0)  # bottom of the left half
    color = np.ones((4, 4, 3), np.float32)
    result = Sheet((1, 1, 1), (1, 1, 1), (1, 1, 1), (1, 1, 1), dirt).blend(color, *middles(4), 1 / 512)
    assert result is color
    assert result[:3, :2] == pytest.approx(1.0)
    assert result[3, :2] == pytest.approx(0.0)
    assert result[:, 2:] == pytest.approx(np.broadcast_to([0.6, 0.7, 0.8], (4, 2, 3)))


def test_dirt_seen_from_afar_is_averaged() -> None:
    dirt = np.zeros((512, 512, 4), np.float32)
    dirt[:, ::2, 3] = 1.0  # black and clean stripes, one texel wide
    sheet = Sheet((1, 1, 1), (1, 1, 1), (1, 1, 1), (1, 1, 1), dirt)
    near = sheet.blend(np.ones((512, 512, 3), np.float32), *middles(512), 1 / 512)
    assert near.min() == pytest.approx(0.0)
    assert near.max() == pytest.approx(1.0)
    far = sheet.blend(np.ones((33, 33, 3), np.float32), *middles(33), 1 / 33)
    assert far == pytest.approx(0.5, abs=1e-5)
    assert sheet.blend(np.ones((1, 1, 3), np.float32), *middles(1), 5.0) == pytest.approx(0.5, abs=1e-5)


def test_a_curled_sheet_is_never_steep_nor_below_the_board() -> None:
    half = PAD.extent_m / 2.0
    x, y = np.meshgrid(*2 * [np.linspace(-half, half, 25)])
    steepest = 0.0
    for seed in range(40):
        curl = random_curl(np.random.default_rng(seed), half)
        dx, dy = curl.slopes(x, y)
        step = 1e-6
        assert dx == pytest.approx((curl.height_m(x + step, y) - curl.height_m(x - step, y)) / (2 * step), abs=1e-6)
        assert dy == pytest.approx((curl.height_m(x, y + step) - curl.height_m(x, y - step)) / (2 * step), abs=1e-6)
        assert curl.height_m(x, y).min() >= 0.0
        assert curl.height_m(0.0, 0.0) == 0.0
        steepest = max(steepest, float(np.hypot(dx, dy).max()))
    assert 5.0 < math.degrees(math.atan(steepest)) <= 12.001


def test_height_keeps_the_precision_it_is_asked_in() -> None:
    sheet = random_sheet(np.random.default_rng(3), PAD, dirtiness=0.0, curled=True)
    for kind in (np.float32, np.float64):
        assert sheet.height_m(np.zeros((2, 3), kind), np.ones((2, 3), kind)).dtype == kind


def rays_down(n: int = 41, half: float = 1.0) -> tuple[np.ndarray, ...]:
    x, y = np.meshgrid(*2 * [np.linspace(-half, half, n, dtype=np.float32)])
    return x, y, np.full_like(x, -1.0)


def test_glare_is_brightest_where_the_sun_is_mirrored() -> None:
    # a ray (x, 0, -1) is mirrored to (x, 0, 1), so the sun at (0.5, 0, 1) shines back along x = 0.5
    rays = rays_down()
    sun = np.array([0.5, 0.0, 1.0]) / math.hypot(0.5, 1.0)
    smooth, rough = (glare((0, 0, 1), rays, sun, roughness) for roughness in (0.15, 0.5))
    for shine in (smooth, rough):
        row, column = np.unravel_index(int(shine.argmax()), shine.shape)
        assert (rays[0][row, column], rays[1][row, column]) == pytest.approx((0.5, 0.0), abs=1e-6)
    assert smooth.max() > 10.0 * rough.max()
    assert (smooth > smooth.max() / 2).sum() < (rough > rough.max() / 2).sum()


def test_glare_does_not_depend_on_the_length_of_the_rays() -> None:
    rays = rays_down()
    sun = np.array([0.3, 0.2, 0.93])
    longer = tuple(3.0 * r for r in rays)
    assert glare((0, 0, 1), longer, sun, 0.3) == pytest.approx(glare((0, 0, 1), rays, sun, 0.3), rel=1e-3, abs=1e-6)


def test_no_glare_from_a_sun_behind_the_sheet() -> None:
    assert not glare((0, 0, 1), rays_down(), (0.0, 0.6, -0.8), 0.3).any()


@pytest.mark.parametrize("seed", range(12))
def test_a_random_print_still_reads(seed: int) -> None:
    sheet = random_sheet(np.random.default_rng(seed), PAD, dirtiness=1.0)
    assert 0.4 < min(sheet.paper) <= max(sheet.paper) <= 1.0
    assert max(sheet.ink) < 0.12
    assert max(sheet.black) < 0.12
    blue, green, red = sheet.ring
    assert red > 1.6 * max(blue, green)


def test_the_same_state_gives_the_same_sheet() -> None:
    first, second = (random_sheet(np.random.default_rng(5), PAD, dirtiness=0.8, curled=True, glossy=True) for _ in "ab")
    assert first.dirt is not None
    assert second.dirt is not None
    assert first.dirt.tobytes() == second.dirt.tobytes()
    assert (first.paper, first.ring, first.curl, first.gloss) == (second.paper, second.ring, second.curl, second.gloss)


def test_grime_is_a_colour_under_its_coverage_and_grows_with_dirtiness() -> None:
    shares = []
    for dirtiness in (0.05, 0.4, 1.0):
        maps = [grime(np.random.default_rng(seed), dirtiness) for seed in range(6)]
        for dirt in maps:
            assert dirt.shape == (512, 512, 4)
            assert dirt.dtype == np.float32
            assert dirt.min() >= 0.0
            assert dirt[:, :, 3].max() <= 1.0
            assert (dirt[:, :, :3] <= dirt[:, :, 3:] + 1e-5).all()
        shares.append(np.mean([dirt[:, :, 3].mean() for dirt in maps]))
    assert shares[0] < 0.05 < shares[1] < shares[2] < 0.7


def test_no_dirt_when_none_is_asked_for() -> None:
    assert random_sheet(np.random.default_rng(1), PAD, dirtiness=0.0).dirt is None
