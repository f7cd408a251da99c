from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from landtool.errors import UsageError
from landtool.synth import sensor
from landtool.synth.sensor import Sensor
from landtool.tone import srgb_encode

Linear = NDArray[np.float32]
ALL = Sensor(
    exposure=1.2,
    white_balance=(0.9, 1.0, 1.1),
    vignette=0.3,
    psf_sigma_px=0.6,
    defocus_radius_px=1.3,
    shot_variance=1e-3,
    read_variance=1e-5,
    bayer=True,
    saturation=1.2,
    gamma=1.1,
    contrast=0.3,
    sharpen=0.5,
    rescale=0.7,
    jpeg_quality=80,
)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def plain(level: float, shape: tuple[int, int] = (96, 128)) -> Linear:
    return np.full((*shape, 3), level, np.float32)


def dot(shape: tuple[int, int] = (41, 51)) -> Linear:
    light = plain(0.0, shape)
    light[shape[0] // 2, shape[1] // 2] = 1.0
    return light


def centroid(light: NDArray[Any]) -> tuple[float, float]:
    grey = light.astype(np.float64).sum(axis=2)
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
    return float((x * grey).sum() / grey.sum()), float((y * grey).sum() / grey.sum())


def test_the_ideal_sensor_is_the_srgb_curve() -> None:
    light = rng().random((64, 80, 3), np.float32) ** 3 * np.float32(1.3)
    exact = 255.0 * srgb_encode(light.astype(np.float64))
    picture = Sensor().picture(light, rng())
    assert picture.dtype == np.uint8
    # 16 bits of light: a little off the middle of two levels either may be taken
    assert np.abs(picture - exact).max() < 0.5 + 0.03


def test_the_ideal_sensor_draws_nothing_and_leaves_the_light() -> None:
    light = plain(0.4)
    generator = rng()
    before = generator.bit_generator.state
    Sensor().picture(light, generator)
    assert generator.bit_generator.state == before
    assert (light == np.float32(0.4)).all()


def test_a_sensor_leaves_the_light_as_it_was() -> None:
    light = rng().random((50, 60, 3), np.float32)
    copy = light.copy()
    ALL.picture(light, rng())
    np.testing.assert_array_equal(light, copy)


def test_the_same_generator_gives_the_same_picture() -> None:
    light = rng().random((50, 60, 3), np.float32)
    np.testing.assert_array_equal(ALL.picture(light, rng(7)), ALL.picture(light, rng(7)))
    assert (ALL.picture(light, rng(7)) != ALL.picture(light, rng(8))).mean() > 0.1


@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (33, 64)])
def test_a_picture_has_the_size_of_the_light(shape: tuple[int, int]) -> None:
    assert Sensor(shot_variance=1e-3, rescale=0.5, psf_sigma_px=0.5).picture(plain(0.5, shape), rng()).shape == (
        *shape,
        3,
    )


@pytest.mark.parametrize(
    "stage", [Sensor(psf_sigma_px=1.3), Sensor(defocus_radius_px=3.4), Sensor(sharpen=1.0), Sensor(rescale=0.5)]
)
def test_no_stage_moves_the_picture(stage: Sensor) -> None:
    light = cv2.GaussianBlur(dot((40, 52)), (0, 0), 2.5, borderType=cv2.BORDER_CONSTANT)
    # not in the middle of the picture, which scaling about a wrong point would leave where it is
    light = np.roll(light, (-7, 9), (0, 1)) / light.max() * np.float32(0.9)
    # linear, so that the weights of the centroid are light
    ideal, seen = (np.float32(sensor.tone.srgb_decode(s.picture(light, rng()) / 255.0)) for s in (Sensor(), stage))
    assert np.abs(seen - ideal).max() > 0.01
    np.testing.assert_allclose(centroid(seen), centroid(ideal), atol=0.05)


def test_the_lens_spreads_a_point_by_its_sigma() -> None:
    spread = sensor.lens_blur(dot(), 1.5, 0.0)[:, :, 0]
    x = np.arange(51) - 25.0
    assert float(spread.sum()) == pytest.approx(1.0, abs=1e-4)
    assert float((spread * x**2).sum()) == pytest.approx(1.5**2, rel=0.05)


@pytest.mark.parametrize("radius_px", [0.05, 0.5, 1.7, 4.0])
def test_a_lens_out_of_focus_makes_a_disc(radius_px: float) -> None:
    kernel = sensor.disc(radius_px)
    x = np.arange(kernel.shape[1]) - kernel.shape[1] // 2
    assert float(kernel.sum()) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_array_equal(kernel, kernel.T[::-1])
    if radius_px > 1.0:
        # along one axis the variance of a disc is r^2 / 4, and a pixel adds a little
        assert float((kernel * x**2).sum()) == pytest.approx(radius_px**2 / 4.0 + 1.0 / 12.0, rel=0.05)
        middle = kernel[kernel.shape[0] // 2, kernel.shape[1] // 2]
        assert float(middle) == pytest.approx(1.0 / (np.pi * radius_px**2), rel=0.03)


def test_exposure_and_white_balance_are_gains() -> None:
    light = sensor.expose(plain(0.2), 2.0, (0.5, 1.0, 1.5), 0.0)
    np.testing.assert_allclose(light[5, 5], [0.2, 0.4, 0.6], rtol=1e-6)


def test_a_vignette_takes_its_share_of_the_corners() -> None:
    light = sensor.expose(plain(1.0, (480, 640)), 1.0, (1.0, 1.0, 1.0), 0.4)
    assert float(light[240, 320, 1]) == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(light[[0, 0, -1, -1], [0, -1, 0, -1]], 0.6, atol=0.005)
    np.testing.assert_allclose(light, light[::-1, ::-1], atol=1e-6)
    assert (np.diff(light[240, 320:, 0]) < 0).all()


def test_noise_has_the_variance_of_the_light() -> None:
    for level in (0.0, 0.1, 0.5):
        light = plain(level, (480, 640))
        noise = sensor.noisy(light, 2e-3, 4e-5, rng()) - light
        assert float(noise.var()) == pytest.approx(2e-3 * level + 4e-5, rel=0.02)
        assert abs(float(noise.mean())) < 4.0 * float(noise.std()) / np.sqrt(noise.size) + 1e-6


def test_noise_of_neighbours_is_independent() -> None:
    light = plain(0.5, (240, 320))
    noise = (sensor.noisy(light, 1e-2, 0.0, rng()) - light).astype(np.float64)
    for other in (np.roll(noise, 1, 0), np.roll(noise, 1, 1), np.roll(noise, 1, 2), np.roll(noise, 7, 0)):
        assert abs(float((noise * other).mean() / noise.var())) < 0.02


def test_noise_of_two_pictures_is_independent() -> None:
    light, generator = plain(0.5, (240, 320)), rng()
    one, two = (sensor.noisy(light, 1e-2, 0.0, generator) - light for _ in range(2))
    assert abs(float((one * two).mean() / one.var())) < 0.02


def test_a_full_pixel_gives_no_more_than_white() -> None:
    np.testing.assert_array_equal(Sensor(exposure=4.0).picture(plain(0.9), rng()), 255)
    assert sensor.noisy(plain(7.0), 0.0, 0.0, rng()).max() == 1.0


def test_the_mosaic_and_back_keeps_plain_colours_and_slopes() -> None:
    y, x = np.mgrid[0:64, 0:80].astype(np.float32)
    light = np.dstack([0.1 + x / 100, 0.9 - y / 100, 0.05 + (x + y) / 200])
    back = sensor.demosaic(sensor.mosaic(light))
    assert back.dtype == np.float32
    np.testing.assert_allclose(back[3:-3, 3:-3], light[3:-3, 3:-3], atol=3e-5)


def test_the_mosaic_does_not_move_a_grey_spot() -> None:
    y, x = np.mgrid[0:64, 0:80]
    spot = np.exp(-((x - 37.3) ** 2 + (y - 30.6) ** 2) / (2 * 2.5**2)).astype(np.float32)
    back = sensor.demosaic(sensor.mosaic(np.dstack([spot] * 3)))
    for channel in range(3):
        np.testing.assert_allclose(centroid(back[2:-2, 2:-2, channel : channel + 1]), (35.3, 28.6), atol=0.02)


def test_noise_below_black_does_not_brighten_the_dark() -> None:
    light = sensor.noisy(sensor.mosaic(plain(0.0, (240, 320))), 0.0, 4e-5, rng())
    assert abs(float(sensor.demosaic(light).mean())) < 1e-4


def test_saturation_turns_about_grey() -> None:
    light = np.broadcast_to(np.float32([0.1, 0.3, 0.6]), (4, 5, 3)).copy()
    luma = 0.0722 * 0.1 + 0.7152 * 0.3 + 0.2126 * 0.6
    np.testing.assert_allclose(sensor.saturate(light, 0.0), luma, rtol=1e-5)
    np.testing.assert_allclose(sensor.saturate(light, 1.5), luma + 1.5 * (light - luma), rtol=1e-5)
    np.testing.assert_allclose(sensor.saturate(plain(0.3), 1.7), 0.3, rtol=1e-5)


@pytest.mark.parametrize(("gamma", "contrast"), [(1.0, 0.0), (0.7, 0.4), (1.5, -0.5), (1.0, 1.0), (2.0, -1.0)])
def test_every_tone_curve_rises_from_black_to_white(gamma: float, contrast: float) -> None:
    table = sensor.tone_table(gamma, contrast).astype(np.int16)
    assert (table[0], table[-1]) == (0, 255)
    assert (np.diff(table) >= 0).all()


def test_gamma_and_contrast_do_what_they_say() -> None:
    middle, dark, bright = (int(65535 * light) for light in (0.214, 0.05, 0.6))
    ideal = sensor.tone_table().astype(int)
    assert sensor.tone_table(1.3, 0.0)[middle] < ideal[middle] < sensor.tone_table(0.8, 0.0)[middle]
    more = sensor.tone_table(1.0, 0.5).astype(int)
    assert more[dark] < ideal[dark] - 3
    assert more[bright] > ideal[bright] + 3


def test_sharpening_overshoots_at_an_edge() -> None:
    image = np.full((20, 40, 3), 80, np.uint8)
    image[:, 20:] = 160
    sharp = sensor.sharpen(image, 1.0)
    assert sharp[10, 20, 0] > 165
    assert sharp[10, 19, 0] < 75
    np.testing.assert_array_equal(sharp[:, :10], 80)


def test_rescaling_loses_what_is_fine() -> None:
    stripes = np.zeros((40, 60, 3), np.uint8)
    stripes[:, ::2] = 200
    assert sensor.rescale(stripes, 0.5)[10:30, 10:50].std() < 5.0
    np.testing.assert_array_equal(sensor.rescale(stripes, 1.0), stripes)


def test_jpeg_is_near_or_the_picture_itself() -> None:
    image = cv2.GaussianBlur(rng().integers(0, 255, (64, 64, 3), dtype=np.uint8), (0, 0), 5)
    assert sensor.jpeg_round_trip(image, None) is image
    fine, coarse = (np.abs(sensor.jpeg_round_trip(image, q).astype(int) - image).mean() for q in (95, 5))
    assert 0.0 < fine < 2.0 < coarse


@pytest.mark.parametrize(
    "change",
    [
        {"exposure": 0.0},
        {"exposure": float("nan")},
        {"white_balance": (1.0, 0.0, 1.0)},
        {"vignette": 1.0},
        {"psf_sigma_px": -0.1},
        {"shot_variance": -1e-3},
        {"contrast": 1.5},
        {"gamma": 0.0},
        {"rescale": 1.5},
        {"jpeg_quality": 0},
    ],
)
def test_what_no_camera_does_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=next(iter(change))):
        Sensor(**change)
