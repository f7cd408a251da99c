from __future__ import annotations

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.synth.grounds import KINDS, VARIANTS, GroundKind, ground, ground_albedo, make_ground_texture
from landtool.synth.grounds.noise import cells, paving, value_noise


def _texels(kind: GroundKind) -> np.ndarray:
    texture = ground(kind, 0, 5)
    width, height, left, top = texture.detail.places[:, 0].astype(int)
    return texture.detail.picture[top : top + height, left : left + width, :3].astype(np.float32)


@pytest.mark.parametrize("kind", KINDS)
def test_a_ground_tiles_without_a_seam(kind: GroundKind) -> None:
    texels = _texels(kind)
    for axis in (0, 1):
        steps = np.abs(texels - np.roll(texels, 1, axis=axis)).mean(axis=(1 - axis, 2))
        # slot 0 is the step over the edge; it is one of the others, in paving a joint lies there as elsewhere
        assert steps[0] <= 1.2 * steps[1:].max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_ground_is_an_albedo_and_small(kind: GroundKind) -> None:
    texture = ground(kind, 0, 5)
    assert texture.size_bytes <= 12e6
    assert texture.size_bytes * VARIANTS * len(KINDS) <= 200e6
    assert (texture.mean > 0.005).all()
    assert (texture.mean < 0.95).all()
    assert _texels(kind).std() > 2.0


@pytest.mark.parametrize("kind", KINDS)
def test_repeats_do_not_show_from_high_up(kind: GroundKind) -> None:
    texture = ground(kind, 0, 5)
    size, footprint_m = 300, 0.12
    x, y = (grid.astype(np.float32) * footprint_m for grid in np.meshgrid(np.arange(size), np.arange(size)))
    footprint = np.full((size, size), footprint_m, np.float32)
    green, shifted = (
        ground_albedo(texture, x + np.float32(shift), y, footprint)[:, :, 1] for shift in (0.0, texture.tile_m)
    )
    # slow patches differ from tile to tile, and must be at least as strong as what is left of the detail
    assert np.corrcoef(green.ravel(), shifted.ravel())[0, 1] < 0.93
    assert green.std() / green.mean() > 0.01


def test_the_same_state_paints_the_same_ground_and_another_does_not() -> None:
    for kind in ("grass", "gravel"):
        first, again, other = (make_ground_texture(kind, np.random.default_rng(seed)) for seed in (3, 3, 4))
        for name in ("detail", "patches", "grain"):
            same, repeated, different = (getattr(texture, name).picture for texture in (first, again, other))
            np.testing.assert_array_equal(same, repeated)
            assert (same != different).mean() > 0.3


def test_grounds_are_kept_and_variants_differ() -> None:
    assert ground("snow", 0, 5) is ground("snow", 0, 5)
    assert (ground("snow", 0, 5).detail.picture != ground("snow", 1, 5).detail.picture).any()


def test_an_unknown_kind_is_named() -> None:
    with pytest.raises(UsageError, match=r"'lava'.*asphalt"):
        make_ground_texture("lava", np.random.default_rng(0))  # type: ignore[arg-type]


def test_noise_has_the_mean_and_spread_it_says() -> None:
    noise = value_noise(256, 4, 0.7, np.random.default_rng(0))
    assert abs(noise.mean()) < 1e-4
    assert noise.std() == pytest.approx(1.0, abs=1e-4)


def test_cells_are_those_of_the_nearest_point_over_the_edge_too() -> None:
    stones = cells(128, 8, 1.0, np.random.default_rng(1))
    assert set(np.unique(stones.number)) <= set(range(stones.count))
    assert len(np.unique(stones.number)) > 0.9 * stones.count
    # a stone on the edge goes on at the other side: of its texels there, most have the same number
    assert (stones.number[0] == stones.number[-1]).mean() > 0.6
    assert (stones.number[:, 0] == stones.number[:, -1]).mean() > 0.6
    assert stones.edge.max() > 4


def test_paving_has_as_many_stones_as_asked_all_alike() -> None:
    flags = paving(120, 6, 4, 0.0, np.random.default_rng(1), shift=0.5)
    assert np.bincount(flags.number.ravel()).tolist() == [120 * 120 // 24] * 24
