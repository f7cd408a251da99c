from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landtool.dehaze import veil_recipe
from landtool.dehaze.air import Air
from landtool.dehaze.bands import bands
from landtool.dehaze.noise import quieter
from landtool.dehaze.statistics import small_copy, statistics
from landtool.dehaze.veil import Veil, estimate_veil
from landtool.dehaze.veil_recipe import VeilRecipe
from landtool.geometry import Array
from landtool.tone import Tone, decode, encode
from landtool.types import Image
from tests.shared import shared_data
from tests.unit.dehaze.hazy import drawn_fog, hazy_picture

pytestmark = [pytest.mark.usefixtures("strict"), pytest.mark.filterwarnings("error")]


@dataclass
class Calming:
    """Takes the noise down as ever, and remembers below which threshold."""

    thresholds: list[float] = field(default_factory=list)

    def __call__(self, image: Image, threshold: float, rows: slice = slice(None)) -> Image:
        self.thresholds.append(threshold)
        return quieter(image, threshold, rows)


@pytest.fixture
def calming(monkeypatch: pytest.MonkeyPatch) -> Calming:
    made = Calming()
    monkeypatch.setattr(veil_recipe, "quieter", made)
    return made


def as_it_is(image: Image, threshold: float, rows: slice) -> Image:  # noqa: ARG001
    """In the place of what takes the noise down."""
    return image[rows]


def air_of(image: Image, tone: Tone = "srgb") -> tuple[Veil, Air]:
    veil = estimate_veil(statistics(small_copy(image)))
    return veil, VeilRecipe(tone).estimate(image, veil, lambda airlight: airlight)


def dehazed(image: Image, tone: Tone = "srgb") -> Image:
    return VeilRecipe(tone).recover(image, air_of(image, tone)[1])


def slowly(image: Image, veil: Veil, threshold: float, tone: Tone = "srgb") -> Image:
    """The same in numbers of full precision, pixel by pixel."""
    values: Array = image.astype(float)
    mean = cv2.GaussianBlur(values, (5, 5), 0.0)
    d = values - mean
    light = decode((mean + d**3 / (d * d + threshold * threshold + 1e-12)) / 255.0, tone)
    t = veil.transmission(image.shape[1], image.shape[0]).astype(float)[..., None]
    clear = (light - veil.airlight) / t + veil.airlight
    return np.asarray(np.rint(255.0 * encode(np.clip(clear, 0.0, 1.0), tone)), np.uint8)


def agreement_db(image: Image, calming: Calming, tone: Tone = "srgb") -> float:
    veil, air = air_of(image, tone)
    made = VeilRecipe(tone).recover(image, air)
    with np.errstate(under="ignore"):  # the cube of no difference
        return float(cv2.PSNR(made, slowly(image, veil, calming.thresholds[-1], tone)))


def test_tables_do_what_numbers_of_full_precision_do(calming: Calming) -> None:
    pictures = [*drawn_fog(3), *(hazy_picture(seed, t) for seed, t in ((1, 0.9), (2, 0.6), (3, 0.3)))]
    agree = [agreement_db(image, calming) for image in pictures]
    assert np.median(agree) > 45.0
    assert min(agree) > 40.0


@pytest.mark.full
def test_they_do_so_on_many_pictures(calming: Calming) -> None:
    agree = [agreement_db(image, calming) for image in drawn_fog(60, (320, 240))]
    assert np.median(agree) > 45.0
    assert min(agree) > 40.0


def test_and_on_the_rendered_fog(calming: Calming) -> None:
    files = sorted(shared_data("rendered/fog").glob("fog_*.png"))[:4]
    agree = [agreement_db(np.asarray(cv2.imread(str(file)), np.uint8), calming) for file in files]
    assert np.median(agree) > 45.0
    assert min(agree) > 40.0


@pytest.mark.parametrize("tone", ["none", 1.8, 2.2, 2.6, 0.5])
def test_every_tone_curve_is_undone_and_done_again(tone: Tone, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(veil_recipe, "quieter", as_it_is)
    for image in (hazy_picture(seed, t) for seed, t in ((1, 0.9), (2, 0.6), (3, 0.3))):
        assert cv2.PSNR(dehazed(image, tone), slowly(image, air_of(image)[0], 0.0, tone)) > 45.0


def test_the_tone_curve_counts() -> None:
    image = hazy_picture(1)
    assert cv2.PSNR(dehazed(image), dehazed(image, "none")) < 35.0


@pytest.mark.parametrize("tone", ["srgb", "none", 1.8, 2.2, 2.6])
def test_without_air_the_values_stay(tone: Tone, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(veil_recipe, "quieter", as_it_is)
    image = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    made = VeilRecipe(tone).recover(image, Air(np.full(3, 0.7), np.ones((1, 80), np.float32)))
    np.testing.assert_allclose(made, image, atol=0 if tone in ("srgb", "none") else 2)


SHAPES = [(1, 1), (1, 50), (50, 1), (3, 2000), (2000, 3), (2, 2), (61, 81), (60, 80)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("levels", [(0, 256), (0, 1), (128, 129), (255, 256)], ids=["any", "black", "grey", "white"])
def test_pictures_of_odd_shapes(shape: tuple[int, int], levels: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(*levels, shape + (3,), np.uint8)
    before = image.copy()
    made = dehazed(image)
    assert made.shape == image.shape
    assert made.dtype == np.uint8
    assert not np.shares_memory(made, image)
    np.testing.assert_array_equal(image, before)


@settings(max_examples=50, deadline=None)
@given(
    height=st.integers(1, 40),
    width=st.integers(1, 40),
    low=st.integers(0, 255),
    high=st.integers(0, 255),
    lost=st.integers(1, 1000),
    slope=st.tuples(st.integers(-40, 40), st.integers(-40, 40)),
    strength=st.integers(0, 10),
    seed=st.integers(0, 1000),
)
def test_any_picture_behind_any_air_gives_a_picture(
    height: int, width: int, low: int, high: int, lost: int, slope: tuple[int, int], strength: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(min(low, high), max(low, high) + 1, (height, width, 3)).astype(np.uint8)
    before = image.copy()
    veil = Veil(rng.random(3), lost / 1000, np.array(slope) / 10, 0.5)
    recipe = VeilRecipe()
    air = recipe.estimate(image, veil, lambda airlight: airlight)
    made = recipe.recover(image, air.thinned(strength / 10))
    assert made.shape == image.shape
    assert made.dtype == np.uint8
    np.testing.assert_array_equal(image, before)


def test_a_view_of_a_picture_is_as_good_as_a_copy() -> None:
    image = hazy_picture(5)
    for view in (image[:, ::-1], image[::-1], image[3:90, 7:101], image[::2, ::3], image.transpose(1, 0, 2)):
        np.testing.assert_array_equal(dehazed(view), dehazed(np.ascontiguousarray(view)))


@pytest.mark.parametrize("rows", [1, 7, 64])
def test_bands_leave_no_seams(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    image = hazy_picture(6, height=701, width=90)
    as_ever = dehazed(image)
    assert len(list(bands(701, 90))) > 1
    for cut in ([slice(0, 701)], [slice(top, top + rows) for top in range(0, 701, rows)]):
        monkeypatch.setattr(veil_recipe, "bands", lambda *shape, cut=cut: cut)  # noqa: ARG005
        np.testing.assert_array_equal(dehazed(image), as_ever)


def test_the_map_is_no_larger_than_it_must_be_and_smooth_between() -> None:
    veil = Veil(np.full(3, 0.1), 0.5, np.array([0.4, -0.2]), 0.5)
    image = np.full((480, 640, 3), 150, np.uint8)
    air = VeilRecipe().estimate(image, veil, lambda airlight: airlight)
    assert air.transmission.size < image.size / 100
    made = VeilRecipe().recover(image, air).astype(int)
    assert np.abs(np.diff(made, axis=0)).max() <= 2
    assert np.abs(np.diff(made, axis=1)).max() <= 2


def test_behind_its_own_air_a_picture_is_as_in_clear_air(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(veil_recipe, "quieter", as_it_is)
    rng = np.random.default_rng(2)
    clear = np.rint(rng.uniform(0, 255, (60, 80, 3)))
    airlight, t = np.array([0.5, 0.45, 0.4]), 0.7
    fog = np.rint(255.0 * encode(decode(clear / 255.0, "srgb") * t + airlight * (1.0 - t), "srgb")).astype(np.uint8)
    made = VeilRecipe().recover(fog, Air(airlight, np.full((60, 80), t, np.float32)))
    error = np.abs(made - clear)
    # a grey level of fog is several where it is dark
    assert error[clear > 60].max() <= 3
    assert math.sqrt((error**2).mean()) < 3.0


def test_more_gain_takes_more_for_noise(calming: Calming) -> None:
    image = hazy_picture(7)
    recipe = VeilRecipe()
    for t in (1.0, 0.7, 0.4, 0.1):
        recipe.recover(image, Air(np.full(3, 0.4), np.full((60, 80), t, np.float32)))
    thresholds = calming.thresholds
    assert thresholds == sorted(thresholds)
    assert thresholds[0] < thresholds[-1] < 40.0
