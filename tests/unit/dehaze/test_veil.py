from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landtool.dehaze.statistics import small_copy, statistics
from landtool.dehaze.veil import LEAST_TRANSMISSION, Veil, estimate_veil
from landtool.types import Image
from tests.unit.dehaze.hazy import AIR, hazy_picture

pytestmark = [pytest.mark.usefixtures("strict"), pytest.mark.filterwarnings("error")]
FOGS = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)  # transmissions


def estimate(image: Image) -> Veil:
    return estimate_veil(statistics(small_copy(image)))


def some_veil(**change: object) -> Veil:
    numbers = {"veil": np.array([0.1, 0.2, 0.3]), "lost": 0.4, "slope": np.array([0.5, -0.25]), "haze": 0.6}
    return Veil(**{**numbers, **change})  # type: ignore[arg-type]


def test_more_fog_is_more_haze() -> None:
    hazes = np.array([[estimate(hazy_picture(seed, t)).haze for t in FOGS] for seed in range(8)])
    assert (np.diff(hazes.mean(axis=0)) > 0.02).all()
    assert hazes[:, 0].max() < 0.2
    assert hazes[:, -1].min() > 0.5


def test_the_veil_gets_nearer_to_the_airlight() -> None:
    veils = np.array([[estimate(hazy_picture(seed, t)).veil for t in FOGS] for seed in range(8)]).mean(axis=0)
    assert (np.diff(veils, axis=0) > 0.0).all()
    # of the thickest, within a quarter of what it is
    np.testing.assert_allclose(veils[-1], AIR * (1.0 - FOGS[-1]), rtol=0.25)


@pytest.mark.parametrize(
    "image",
    [
        *(np.full((40, 60, 3), level, np.uint8) for level in (0, 1, 128, 254, 255)),
        *(np.full((40, 60, 3), colour, np.uint8) for colour in ((255, 0, 0), (0, 0, 255))),
        *(np.random.default_rng(1).integers(0, 256, s + (3,), np.uint8) for s in ((1, 1), (3, 2000))),
    ],
)
def test_of_any_picture_it_is_possible(image: Image) -> None:
    veil = estimate(image)
    assert (veil.veil >= 0.0).all()
    assert (veil.veil <= 1.1).all()
    assert 0.0 < veil.lost < 1.0
    assert 0.0 <= veil.haze <= 1.0
    assert np.isfinite(veil.slope).all()
    assert np.isfinite(veil.airlight).all()


def test_what_endless_air_shows_is_lost_in_the_same_share() -> None:
    veil = estimate(hazy_picture(1))
    np.testing.assert_allclose(veil.airlight * veil.lost, veil.veil)


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (81, 61), (4, 3)])
def test_transmission_of_any_size(size: tuple[int, int]) -> None:
    t = some_veil().transmission(*size)
    assert t.shape == size[::-1]
    assert t.dtype == np.float32
    assert t[size[1] // 2, size[0] // 2] == pytest.approx(0.6, abs=0.16)


def test_transmission_is_what_the_air_leaves() -> None:
    lost = 1.0 - some_veil().transmission(5, 3).astype(float)
    assert lost[1, 2] == pytest.approx(0.4)
    np.testing.assert_allclose(lost[1], 0.4 * np.exp(0.5 * np.linspace(-1, 1, 5)), rtol=1e-5)
    np.testing.assert_allclose(lost[:, 2], 0.4 * np.exp(-0.25 * np.linspace(-1, 1, 3)), rtol=1e-5)
    # however steep: from a fifth of the middle's to five times as much
    np.testing.assert_allclose(some_veil(lost=0.1, slope=np.array([5.0, 0.0])).transmission(3, 1), [[0.98, 0.9, 0.5]])
    assert some_veil(slope=np.zeros(2)).transmission(1, 1)[0, 0] == pytest.approx(0.6)


@settings(max_examples=60, deadline=None)
@given(
    width=st.integers(1, 90),
    height=st.integers(1, 70),
    lost=st.floats(1e-3, 1.0),
    right=st.integers(-200, 200),
    down=st.integers(-200, 200),
)
def test_transmission_stays_in_range(width: int, height: int, lost: float, right: int, down: int) -> None:
    t = some_veil(lost=lost, slope=np.array([right, down]) / 10).transmission(width, height)
    assert t.min() >= np.float32(LEAST_TRANSMISSION)
    assert t.max() <= 1.0


def test_lit_changes_the_light_and_nothing_else() -> None:
    veil = some_veil()
    lit = veil.lit(2.0)
    np.testing.assert_allclose(lit.veil, [0.2, 0.4, 0.6])
    np.testing.assert_allclose(lit.airlight, 2.0 * veil.airlight)
    assert (lit.lost, lit.haze) == (veil.lost, veil.haze)
    np.testing.assert_array_equal(lit.slope, veil.slope)
    np.testing.assert_array_equal(veil.lit(1.0).veil, veil.veil)
    np.testing.assert_allclose(veil.lit(3.0).lit(1 / 3.0).veil, veil.veil)


def test_towards_goes_from_one_to_the_other_but_for_what_noise_moves() -> None:
    one = some_veil()
    other = Veil(one.veil * 1.2, one.lost + 0.05, one.slope - 0.04, one.haze + 0.04)
    assert one.towards(other, 1.0) is other
    assert one.towards(other, 0.0) is one
    for share in (0.25, 0.9):
        made = one.towards(other, share)
        np.testing.assert_allclose(made.veil, one.veil * (1.0 + share * 0.17))
        assert made.lost == pytest.approx(one.lost + share * 0.02)
        np.testing.assert_allclose(made.slope, one.slope - share * 0.01)
        assert made.haze == pytest.approx(one.haze + share * 0.04)


def test_towards_is_never_far_behind() -> None:
    one = some_veil()
    other = Veil(np.array([0.9, 0.9, 0.9]), 0.9, np.array([-0.5, 0.75]), 0.1)
    made = one.towards(other, 0.01)
    for reached, wanted in ((made.veil, other.veil), (made.lost, other.lost), (made.slope, other.slope)):
        assert np.abs(np.asarray(reached) - wanted).max() == pytest.approx(0.06)
    assert made.haze == pytest.approx(one.haze + 0.01 * (0.1 - one.haze))


def test_towards_stays_where_it_is_for_a_step_of_noise() -> None:
    one = some_veil()
    near = Veil(one.veil * 1.02, one.lost - 0.02, one.slope + 0.02, one.haze)
    made = one.towards(near, 0.5)
    np.testing.assert_array_equal(made.veil, one.veil)
    np.testing.assert_array_equal(made.slope, one.slope)
    assert made.lost == one.lost
