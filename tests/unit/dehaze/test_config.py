from __future__ import annotations

import math
from typing import Any

import pytest

from landtool.dehaze.config import BOUNDS, PAPER_BOUNDS, DehazeConfig, PaperConfig
from landtool.errors import UsageError


@pytest.mark.parametrize(
    ("kind", "name"), [(PaperConfig, name) for name in PAPER_BOUNDS] + [(DehazeConfig, name) for name in BOUNDS]
)
def test_numbers_lie_within_their_bounds(kind: Any, name: str) -> None:
    low, high = {**PAPER_BOUNDS, **BOUNDS}[name]
    # the gate's two numbers must not cross
    rest = {"haze_on": {"haze_off": 0.0}, "haze_off": {"haze_on": 1.0}}.get(name, {})
    for allowed in (low, high):
        assert getattr(kind(**{name: allowed, **rest}), name) == allowed
    for refused in (math.nextafter(low, -math.inf), math.nextafter(high, math.inf), -1e9, math.inf, math.nan):
        with pytest.raises(UsageError, match=f"^{name} = .* is impossible") as caught:
            kind(**{name: refused, **rest})
        assert caught.value.hint == f"give {low:g} to {high:g}"


def test_the_defaults_are_the_papers() -> None:
    paper = PaperConfig()
    assert (paper.patch_px, paper.omega, paper.t0, paper.airlight_share) == (15, 0.95, 0.1, 0.001)
    assert (paper.airlight, paper.refine) == ("mean", "guided")
    assert DehazeConfig().paper == paper


@pytest.mark.parametrize("patch_px", [2, 14, 254])
def test_a_patch_has_a_middle(patch_px: int) -> None:
    with pytest.raises(UsageError, match=rf"^patch_px = {patch_px} has no middle; give an odd number$"):
        PaperConfig(patch_px=patch_px)


def test_dehazing_ends_where_it_starts_or_below() -> None:
    assert DehazeConfig(haze_on=0.3, haze_off=0.3).haze_off == 0.3
    with pytest.raises(
        UsageError, match=r"^haze_off = 0.4 is above haze_on = 0.3; give both, haze_off not above haze_on$"
    ):
        DehazeConfig(haze_on=0.3, haze_off=0.4)
    defaults = DehazeConfig()
    assert 0.0 < defaults.haze_off < defaults.haze_on < 1.0


@pytest.mark.parametrize("tone", ["srgb", "none", "2.2", "0.1", "10"])
def test_tone_curves(tone: str) -> None:
    assert DehazeConfig(tone=tone).tone == tone


@pytest.mark.parametrize("tone", ["", "rec709", "0", "-1", "nan", "11"])
def test_no_tone_curves(tone: str) -> None:
    with pytest.raises(UsageError, match="tone curve"):
        DehazeConfig(tone=tone)
