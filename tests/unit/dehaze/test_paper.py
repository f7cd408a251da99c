from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landtool.dehaze.air import Air
from landtool.dehaze.config import PaperConfig, Refinement
from landtool.dehaze.paper import PaperRecipe
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.types import Image
from tests.shared import shared_data

CONFIGS = [
    PaperConfig(subsample=s, refine=r, airlight=a)
    for s, r, a in (
        (1, "guided", "mean"),
        (4, "guided", "brightest"),
        (16, "guided", "mean"),
        (4, "matting", "mean"),
    )
]


def dehaze(image: Image, config: PaperConfig) -> Image:
    """Dehaze with every warning and every exception of arithmetic an error."""
    recipe = PaperRecipe(config)
    with np.errstate(all="raise"), warnings.catch_warnings():
        warnings.simplefilter("error")
        air = recipe.estimate(image)
        made = recipe.recover(image, air)
    assert ((air.airlight >= 0.0) & (air.airlight <= 1.0)).all()
    assert ((air.transmission > 0.0) & (air.transmission <= 1.0)).all()
    assert (air.transmission.dtype, air.transmission.shape) == (np.float32, image.shape[:2])
    assert (made.dtype, made.shape) == (np.uint8, image.shape)
    return made


def psnr_db(a: Image, b: Image) -> float:
    return float(cv2.PSNR(a, b))


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.refine}-{c.subsample}")
@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (3, 2000)])
def test_pictures_of_odd_shapes(config: PaperConfig, shape: tuple[int, int]) -> None:
    dehaze(np.random.default_rng(1).integers(0, 256, shape + (3,), np.uint8), config)


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: f"{c.refine}-{c.subsample}")
@pytest.mark.parametrize("colour", [(0, 0, 0), (255, 255, 255), (128, 128, 128), (0, 0, 255), (3, 200, 90)])
def test_a_picture_of_one_colour_stays_as_it_is(config: PaperConfig, colour: tuple[int, int, int]) -> None:
    image = np.full((40, 60, 3), colour, np.uint8)
    np.testing.assert_array_equal(dehaze(image, config), image)


@settings(max_examples=60, deadline=None)
@given(
    height=st.integers(1, 40),
    width=st.integers(1, 40),
    low=st.integers(0, 255),
    high=st.integers(0, 255),
    subsample=st.integers(1, 16),
    refine=st.sampled_from(["guided", "matting"]),
    omega=st.sampled_from((0.0, 1e-6, 0.3, 0.95, 1.0)) | st.floats(1e-6, 1.0),
    t0=st.floats(0.001, 1.0),
    seed=st.integers(0, 1000),
)
def test_any_picture_and_any_number_give_a_picture(
    height: int, width: int, low: int, high: int, subsample: int, refine: Refinement, omega: float, t0: float, seed: int
) -> None:
    values = np.random.default_rng(seed).integers(min(low, high), max(low, high) + 1, (height, width, 3))
    config = PaperConfig(subsample=subsample, refine=refine, omega=omega, t0=t0, airlight_share=omega)
    dehaze(values.astype(np.uint8), config)


def test_dense_it_is_the_five_equations() -> None:
    image = np.random.default_rng(5).integers(60, 220, (30, 40, 3), np.uint8)
    image = np.asarray(cv2.GaussianBlur(image, (0, 0), 3.0), np.uint8)
    config = PaperConfig(patch_px=5, guided_radius_px=60, subsample=1)
    air = PaperRecipe(config).estimate(image)
    padded = np.pad(image, ((2, 2), (2, 2), (0, 0)), constant_values=255)
    patches = np.lib.stride_tricks.sliding_window_view(padded, (5, 5), (0, 1))
    dark = patches.min(axis=(2, 3, 4))
    airlight = image[dark == dark.max()].mean(axis=0) / 255
    np.testing.assert_allclose(air.airlight, airlight)
    t = 1 - 0.95 * (patches / 255 / airlight[:, None, None]).min(axis=(2, 3, 4))
    # windows wider than the picture: one line for all
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) / 255
    a = ((grey * t).mean() - grey.mean() * t.mean()) / (grey.var() + 1e-3)
    np.testing.assert_allclose(air.transmission, a * (grey - grey.mean()) + t.mean(), atol=1e-5)


def foggy(count: int) -> list[Image]:
    return [make_sample(Domain(fog=1.0), PadSpec(), (320, 240), 7, i).image for i in range(count)]


def test_estimated_in_every_fourth_pixel_it_is_nearly_the_dense_one() -> None:
    agree = [psnr_db(dehaze(i, PaperConfig()), dehaze(i, PaperConfig(subsample=1))) for i in foggy(5)]
    assert np.median(agree) > 45.0
    assert min(agree) > 40.0


def test_on_the_rendered_fog_too() -> None:
    files: list[Path] = sorted(shared_data("rendered/fog").glob("fog_*.png"))[:4]
    for file in files:
        image = np.asarray(cv2.imread(str(file)), np.uint8)
        assert psnr_db(dehaze(image, PaperConfig()), dehaze(image, PaperConfig(subsample=1))) > 50.0


def test_matting_takes_the_haze_off_as_the_guided_filter_does() -> None:
    image = foggy(1)[0]
    matted = dehaze(image, PaperConfig(refine="matting"))
    assert matted.std() > image.std()
    assert psnr_db(matted, dehaze(image, PaperConfig())) > 20.0


def test_no_omega_takes_nothing_off() -> None:
    image = foggy(1)[0]
    np.testing.assert_array_equal(dehaze(image, replace(PaperConfig(), omega=0.0)), image)


def test_a_transmission_of_a_smaller_picture_is_interpolated() -> None:
    image = np.full((40, 60, 3), 100, np.uint8)
    made = PaperRecipe(PaperConfig()).recover(image, Air(np.full(3, 0.5), np.full((10, 15), 0.5, np.float32)))
    np.testing.assert_allclose(made, (100 - 127.5) / 0.5 + 127.5, atol=0.5)
