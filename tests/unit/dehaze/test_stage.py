from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import pytest

from landtool.dehaze import stage as stage_module
from landtool.dehaze.air import Air
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import Dehazed, DehazeStage
from landtool.dehaze.statistics import Statistics
from landtool.dehaze.veil import Veil
from landtool.dehaze.veil_recipe import VeilRecipe
from landtool.types import Frame, Image
from tests.unit.dehaze.hazy import developed, fogged, hazy_picture, patches

pytestmark = [pytest.mark.usefixtures("strict"), pytest.mark.filterwarnings("error")]
Kind = Literal["veil", "paper"]
RECIPES: tuple[Kind, ...] = ("veil", "paper")
GATE = DehazeConfig(haze_on=0.3, haze_off=0.2, smooth_s=0.5)
AT_ONCE = DehazeConfig(haze_on=0.3, haze_off=0.2, smooth_s=0.0)


@dataclass
class Foretold:
    """What the estimate will be: a veil of this haze before any picture."""

    haze: float = 0.5

    def __call__(self, known: Statistics) -> Veil:  # noqa: ARG002
        return Veil(np.array([0.1, 0.1, 0.12]), 0.4, np.zeros(2), self.haze)


@pytest.fixture
def foretold(monkeypatch: pytest.MonkeyPatch) -> Foretold:
    made = Foretold()
    monkeypatch.setattr(stage_module, "estimate_veil", made)
    return made


def frame(image: Image, t_s: float | None = None) -> Frame:
    return Frame(0, None if t_s is None else round(t_s * 1e9), image)


def see_all(stage: DehazeStage, images: Iterable[Image], fps: float = 30.0) -> list[Dehazed]:
    return [stage.see(frame(image, index / fps)) for index, image in enumerate(images)]


def lost(made: Dehazed) -> float:
    """Share of the light taken for lost: 0 where the frame was left alone."""
    return 0.0 if made.transmission is None else 1.0 - float(made.transmission.mean())


def test_a_clear_frame_passes_as_it_is() -> None:
    image = developed(patches(2))
    made = DehazeStage(GATE).see(frame(image, 0.0))
    assert made.image is image
    assert (made.dehazed, made.transmission) == (False, None)
    assert made.haze < 0.2


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_hazy_frame_is_dehazed(recipe: Kind) -> None:
    image = hazy_picture(1, 0.5)
    before = image.copy()
    made = DehazeStage(DehazeConfig(recipe=recipe)).see(frame(image, 0.0))
    assert made.dehazed
    assert made.image.std() > 1.3 * image.std()
    assert made.haze > 0.5
    assert made.transmission is not None
    assert 0.0 < made.transmission.min() <= made.transmission.max() <= 1.0
    np.testing.assert_array_equal(image, before)


def test_it_gets_nearer_to_the_clear_picture() -> None:
    gains = []
    for seed in range(6):
        clear, fog = developed(patches(seed)), hazy_picture(seed, 0.6)
        made = DehazeStage(DehazeConfig()).see(frame(fog)).image
        gains.append(cv2.PSNR(made, clear) - cv2.PSNR(fog, clear))
    assert np.median(gains) > 2.0


def test_on_dehazes_clear_frames_too(foretold: Foretold) -> None:
    foretold.haze = 0.0
    image = developed(patches(2))
    assert not DehazeStage(GATE).see(frame(image)).dehazed
    assert DehazeStage(GATE, when="on").see(frame(image)).dehazed


def test_between_off_and_on_the_gate_stays_as_it_was(foretold: Foretold) -> None:
    stage, image = DehazeStage(AT_ONCE), hazy_picture(1)
    was = []
    for index, foretold.haze in enumerate((0.25, 0.31, 0.25, 0.21, 0.19, 0.25, 0.29, 0.31)):
        was.append(stage.see(frame(image, index / 30)).dehazed)
    assert was == [False, True, True, True, False, False, False, True]


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0, 240.0])
def test_smoothing_goes_by_time_and_not_by_frames(fps: float, foretold: Foretold) -> None:
    stage, image = DehazeStage(DehazeConfig(smooth_s=0.4), when="on"), hazy_picture(1)
    foretold.haze = 0.9
    stage.see(frame(image, 0.0))
    foretold.haze = 0.3
    count = round(0.6 * fps)
    made = [stage.see(frame(image, (index + 1) / fps)) for index in range(count)]
    assert made[-1].haze == pytest.approx(0.3 + 0.6 * math.exp(-0.6 / 0.4), abs=1e-6)


@pytest.mark.parametrize("recipe", RECIPES)
def test_thickening_fog_looks_the_same_at_any_frame_rate(recipe: Kind) -> None:
    def last(fps: float) -> Dehazed:
        stage = DehazeStage(DehazeConfig(recipe=recipe), when="on")
        stage.see(frame(hazy_picture(1, 0.6), 0.0))
        thick = hazy_picture(1, 0.52)  # no cut
        return [stage.see(frame(thick, (index + 1) / fps)) for index in range(round(0.5 * fps))][-1]

    slow, fast = last(30.0), last(60.0)
    assert fast.haze == pytest.approx(slow.haze, abs=1e-6)
    assert np.abs(fast.image.astype(int) - slow.image).max() <= 1


@pytest.mark.parametrize("recipe", RECIPES)
def test_after_a_cut_nothing_is_remembered(recipe: Kind) -> None:
    config = DehazeConfig(recipe=recipe)
    stage = DehazeStage(config)
    see_all(stage, [hazy_picture(1, 0.4)] * 3)
    other = developed(0.3 * fogged(patches(3), 0.5))
    made, fresh = stage.see(frame(other, 0.1)), DehazeStage(config).see(frame(other, 0.1))
    assert made.dehazed
    assert made.haze == fresh.haze
    np.testing.assert_array_equal(made.image, fresh.image)


def test_after_a_cut_the_gate_is_as_at_the_start(foretold: Foretold) -> None:
    stage = DehazeStage(GATE)
    foretold.haze = 0.6
    assert stage.see(frame(hazy_picture(1, 0.4), 0.0)).dehazed
    foretold.haze = 0.25
    other = developed(0.3 * patches(3))
    assert stage.see(frame(other, 0.03)).image is other
    assert not stage.see(frame(other, 0.06)).dehazed


def test_an_airlight_is_forgotten_while_nothing_is_dehazed(foretold: Foretold, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage_module, "_CUT", 2.0)  # the light changes, but not the scene
    config = DehazeConfig(recipe="paper", haze_on=0.3, haze_off=0.2)
    stage, fresh = DehazeStage(config), DehazeStage(config)
    bright, dim = hazy_picture(1, 0.5), developed(0.3 * fogged(patches(1), 0.5))
    stage.see(frame(bright, 0.0))
    foretold.haze = 0.1
    assert not [stage.see(frame(dim, t)) for t in (10.0, 20.0)][-1].dehazed
    foretold.haze = 0.6
    made = [stage.see(frame(dim, t)) for t in (20.1, 20.2, 20.3, 20.4, 20.5, 20.6, 21.2)]
    assert made[-1].dehazed
    np.testing.assert_array_equal(made[-1].image, fresh.see(frame(dim, 0.0)).image)


def test_a_cut_to_a_scene_that_is_left_alone_forgets_the_airlight_too(foretold: Foretold) -> None:
    config = DehazeConfig(recipe="paper", haze_on=0.3, haze_off=0.2, smooth_s=0.5)
    stage, fresh = DehazeStage(config), DehazeStage(config)
    stage.see(frame(hazy_picture(1, 0.4), 0.0))
    dim = developed(0.3 * fogged(patches(3), 0.5))
    foretold.haze = 0.1
    for one in (stage, fresh):
        assert not one.see(frame(dim, 0.1)).dehazed
    foretold.haze = 0.9
    for t in (0.3, 0.5, 0.7):
        made, wanted = stage.see(frame(dim, t)), fresh.see(frame(dim, t))
        assert made.dehazed == wanted.dehazed
        np.testing.assert_array_equal(made.image, wanted.image)
    assert made.dehazed


@pytest.mark.parametrize("recipe", RECIPES)
def test_pictures_without_a_time_know_nothing_of_each_other(recipe: Kind) -> None:
    images = [hazy_picture(1, 0.4), hazy_picture(1, 0.45), developed(patches(2)), hazy_picture(3, 0.8)]
    config = DehazeConfig(recipe=recipe)
    alone = [DehazeStage(config).see(frame(image)) for image in images]
    for order in itertools.permutations(range(len(images))):
        stage = DehazeStage(config)
        for index in order[:3]:
            made = stage.see(frame(images[index]))
            assert made.haze == alone[index].haze
            np.testing.assert_array_equal(made.image, alone[index].image)


def test_times_that_stand_still_or_go_back_change_nothing(foretold: Foretold) -> None:
    stage, image = DehazeStage(GATE), hazy_picture(1)
    foretold.haze = 0.8
    first = stage.see(frame(image, 1.0))
    foretold.haze = 0.4
    for t in (1.0, 1.0, 0.2, 0.2, -3.0):
        made = stage.see(frame(image, t))
        assert made.haze == pytest.approx(first.haze)
        np.testing.assert_array_equal(made.image, first.image)
    # and time goes on from there
    assert stage.see(frame(image, -2.5)).haze == pytest.approx(0.4 + 0.4 * math.exp(-1.0))


@pytest.mark.parametrize("recipe", RECIPES)
def test_frames_may_change_their_size(recipe: Kind) -> None:
    stage = DehazeStage(DehazeConfig(recipe=recipe), when="on")
    image = hazy_picture(1)
    sizes = [(160, 120), (80, 60), (320, 200), (33, 17), (160, 120), (1, 1), (1, 60), (2000, 3)]
    for index, size in enumerate(sizes):
        sized = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        made = stage.see(frame(sized, index / 30))
        assert made.dehazed
        assert made.image.shape == sized.shape
        assert made.image.dtype == np.uint8


def test_dehazing_fades_in_and_out(foretold: Foretold) -> None:
    stage, image = DehazeStage(GATE), hazy_picture(1)
    foretold.haze = 0.0
    stage.see(frame(image, 0.0))
    foretold.haze = 1.0
    rising = [stage.see(frame(image, 0.1 * (index + 1))) for index in range(10)]
    strengths = [lost(made) / 0.4 for made in rising]
    begun = next(index for index, made in enumerate(rising) if made.dehazed)
    np.testing.assert_allclose(strengths[begun : begun + 5], [0.2, 0.4, 0.6, 0.8, 1.0], atol=1e-3)
    assert all(made.image is image for made in rising[:begun])
    assert strengths[-1] == pytest.approx(1.0)
    changes = [float(np.abs(made.image.astype(float) - image).mean()) for made in rising[begun:]]
    assert (np.diff(changes)[:4] > 0.0).all()
    foretold.haze = 0.0
    falling = [stage.see(frame(image, 1.1 + 0.1 * index)) for index in range(20)]
    strengths = [lost(made) / 0.4 for made in falling]
    assert (np.diff(strengths) <= 1e-6).all()
    assert np.diff(strengths).min() > -0.21
    assert falling[-1].image is image
    assert not falling[-1].dehazed


def test_a_fade_that_turns_back_does_not_jump(foretold: Foretold) -> None:
    stage, image = DehazeStage(DehazeConfig(haze_on=0.3, haze_off=0.3, smooth_s=0.2)), hazy_picture(1)
    strengths = []
    for index, foretold.haze in enumerate([0.0] * 5 + [1.0] * 5 + [0.0] * 8 + [1.0] * 20):
        strengths.append(lost(stage.see(frame(image, index / 30))) / 0.4)
    assert max(strengths) == pytest.approx(1.0)
    assert np.abs(np.diff(strengths)).max() < 1 / 30 / 0.2 + 1e-3


@pytest.mark.parametrize("transmission", [0.7, 0.4])
@pytest.mark.parametrize("when", ["auto", "on"])
def test_a_flickering_light_flickers_no_more(transmission: float, when: Literal["auto", "on"]) -> None:
    for seed in (0, 1):
        before, after = brightness(seed, transmission, flicker=0.02, noise=2.0, when=when)
        assert np.abs(np.diff(after)).sum() <= 1.2 * np.abs(np.diff(before)).sum()


@pytest.mark.parametrize("transmission", [0.7, 0.4])
def test_noise_alone_does_not_flicker_to_be_seen(transmission: float) -> None:
    # its own mean changes by a hundredth of a grey level, which 1 / t makes more
    for seed in (0, 1):
        _, after = brightness(seed, transmission, flicker=0.0, noise=2.0, when="auto")
        assert np.abs(np.diff(after)).max() < 0.15
        assert abs(after[-1] - after[0]) < 1.0


def brightness(
    seed: int, transmission: float, *, flicker: float, noise: float, when: Literal["auto", "on"]
) -> tuple[Sequence[float], Sequence[float]]:
    """Mean brightness before and after, of frames of a camera that stands still before fog."""
    rng = np.random.default_rng(seed)
    light = fogged(patches(seed), transmission)
    images = [developed(light * (1.0 + flicker * rng.uniform(-1, 1)), noise, rng) for _ in range(16)]
    made = see_all(DehazeStage(DehazeConfig(), when=when), images)
    assert all(m.dehazed for m in made)
    return [float(i.mean()) for i in images], [float(m.image.mean()) for m in made]


@pytest.mark.parametrize("recipe", RECIPES)
def test_no_strength_takes_next_to_nothing_off(recipe: Kind) -> None:
    image = hazy_picture(1)
    made = DehazeStage(DehazeConfig(recipe=recipe, strength=0.0), when="on").see(frame(image))
    # the veil's recipe may still take noise off
    assert np.abs(made.image.astype(int) - image).max() <= 3
    assert abs(made.image.mean() - image.mean()) < 0.2


def test_half_the_strength_lies_between() -> None:
    image = hazy_picture(1)
    spread = [
        DehazeStage(DehazeConfig(strength=strength), when="on").see(frame(image)).image.std()
        for strength in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    assert (np.diff(spread) > 0.5).all()


@pytest.mark.parametrize("when", ["auto", "on"])
@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize("level", [0, 128, 255])
def test_pictures_of_one_grey(level: int, recipe: Kind, when: Literal["auto", "on"]) -> None:
    stage = DehazeStage(DehazeConfig(recipe=recipe), when=when)
    for made in see_all(stage, [np.full((20, 30, 3), level, np.uint8)] * 3):
        assert made.image.shape == (20, 30, 3)
        assert made.image.dtype == np.uint8
        assert 0.0 <= made.haze <= 1.0


@pytest.mark.parametrize("value", [0, 60, 128, 255])
def test_an_even_picture_stays_as_it_is(value: int) -> None:
    image = np.full((60, 80, 3), value, np.uint8)
    assert DehazeStage(DehazeConfig()).see(frame(image, 0.0)).image is image
    np.testing.assert_array_equal(DehazeStage(DehazeConfig(), when="on").see(frame(image, 0.0)).image, image)


def test_the_picture_is_made_once_and_only_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    recover, calls = VeilRecipe.recover, []

    def counted(recipe: VeilRecipe, image: Image, air: Air) -> Image:
        calls.append(threading.get_ident())
        time.sleep(0.01)  # so that the others arrive while it is made
        return recover(recipe, image, air)

    monkeypatch.setattr(VeilRecipe, "recover", counted)
    made = DehazeStage(DehazeConfig(), when="on").see(frame(hazy_picture(1), 0.0))
    assert made.dehazed
    assert made.haze > 0.0
    assert not calls
    with ThreadPoolExecutor(4) as pool:
        images = list(pool.map(lambda _: made.image, range(8)))
    assert len(calls) == 1
    assert all(image is images[0] for image in images)


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_picture_nobody_asked_for_changes_no_later_one(recipe: Kind) -> None:
    images = [hazy_picture(1, 0.3 + 0.05 * k) for k in range(5)]
    stages = [DehazeStage(DehazeConfig(recipe=recipe), when="on") for _ in range(2)]
    every = [made.image for made in see_all(stages[0], images)]
    last = see_all(stages[1], images)[-1]
    np.testing.assert_array_equal(last.image, every[-1])


def test_what_hinders_a_picture_is_said_each_time_it_is_asked_for() -> None:
    def fail() -> Image:
        raise ValueError("too dark")

    made = Dehazed(fail, 0.5, True)
    for _ in range(2):
        with pytest.raises(ValueError, match="too dark"):
            _ = made.image


def test_clear_frames_are_looked_at_again_after_a_while() -> None:
    clear, fog = np.full((60, 80, 3), 40, np.uint8), np.full((60, 80, 3), 200, np.uint8)
    clear[::2, ::3] = (10, 90, 160)
    stage = DehazeStage(DehazeConfig(haze_on=0.5, haze_off=0.4, smooth_s=0.0, again_s=0.1))
    first = stage.see(frame(clear, 0.0))
    assert first.haze < 0.25
    soon, later = stage.see(frame(fog, 0.05)), stage.see(frame(fog, 0.12))
    assert (soon.haze, soon.dehazed) == (first.haze, False)
    assert later.haze != first.haze
    assert DehazeStage(DehazeConfig(haze_on=0.5, haze_off=0.4, smooth_s=0.0)).see(frame(fog, 0.05)).haze == later.haze
