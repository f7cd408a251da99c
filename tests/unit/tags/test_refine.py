from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.stats import chi2

from landtool.camera import Camera
from landtool.families import FAMILIES
from landtool.tags.refine import Registration, register
from landtool.tags.template import template
from landtool.tone import Tone
from tests.unit.tags.small import Shot, shoot

FAMILY, TAG = "tag36h11", 5


def measured(shot: Shot, rng: np.random.Generator, tag_id: int = TAG, tone: Tone = "srgb") -> Registration:
    grey = np.asarray(cv2.cvtColor(shot.image, cv2.COLOR_BGR2GRAY), np.uint8)
    start = shot.corners_px + rng.normal(0.0, 0.15, (4, 2))
    found = register(grey, FAMILY, tag_id, start, tone)
    assert found is not None
    return found


def errors(side: float, n: int, seed: int, **how: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances (n, 4) of the corners from the truth, pixels, and e' C^-1 e (n,)."""
    rng = np.random.default_rng(seed)
    distance, nees = [], []
    for _ in range(n):
        shot = shoot(side, rng, **how)  # type: ignore[arg-type]
        found = measured(shot, rng)
        error = found.corners_px - shot.corners_px
        distance.append(np.linalg.norm(error, axis=1))
        nees.append(error.ravel() @ np.linalg.solve(found.covariance_px2, error.ravel()))
    return np.array(distance), np.array(nees)


@pytest.mark.parametrize(
    ("side", "most_px"), [(13, 0.05), (15, 0.04), (18, 0.03), (30, 0.02), (60, 0.018), (150, 0.018)]
)
def test_corners_are_exact_to_hundredths_of_a_pixel(side: float, most_px: float) -> None:
    distance, _ = errors(side, 8, seed=1)
    assert np.median(distance) < most_px
    assert distance.max() < 6.0 * most_px


@pytest.mark.parametrize(
    ("how", "most_px"),
    [
        ({"light": 1.0}, 0.03),  # white is burnt out, its noise clipped
        ({"light": 0.1}, 0.06),
        ({"blur_px": 0.4}, 0.03),
        ({"blur_px": 1.0}, 0.04),
        ({"blur_px": 1.5}, 0.07),
    ],
)
def test_corners_stay_exact_in_worse_pictures(how: dict[str, float], most_px: float) -> None:
    distance, _ = errors(30.0, 8, seed=2, **how)
    assert np.median(distance) < most_px


def lit(shot: Shot, light: np.ndarray) -> Shot:
    """Multiply a picture's light by (H, W), in linear light (a gamma of 2.2 is near enough to sRGB for that)."""
    image = shot.image * light[:, :, None] ** (1.0 / 2.2)
    return Shot(np.rint(image).astype(np.uint8), shot.camera, shot.camera_T_pad, shot.corners_px)


def test_a_gradient_of_light_does_not_move_the_corners() -> None:
    rng = np.random.default_rng(3)
    shots = [shoot(40.0, rng) for _ in range(6)]
    slopes = [lit(s, np.broadcast_to(np.linspace(1.0, 0.3, s.camera.width), s.image.shape[:2])) for s in shots]
    distance = [np.linalg.norm(measured(s, rng).corners_px - s.corners_px, axis=1) for s in slopes]
    assert np.median(distance) < 0.03


def test_a_soft_shadow_across_the_tag_moves_the_corners_little() -> None:
    rng = np.random.default_rng(4)
    distance = []
    for _ in range(6):
        shot = shoot(40.0, rng)
        x = np.arange(shot.camera.width) - shot.camera.cx - 4.0
        shade = 0.4 + 0.6 / (1.0 + np.exp(-x / 3.0))
        shaded = lit(shot, np.broadcast_to(shade, shot.image.shape[:2]))
        distance.append(np.linalg.norm(measured(shaded, rng).corners_px - shot.corners_px, axis=1))
    assert np.median(distance) < 0.12


def nees_band(n: int, degrees: int, level: float = 0.95) -> tuple[float, float]:
    low, high = chi2.ppf([(1 - level) / 2, (1 + level) / 2], n * degrees) / n
    return float(low), float(high)


def test_the_covariance_says_how_large_the_errors_are() -> None:
    nees = np.concatenate([errors(side, 24, seed=5)[1] for side in (15.0, 24.0, 60.0)])
    low, high = nees_band(len(nees), 8, 0.999)
    assert low < nees.mean() < high


@pytest.mark.full
@pytest.mark.parametrize("side", [13.0, 18.0, 30.0, 60.0, 120.0])
def test_the_covariance_holds_at_every_size(side: float) -> None:
    _, nees = errors(side, 200, seed=6)
    # a tenth to either side of the 95 % band: the surroundings of a small tag are no Gaussian noise
    low, high = nees_band(len(nees), 8)
    assert 0.9 * low < nees.mean() < 1.1 * high


def test_the_start_does_not_matter() -> None:
    rng = np.random.default_rng(7)
    shot = shoot(24.0, rng)
    found = [measured(shot, rng).corners_px for _ in range(6)]
    assert np.ptp(found, axis=0).max() < 0.01


def test_moving_the_picture_moves_the_corners() -> None:
    rng = np.random.default_rng(8)
    shot = shoot(30.0, rng)
    grey = np.asarray(cv2.cvtColor(shot.image, cv2.COLOR_BGR2GRAY), np.uint8)
    moved = np.pad(grey, ((13, 0), (7, 0)), mode="edge")
    here = register(grey, FAMILY, TAG, shot.corners_px, "srgb")
    there = register(moved, FAMILY, TAG, shot.corners_px + (7, 13), "srgb")
    assert here is not None
    assert there is not None
    np.testing.assert_allclose(there.corners_px, here.corners_px + (7, 13), atol=1e-6)
    np.testing.assert_allclose(there.covariance_px2, here.covariance_px2, rtol=1e-5, atol=1e-12)


def test_the_blur_is_measured() -> None:
    rng = np.random.default_rng(9)
    sharp, soft = (measured(shoot(60.0, rng, blur_px=b), rng).blur_px for b in (0.6, 1.2))
    # the pixel itself adds a variance of 1/12
    assert sharp == pytest.approx(np.hypot(0.6, 12**-0.5), abs=0.08)
    assert soft == pytest.approx(np.hypot(1.2, 12**-0.5), abs=0.08)


def test_a_wrong_id_does_not_look_like_its_tag() -> None:
    rng = np.random.default_rng(10)
    shot = shoot(40.0, rng)
    assert measured(shot, rng).correlation > 0.98
    grey = np.asarray(cv2.cvtColor(shot.image, cv2.COLOR_BGR2GRAY), np.uint8)
    wrong = register(grey, FAMILY, TAG + 1, shot.corners_px, "srgb")
    assert wrong is None or wrong.correlation < 0.9


def test_nothing_is_measured_where_there_is_nothing() -> None:
    square = np.array([[20.0, 20.0], [50.0, 20.0], [50.0, 50.0], [20.0, 50.0]])
    flat = np.full((80, 80), 90, np.uint8)
    assert register(flat, FAMILY, TAG, square, "srgb") is None
    assert register(flat, FAMILY, TAG, square - 500.0, "srgb") is None  # outside
    assert register(flat, FAMILY, TAG, np.zeros((4, 2)), "srgb") is None


def test_encoded_values_make_the_tag_seem_smaller() -> None:
    rng = np.random.default_rng(11)
    shot = shoot(30.0, rng, tilt_deg=(0.0, 1.0), blur_px=1.0)
    areas = [cv2.contourArea(measured(shot, rng, tone=t).corners_px.astype(np.float32)) for t in ("srgb", "none")]
    true = cv2.contourArea(shot.corners_px.astype(np.float32))
    assert abs(areas[0] / true - 1.0) < 0.5 * abs(areas[1] / true - 1.0)


def test_a_bent_lens_does_not_matter_to_the_corners() -> None:
    rng = np.random.default_rng(12)
    shot = shoot(60.0, rng, distortion=(-0.3, 0.1, 0.001, -0.001, 0.0))
    assert isinstance(shot.camera, Camera)
    assert np.median(np.linalg.norm(measured(shot, rng).corners_px - shot.corners_px, axis=1)) < 0.03


@pytest.mark.parametrize("family", FAMILIES)
def test_a_templates_derivatives_are_those_of_its_picture(family: str) -> None:
    picture = template(family, 7, 0.35)
    rng = np.random.default_rng(13)
    places = rng.uniform(-picture.reach + 1.0, picture.reach - 1.0, (2, 400))
    h = 0.1
    (level, by_x, by_y), (by_xx, by_xy, by_yy) = picture.look_up(places)
    sides = {(i, j): picture.look_up(places + [[i * h], [j * h]])[0][0] for i in (-1, 0, 1) for j in (-1, 0, 1)}
    np.testing.assert_allclose((sides[1, 0] - sides[-1, 0]) / (2 * h), by_x, atol=0.05)
    np.testing.assert_allclose((sides[0, 1] - sides[0, -1]) / (2 * h), by_y, atol=0.05)
    np.testing.assert_allclose((sides[1, 0] - 2 * level + sides[-1, 0]) / h**2, by_xx, atol=0.6)
    np.testing.assert_allclose((sides[0, 1] - 2 * level + sides[0, -1]) / h**2, by_yy, atol=0.6)
    mixed = (sides[1, 1] - sides[1, -1] - sides[-1, 1] + sides[-1, -1]) / (4 * h * h)
    np.testing.assert_allclose(mixed, by_xy, atol=0.4)
