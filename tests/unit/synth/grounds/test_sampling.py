from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landtool.synth.grounds import GroundTexture, ground_albedo, relative_detail
from landtool.synth.grounds.texture import color_atlas, factor_atlas
from landtool.tone import srgb_decode

TILE_M = 2.0
TEXELS = 64
TEXEL_M = TILE_M / TEXELS


def _ground(
    *, grain: float = 0.0, patch: float = 1.0, mirrored: bool = False, darkest: int = 0, brightest: int = 256
) -> GroundTexture:
    rng = np.random.default_rng(0)
    return GroundTexture(
        kind="test",
        detail=color_atlas(rng.integers(darkest, brightest, (TEXELS, TEXELS, 3), dtype=np.uint8), mirrored=mirrored),
        patches=factor_atlas(np.full((32, 32, 3), patch, np.float32)),
        grain=factor_atlas((1.0 + grain * rng.standard_normal((64, 64))).astype(np.float32)),
        tile_m=TILE_M,
        patch_tiles=9.3,
        grain_tile_m=TEXEL_M * 4,
    )


def _texels(ground: GroundTexture) -> np.ndarray:
    return srgb_decode(ground.detail.picture[1 : TEXELS + 1, 1 : TEXELS + 1, :3] / 255.0)


def _centres(first: int = 0, count: int = TEXELS) -> tuple[np.ndarray, np.ndarray]:
    at = (np.arange(first, first + count, dtype=np.float32) + np.float32(0.5)) * np.float32(TEXEL_M)
    x, y = np.meshgrid(at, at)
    return x, y


def _footprint(width_m: float, count: int = TEXELS) -> np.ndarray:
    return np.full((count, count), width_m, np.float32)


@pytest.mark.parametrize("tiles", [0, 3, -5])
def test_texel_centres_give_the_texels_in_every_tile(tiles: int) -> None:
    ground = _ground()
    x, y = _centres(tiles * TEXELS)
    found = ground_albedo(ground, x, y, _footprint(TEXEL_M))
    np.testing.assert_allclose(found, _texels(ground), atol=0.01)
    assert found.dtype == np.float32


def test_across_the_edge_it_blends_the_last_texel_with_the_first() -> None:
    ground = _ground()
    x, y = np.full((1, 1), TILE_M, np.float32), np.full((1, 1), TEXEL_M / 2, np.float32)
    found = ground_albedo(ground, x, y, np.full((1, 1), TEXEL_M / 2, np.float32))
    first, last = ground.detail.picture[1, 1, :3], ground.detail.picture[1, TEXELS, :3]
    np.testing.assert_allclose(found[0, 0], srgb_decode((first / 510.0) + (last / 510.0)), atol=0.01)


def test_mirrored_tiles_run_back() -> None:
    ground = _ground(mirrored=True)
    x, y = _centres(TEXELS)
    found = ground_albedo(ground, x, y, _footprint(TEXEL_M))
    np.testing.assert_allclose(found, _texels(ground)[::-1, ::-1], atol=0.01)


def test_far_away_only_the_mean_is_left_and_light_is_neither_lost_nor_won() -> None:
    ground = replace(_ground(darkest=90, brightest=170), tint=(0.5, 1.0, 1.2))
    rng = np.random.default_rng(1)
    x, y = (rng.uniform(-300, 300, (200, 200)).astype(np.float32) for _ in range(2))
    for texels, spread in ((1, 0.3), (4, 0.1), (16, 0.03), (300, 0.01)):  # a byte is 2 % of light
        found = ground_albedo(ground, x, y, _footprint(texels * TEXEL_M, 200))
        np.testing.assert_allclose(found.mean(axis=(0, 1)), ground.mean, rtol=0.03 if texels == 1 else 0.02)
        assert (found.std(axis=(0, 1)) / ground.mean).max() < spread


def test_distance_changes_the_picture_without_a_step() -> None:
    ground = _ground(grain=0.2)
    x, y = _centres()
    widths = TEXEL_M * 2.0 ** np.arange(-1.0, 4.0, 0.02)
    looks = np.stack([ground_albedo(ground, x, y, _footprint(width)) for width in widths])
    # a level's worth of change spread over fifty steps; a switch of levels would show as all of it in one
    assert np.abs(np.diff(looks, axis=0)).mean(axis=(1, 2, 3)).max() < 0.012


def test_one_picture_may_span_all_levels() -> None:
    ground = _ground()
    x, y = _centres()
    widths = np.geomspace(TEXEL_M / 4, 200 * TEXEL_M, TEXELS).astype(np.float32)
    together = ground_albedo(ground, x, y, np.repeat(widths[:, None], TEXELS, axis=1))
    for row in range(0, TEXELS, 7):
        alone = ground_albedo(ground, x, y, _footprint(float(widths[row])))
        np.testing.assert_allclose(together[row], alone[row], atol=1e-4)


def test_a_coarse_footprint_does_as_well() -> None:
    ground = _ground(grain=0.2)
    x, y = _centres()
    for shape in ((1, 1), (4, 8), (TEXELS, 1)):
        coarse = ground_albedo(ground, x, y, np.full(shape, 1.7 * TEXEL_M, np.float32))
        np.testing.assert_allclose(coarse, ground_albedo(ground, x, y, _footprint(1.7 * TEXEL_M)), atol=1e-5)


def test_grain_shows_close_by_only() -> None:
    plain, grained = _ground(), _ground(grain=0.2)
    x, y = _centres()

    def difference(width_m: float) -> float:
        scale = np.float32(width_m / TEXEL_M)
        looks = [ground_albedo(ground, x * scale, y * scale, _footprint(width_m)) for ground in (plain, grained)]
        return float(np.abs(looks[1] / looks[0].mean() - looks[0] / looks[0].mean()).mean())

    assert difference(TEXEL_M / 16) > 0.05
    assert difference(TEXEL_M * 2) == 0.0


def test_patches_and_tint_scale_the_light() -> None:
    x, y = _centres()
    plain, bright = (ground_albedo(_ground(patch=factor), x, y, _footprint(TEXEL_M)) for factor in (1.0, 1.25))
    np.testing.assert_allclose(bright, 1.25 * plain, rtol=1e-4)
    tinted = ground_albedo(replace(_ground(), tint=(0.5, 1.0, 2.0)), x, y, _footprint(TEXEL_M))
    np.testing.assert_allclose(tinted, plain * np.float32([0.5, 1.0, 2.0]), rtol=1e-4)


def test_the_horizon_does_no_harm() -> None:
    ground = _ground(grain=0.1)
    bad = np.float32([[np.inf, -np.inf, np.nan, 1e30, 5.0]])
    x, y = np.repeat(bad, 5, axis=0), np.repeat(bad.T, 5, axis=1)
    for footprint in (np.repeat(bad, 5, axis=0), np.repeat(np.abs(bad), 5, axis=0), np.zeros((5, 5), np.float32)):
        found = ground_albedo(ground, x, y, footprint)
        assert np.isfinite(found).all()
        assert found.min() >= 0.0


def test_relative_detail_is_one_on_average() -> None:
    ground = _ground()
    x, y = _centres()
    relative = relative_detail(ground, ground_albedo(ground, x, y, _footprint(TEXEL_M)))
    assert relative.shape == (TEXELS, TEXELS)
    assert relative.mean() == pytest.approx(1.0, abs=0.03)
    assert relative.std() > 0.3
