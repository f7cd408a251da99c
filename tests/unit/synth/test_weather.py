"""The weather of generated pictures."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.synth.domain import Domain
from landtool.synth.fog import KOSCHMIEDER
from landtool.synth.weather import random_fog, random_weather

ALWAYS = Domain(fog=1.0)


def test_airlight_is_as_dark_as_fog_seen_from_above() -> None:
    """By the light of the day: most of it between 0.15 and 0.45 of white, grey, and with a tail to white."""
    rng = np.random.default_rng(2)
    shares, tints = [], []
    for _ in range(2000):
        weather = random_weather(ALWAYS, rng)
        fog = random_fog(ALWAYS, weather, 5.0, rng)
        assert fog is not None
        light = np.array(fog.airlight)
        shares.append(light.mean() / weather.level)
        tints.append(np.ptp(light) / light.mean())
    low, median, high = np.percentile(shares, [5.0, 50.0, 95.0])
    assert 0.13 < low < 0.18
    assert median == pytest.approx(0.34, abs=0.03)
    assert 0.7 < high < 0.95
    assert np.mean(np.array(shares) < 0.45) > 0.6
    assert np.median(tints) < 0.12


def test_fog_leaves_a_twentieth_of_the_pads_contrast() -> None:
    rng = np.random.default_rng(3)
    for distance_m in (2.0, 12.0, 60.0):
        fogs = [random_fog(ALWAYS, random_weather(ALWAYS, rng), distance_m, rng) for _ in range(200)]
        assert min(np.exp(-fog.beta_per_m * distance_m) for fog in fogs if fog) > 0.0497
        assert min(KOSCHMIEDER / fog.beta_per_m for fog in fogs if fog) >= 14.99


def test_clear_air_has_no_fog() -> None:
    rng = np.random.default_rng(4)
    assert random_fog(Domain(fog=0.0), random_weather(Domain(), rng), 5.0, rng) is None
