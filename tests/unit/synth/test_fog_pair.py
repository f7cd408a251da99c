"""Pairs of one scene with fog and without: the same but for the fog and the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.fog_pair import FogPair, make_fog_pair
from landtool.tone import srgb_decode
from tests.scenes import CLEAN_DOMAIN

PAD = PadSpec()
SIZE = (208, 156)
FOGGY = Domain(fog=1.0, visibility_m=(8.0, 78.0))
# an exact camera: the haze model can be checked on its pictures
EXACT = replace(CLEAN_DOMAIN, fog=1.0, visibility_m=(20.0, 60.0), height_m=(3.0, 8.0), light=(0.6, 0.8))


def pair(index: int, domain: Domain = FOGGY, seed: int = 3) -> FogPair:
    made = make_fog_pair(domain, PAD, SIZE, seed, index)
    assert made is not None
    return made


def test_the_same_number_gives_the_same_pair() -> None:
    first, other = pair(4), pair(5)
    again = pair(4)
    assert np.array_equal(first.foggy, again.foggy)
    assert np.array_equal(first.clear, again.clear)
    assert np.array_equal(first.transmission, again.transmission)
    assert not np.array_equal(first.foggy, other.foggy)
    assert not np.array_equal(first.foggy, pair(4, seed=4).foggy)


def test_clear_air_is_no_pair() -> None:
    assert make_fog_pair(replace(FOGGY, fog=0.0), PAD, SIZE, 3, 0) is None


def test_shapes_and_numbers_belong_together() -> None:
    made = pair(2, replace(FOGGY, fog_banks=0.0))
    assert made.foggy.shape == made.clear.shape == (SIZE[1], SIZE[0], 3)
    assert made.foggy.dtype == made.clear.dtype == np.uint8
    assert made.transmission.shape == (SIZE[1], SIZE[0])
    # even fog: the median pixel is as far away as the median distance says
    assert np.isclose(made.haze, 1.0 - np.exp(-made.fog.beta_per_m * made.distance_m), atol=1e-3)


def test_the_foggy_picture_is_the_clear_one_behind_the_haze_model() -> None:
    for index in range(3):
        made = pair(index, EXACT)
        clear, foggy = (srgb_decode(image / np.float32(255.0)) for image in (made.clear, made.foggy))
        t = made.transmission[..., None]
        # I = J t + A (1 - t)
        expected = clear * t + np.array(made.fog.airlight) * (1.0 - t)
        unsaturated = made.clear.max(axis=2) < 255
        assert np.median(np.abs(expected - foggy)[unsaturated]) < 0.004
        assert np.median(np.abs(clear - foggy)[unsaturated]) > 0.02


def test_only_the_foggy_picture_is_noisy() -> None:
    noisy = replace(EXACT, shot_noise=(0.05, 0.05), read_noise=(0.008, 0.008))
    made, silent = pair(1, noisy), pair(1, EXACT)
    assert np.array_equal(made.clear, silent.clear)
    assert not np.array_equal(made.foggy, silent.foggy)
