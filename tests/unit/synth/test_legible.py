"""A print counts as legible while an eye can make it out, whatever it is that hides it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.pad import PadSpec
from landtool.synth import make_sample as module
from landtool.synth.compose import Linear, Rendered
from landtool.synth.domain import Domain
from landtool.synth.fog import Fog
from landtool.synth.legible import LEAST_LEGIBLE, legibility
from landtool.synth.make_sample import make_sample
from landtool.synth.photograph import light_of
from landtool.synth.random_scene import draw_scene
from landtool.synth.sensor import Sensor, jpeg_round_trip
from landtool.types import Image
from tests.scenes import CLEAN_DOMAIN

PAD = PadSpec()
SIZE, SMALL = (320, 240), (208, 156)
CLEAR = Sensor(psf_sigma_px=0.4)
DIM = replace(CLEAR, exposure=0.05)


@cache
def seen(height_m: float) -> tuple[Linear, Rendered]:
    """Return the light and the geometry of a pad on the ground, seen from straight above."""
    domain = replace(
        CLEAN_DOMAIN, height_m=(height_m, height_m), tilt_deg=(0.0, 0.0), hfov_deg=(70.0, 70.0), distortion=0.0,
        on_vehicle=0.0, on_box=0.0, on_deck=0.0, overcast=1.0,
    )  # fmt: skip
    drawn = draw_scene(domain, PAD, SIZE, (), np.random.default_rng(3))
    return light_of(drawn.scene, drawn.view)


def taken(height_m: float, sensor: Sensor, fog: Fog | None = None) -> float:
    """Return the legibility of the picture a sensor takes through fog."""
    linear, rendered = seen(height_m)
    if fog is not None:
        linear = fog.apply(linear.copy(), fog.transmission(rendered.distance_m))
    return legibility(sensor.picture(linear, np.random.default_rng(1)), rendered, PAD)


@pytest.mark.parametrize("height_m", [1.0, 3.0, 10.0, 20.0])
def test_clear_pads_are_legible_however_small(height_m: float) -> None:
    assert taken(height_m, CLEAR) > 3.0 * LEAST_LEGIBLE


@pytest.mark.parametrize("height_m", [1.0, 3.0, 10.0, 20.0])
@pytest.mark.parametrize(
    ("name", "sensor", "fog"),
    [
        ("light without a print in it", CLEAR, Fog(50.0, (0.5, 0.5, 0.5))),
        ("burnt out", replace(CLEAR, exposure=1e4), None),
        ("black", replace(CLEAR, exposure=1e-4), None),
        ("noise", replace(CLEAR, exposure=0.01, read_variance=0.3**2), None),
    ],
)
def test_what_nobody_can_see_is_not_legible(height_m: float, name: str, sensor: Sensor, fog: Fog | None) -> None:
    assert taken(height_m, sensor, fog) < LEAST_LEGIBLE, name


def test_it_falls_with_fog_noise_and_blur() -> None:
    clear = taken(10.0, CLEAR)
    fogs = [taken(10.0, CLEAR, Fog(beta, (0.3, 0.3, 0.3))) for beta in (0.05, 0.15, 0.3, 0.5)]
    noises = [taken(10.0, replace(DIM, read_variance=s * s)) for s in (0.02, 0.05, 0.1, 0.2)]
    blurs = [taken(10.0, replace(CLEAR, defocus_radius_px=r)) for r in (1.0, 2.0, 4.0)]
    for values in (fogs, noises, blurs):
        assert [clear, *values] == sorted([clear, *values], reverse=True)
        assert values[0] > LEAST_LEGIBLE > values[-1]


def test_the_same_noise_drowns_a_small_pad_and_not_a_large_one() -> None:
    noisy = replace(DIM, read_variance=0.05**2)
    assert taken(16.0, noisy) < LEAST_LEGIBLE < taken(2.0, noisy)


def test_jpeg_drowns_a_faint_print() -> None:
    """Eight per cent of the contrast of a pad of 23 pixels."""
    linear, rendered = seen(10.0)
    fog = Fog(0.25, (0.3, 0.3, 0.3))
    image = CLEAR.picture(fog.apply(linear.copy(), fog.transmission(rendered.distance_m)), np.random.default_rng(1))
    assert legibility(jpeg_round_trip(image, 15), rendered, PAD) < LEAST_LEGIBLE < legibility(image, rendered, PAD)


def test_a_blank_sheet_is_no_pad_and_a_shadow_no_print() -> None:
    linear, rendered = seen(4.0)
    sheet = rendered.seen.sheet
    assert sheet is not None
    image = CLEAR.picture(linear, np.random.default_rng(1))
    blank = image.copy()
    blank[sheet.window] = 200
    assert legibility(blank, rendered, PAD) < LEAST_LEGIBLE
    shaded = blank.copy()
    shaded[:, : (sheet.box[0] + sheet.box[2]) // 2] = 60
    # a wide shadow's edge, as that of a tree
    soft = np.asarray(cv2.GaussianBlur(shaded, (0, 0), 12.0), np.uint8)
    assert legibility(soft, rendered, PAD) < LEAST_LEGIBLE
    half = np.asarray(image * (soft.astype(np.float32) / 200.0), np.uint8)
    assert legibility(half, rendered, PAD) > 3.0 * LEAST_LEGIBLE


def test_a_pad_without_a_ring_or_out_of_the_picture_has_no_legibility() -> None:
    linear, rendered = seen(4.0)
    image = CLEAR.picture(linear, np.random.default_rng(1))
    assert legibility(image, rendered, replace(PAD, ring=None)) == 0.0
    nowhere = replace(rendered, seen=replace(rendered.seen, sheet=None))
    assert legibility(image, nowhere, PAD) == 0.0


MURKY = Domain(
    height_m=(6.0, 14.0), absent=0.0, fog=1.0, visibility_m=(20.0, 30.0), light=(0.25, 0.5), shot_noise=(0.03, 0.05)
)


def test_no_picture_of_a_murky_domain_is_of_an_invisible_pad(monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[float] = []

    def spy(image: Image, rendered: Rendered, pad: PadSpec) -> float:
        judged.append(legibility(image, rendered, pad))
        return judged[-1]

    monkeypatch.setattr(module, "legibility", spy)
    rejected = 0
    for index in range(8):
        judged.clear()
        first = make_sample(MURKY, PAD, SMALL, 1, index)
        assert judged[-1] >= LEAST_LEGIBLE
        assert max(judged[:-1], default=0.0) < LEAST_LEGIBLE
        rejected += len(judged) - 1
        if len(judged) > 1:
            assert make_sample(MURKY, PAD, SMALL, 1, index).jpeg == first.jpeg
    assert rejected > 8


def test_pictures_without_a_pad_are_not_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "legibility", lambda *_: 0.0)
    assert not make_sample(replace(MURKY, absent=1.0), PAD, SMALL, 1, 0).truth.present


def test_a_domain_in_which_nobody_sees_the_pad_is_refused() -> None:
    night = replace(MURKY, light=(0.01, 0.01), shot_noise=(0.2, 0.2), read_noise=(0.1, 0.1), height_m=(12.0, 14.0))
    with pytest.raises(UsageError, match=r"picture 7: in 50 scenes .* nobody could make out the pad"):
        make_sample(night, PAD, SMALL, 1, 7)
