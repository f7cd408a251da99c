from __future__ import annotations

import cv2
import numpy as np
import pytest

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.synth.truth import ring_box_px
from landtool.target.print_fit import fit_print, register_print
from landtool.target.print_model import FINE, Placed, print_of, shown, to_pixels
from landtool.types import Image
from tests.scenes import CAMERA, PAD, photograph, view


def scene(distance_m: float, seed: int, blur_px: float = 0.6) -> tuple[Image, Array]:
    rng = np.random.default_rng(seed)
    turn, azimuth = rng.uniform(0.0, 6.28, 2)
    camera_T_pad = view(distance_m, rng.uniform(0, 35), azimuth, turn, (0.05, -0.04))
    box = ring_box_px(CAMERA, camera_T_pad, PAD)
    assert box is not None
    return photograph(camera_T_pad, rng, grey_noise=1.5, blur_px=blur_px), box


def shaken(box: Array, seed: int) -> Array:
    """Return the box as a network might have it: each edge off by up to 12 % and a pixel."""
    rng = np.random.default_rng(100 + seed)
    return np.asarray(box + rng.uniform(-0.12, 0.12, 4) * np.tile(box[2:] - box[:2], 2) + rng.uniform(-1.0, 1.0, 4))


@pytest.mark.parametrize(("distance_m", "most_px"), [(36.0, 0.35), (25.0, 0.3), (14.0, 0.4)])  # 15, 22 and 40 pixels
def test_small_pads_are_found_to_a_fraction_of_a_pixel(distance_m: float, most_px: float) -> None:
    found = 0
    for seed in range(6):
        image, truth = scene(distance_m, seed)
        fit = fit_print(image, shaken(truth, seed), PAD)
        if fit is not None:
            found += 1
            assert np.abs(fit.box_px(640, 480) - truth).max() < most_px
            assert fit.likeness > 0.8
            assert fit.sigma_px < 0.5
    assert found >= 5


def test_motion_blur_does_not_pull() -> None:
    image, truth = scene(16.0, 3, blur_px=0.4)
    image = np.asarray(cv2.blur(image, (5, 1)), np.uint8)
    fit = fit_print(image, shaken(truth, 3), PAD)
    assert fit is not None
    assert np.abs(fit.box_px(640, 480) - truth).max() < 0.4


def test_a_fifth_hidden_does_not_pull() -> None:
    image, truth = scene(14.0, 2)
    x, y, right, bottom = truth.round().astype(int)
    image[y - 4 : bottom + 4, right - (right - x) // 6 : right + 5] = (60, 80, 70)
    fit = fit_print(image, shaken(truth, 2), PAD)
    assert fit is not None
    assert np.abs(fit.box_px(640, 480) - truth).max() < 1.0


def test_what_is_no_print_is_none() -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (480, 640, 3)).astype(np.uint8)
    assert fit_print(noise, np.array([300.0, 200.0, 330.0, 230.0]), PAD) is None
    plain = np.full((480, 640, 3), 90, np.uint8)
    assert fit_print(plain, np.array([300.0, 200.0, 330.0, 230.0]), PAD) is None
    sign = np.full((480, 640, 3), 70, np.uint8)
    cv2.circle(sign, (315, 215), 15, (30, 25, 200), -1, cv2.LINE_AA)
    cv2.rectangle(sign, (304, 212), (326, 218), (240, 240, 240), -1)  # no entry
    assert fit_print(sign, np.array([300.0, 200.0, 330.0, 230.0]), PAD) is None


@pytest.mark.parametrize(
    "box", [[-0.5, 200.0, 30.0, 230.0], [300.0, 200.0, 304.0, 204.0], [100.0, 100.0, 300.0, 300.0]]
)
def test_boxes_that_are_cut_tiny_or_large_are_declined(box: list[float]) -> None:
    image, _ = scene(25.0, 0)
    assert register_print(image, np.array(box), PAD) is None


def test_a_pad_without_board_or_ring_is_declined() -> None:
    image, truth = scene(25.0, 0)
    for pad in (PadSpec(board=None), PadSpec(ring=None)):
        assert fit_print(image, truth, pad) is None


def test_the_print_is_drawn_where_it_is_placed() -> None:
    what = print_of(PAD, "srgb")
    assert what is not None
    angle = 0.4
    axes = 15.0 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    fine = shown(what, Placed(axes, np.array([30.3, 28.6]), np.array([0.3, 0.0, 0.3])), 60, 64)
    assert fine.shape == (60 * FINE + 2, 64 * FINE + 2, 2)
    cover = to_pixels(np.ascontiguousarray(fine[1:-1, 1:-1]))[:, :, 1].astype(float)
    rows, columns = np.indices(cover.shape)
    area = (2.0 * 1.1 * 15.0) ** 2
    assert cover.sum() == pytest.approx(area, rel=0.01)
    assert (cover * columns).sum() / cover.sum() == pytest.approx(30.3, abs=0.03)
    assert (cover * rows).sum() / cover.sum() == pytest.approx(28.6, abs=0.03)
