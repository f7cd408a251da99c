from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.synth.fog import Fog, Map
from landtool.synth.sensor import Sensor
from landtool.tone import srgb_decode
from tests.shared import shared_data

AIR = (0.70, 0.66, 0.60)
BANKS = Fog(0.05, AIR, bank_strength=0.8, bank_scale_m=20.0, bank_seed=3)


def scene(seed: int = 0) -> tuple[Map, Map]:
    """Return light and distance of a picture of all colours, near and far, with a strip of nothing on top."""
    rng = np.random.default_rng(seed)
    light = cv2.resize(rng.random((24, 32, 3), np.float32), (128, 96), interpolation=cv2.INTER_NEAREST)
    distance = np.float32(np.linspace(40.0, 1.0, 96)[:, None] * np.ones(128))
    distance[:8] = np.inf
    return np.asarray(light, np.float32), distance


def test_at_the_visibility_two_percent_of_the_contrast_is_left() -> None:
    t = Fog.of_visibility(80.0).transmission(np.float32([[80.0]]))
    assert float(t[0, 0]) == pytest.approx(0.02, rel=1e-3)


def test_visibility_and_extinction_are_told_from_each_other() -> None:
    assert Fog.of_visibility(80.0).visibility_m == pytest.approx(80.0)
    assert Fog.of_visibility(math.inf).beta_per_m == 0.0
    assert Fog(0.0).visibility_m == math.inf


@pytest.mark.parametrize("fog", [Fog(0.0), Fog(0.03), BANKS])
def test_nothing_gets_through_from_an_infinite_distance(fog: Fog) -> None:
    distance = np.float32([[0.0, np.inf, 5.0]])
    place = np.float32([[0.0, np.inf, 3.0]])
    t = fog.transmission(distance, place, place)
    assert t.dtype == np.float32
    assert t[0, 0] == 1.0
    assert t[0, 1] == 0.0
    assert 0.0 < t[0, 2] <= 1.0


def test_the_haze_model_is_applied_in_place() -> None:
    light, distance = scene()
    fog = Fog(0.05, AIR)
    t = fog.transmission(distance)
    expected = light * t[:, :, None] + np.array(AIR) * (1.0 - t[:, :, None])
    assert fog.apply(light, t) is light
    np.testing.assert_allclose(light, expected, atol=1e-6)
    np.testing.assert_allclose(light[:8], np.broadcast_to(np.float32(AIR), (8, 128, 3)), atol=1e-7)


def test_light_that_cannot_be_changed_in_place_is_refused() -> None:
    with pytest.raises(ValueError, match="copy"):
        Fog(0.05).apply(np.zeros((9, 8, 3), np.float32)[:, ::2], np.ones((9, 4), np.float32))


def test_unrounded_fog_is_inverted_exactly() -> None:
    light, distance = scene()
    t = BANKS.transmission(distance, distance, distance)
    foggy = BANKS.apply(light.copy(), t)
    clear = BANKS.invert(foggy, t)
    seen = t > 0.0
    np.testing.assert_allclose(clear[seen], light[seen], atol=2e-6)
    np.testing.assert_allclose(clear[~seen], np.broadcast_to(np.float32(AIR), clear[~seen].shape), atol=1e-6)


def in_fog(seed: int) -> tuple[Map, Fog, Map]:
    """Return light, a fog, and its transmission."""
    light, distance = scene(seed)
    fog = Fog(0.05, AIR, bank_strength=0.6, bank_seed=seed)
    return light, fog, fog.transmission(distance, 3.0 * distance, distance)


@pytest.mark.parametrize("seed", range(4))
def test_the_clear_picture_comes_back_through_any_fog(seed: int) -> None:
    light, fog, t = in_fog(seed)
    rng = np.random.default_rng(0)
    clear = Sensor().picture(light, rng).astype(np.int16)
    back = Sensor().picture(fog.invert(fog.apply(light.copy(), t), t), rng)
    assert t[8:].min() < 0.25
    assert np.abs(back - clear)[8:].max() <= 1


@pytest.mark.parametrize("seed", range(4))
def test_an_8_bit_picture_in_fog_is_inverted_within_two_grey_levels(seed: int) -> None:
    light, fog, t = in_fog(seed)
    rng = np.random.default_rng(0)
    clear = Sensor().picture(light, rng).astype(np.int16)
    foggy = fog.apply(light.copy(), t)
    stored = np.float32(srgb_decode(Sensor().picture(foggy, rng) / 255.0))
    wrong = np.abs(Sensor().picture(fog.invert(stored, t), rng) - clear)
    # half a level of rounding is divided by t, and is worth more levels where the curve is steeper: in the shadows
    with np.errstate(divide="ignore"):
        grown = 0.5 * steepness(light) / steepness(foggy) / t[:, :, None]
    assert (grown < 1.4).mean() > 0.3
    assert (t[(grown < 1.4).any(axis=2)]).min() < 0.35
    assert wrong[grown < 1.4].max() <= 2
    assert wrong[8:][grown[8:] > 5.0].max() > 2


def steepness(light: Map) -> Map:
    """Return the slope of sRGB's curve."""
    return np.where(light < 0.0031308, 12.92, 1.055 / 2.4 * np.maximum(light, 0.0031308) ** (1.0 / 2.4 - 1.0))


def test_banks_leave_the_mean_of_the_fog() -> None:
    # one tile of the banks, 80 m a side
    x, y = np.meshgrid(*(np.arange(0.0, 80.0, 0.625, dtype=np.float32),) * 2)
    density = BANKS.density(x, y)
    assert float(density.mean()) == pytest.approx(1.0, abs=1e-4)
    assert density.min() >= 0.2 - 1e-6
    assert density.max() <= 1.8 + 1e-6
    assert density.std() > 0.2


def test_banks_are_smooth_and_go_on_for_ever() -> None:
    x = np.arange(-200.0, 400.0, 0.1, dtype=np.float32)[None, :]
    density = BANKS.density(x, np.zeros_like(x))
    assert np.abs(np.diff(density)).max() < 0.02
    np.testing.assert_allclose(density[:, 800:1600], density[:, :800], atol=2e-3)


def test_banks_drift() -> None:
    x, y = np.meshgrid(*(np.arange(0.0, 60.0, 3.0, dtype=np.float32),) * 2)
    moved = Fog(0.05, bank_strength=0.8, bank_seed=3, bank_offset_m=(7.0, -4.0))
    np.testing.assert_allclose(moved.density(x + 7.0, y - 4.0), BANKS.density(x, y), atol=1e-4)
    assert np.abs(moved.density(x, y) - BANKS.density(x, y)).max() > 0.1


def test_banks_thin_by_the_mean_along_the_sight() -> None:
    x, y = (np.float32(m) for m in np.meshgrid(np.linspace(-15.0, 25.0, 160), np.linspace(-20.0, 10.0, 120)))
    distance = np.float32(np.sqrt((x - 2.0) ** 2 + (y + 1.0) ** 2 + 100.0))
    t = BANKS.transmission(distance, x, y, (2.0, -1.0))
    shares = (np.arange(200) + 0.5) / 200
    means = np.mean(
        [BANKS.density(np.float32(2.0 + s * (x - 2.0)), np.float32(-1.0 + s * (y + 1.0))) for s in shares], 0
    )
    np.testing.assert_allclose(t, np.exp(-0.05 * distance * means), atol=0.01)
    assert np.abs(means - 1.0).max() > 0.2


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (5, 9)])
def test_small_pictures_have_banks_too(shape: tuple[int, int]) -> None:
    place = np.full(shape, 5.0, np.float32)
    t = BANKS.transmission(place, place, place, (5.0, 5.0))
    density = BANKS.density(place, place)
    np.testing.assert_allclose(t, np.exp(-0.05 * 5.0 * density), atol=1e-5)


@pytest.mark.parametrize(
    "change",
    [
        {"beta_per_m": -0.1},
        {"beta_per_m": math.nan},
        {"bank_strength": 1.5},
        {"bank_scale_m": 0.0},
        {"airlight": (0.5, -0.1, 0.5)},
    ],
)
def test_what_is_no_fog_is_refused(change: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        Fog(**{"beta_per_m": 0.1, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize("visibility_m", [0.0, -5.0, math.nan])
def test_a_visibility_is_positive(visibility_m: float) -> None:
    with pytest.raises(UsageError):
        Fog.of_visibility(visibility_m)


def test_path_traced_fog_is_met_by_the_model() -> None:
    """Another renderer's fog, by its own beta and airlight, is ours but for its noise and what scatters twice."""
    folder = shared_data("rendered/fog")
    rows = (folder / "labels.csv").read_text().splitlines()
    names = rows[0].split(",")
    for text in rows[1:]:
        row = dict(zip(names, text.split(","), strict=True))
        number = row["file"].rsplit("_", 1)[1].split(".")[0]
        clear, foggy = (cv2.imread(str(folder / f"{kind}_{number}.png")) for kind in ("clear", "fog"))
        depth = cv2.imread(str(folder / f"depth_{number}.png"), cv2.IMREAD_UNCHANGED)
        assert clear is not None
        assert foggy is not None
        assert depth is not None
        air = tuple(float(row[f"A_lin_{c}"]) for c in "bgr")
        fog = Fog(float(row["beta"]), (air[0], air[1], air[2]))
        distance = np.where(depth > 0, np.float32(depth) / 500.0, np.inf).astype(np.float32)
        made = fog.apply(np.float32(srgb_decode(clear / 255.0)), fog.transmission(distance))
        difference = Sensor().picture(made, np.random.default_rng(0)).astype(np.int16) - foggy
        assert np.abs(difference.mean(axis=(0, 1))).max() < 4.0
        assert np.abs(difference).mean() < 0.5 * np.abs(clear.astype(np.int16) - foggy).mean()
