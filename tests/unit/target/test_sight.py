from __future__ import annotations

import cv2
import numpy as np
import pytest

from landtool.target.sight import look_at
from tests.scenes import PAD, photograph, view
from tests.unit.target.test_ring import iou, shaken, true_box


@pytest.mark.parametrize("distance_m", [32.0, 22.0, 10.0, 3.0, 1.4])
def test_a_pad_is_seen_where_it_is_and_not_doubted(distance_m: float) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(distance_m, rng.uniform(0, 20), rng.uniform(0, 6.28), rng.uniform(0, 6.28))
        image, truth = photograph(camera_T_pad, rng, grey_noise=1.0), true_box(camera_T_pad)
        sight = look_at(image, shaken(truth, rng), PAD)
        assert not sight.is_doubtful
        if sight.box_px is not None:
            assert iou(sight.box_px, truth) > 0.93


@pytest.mark.parametrize("radius", [20, 30, 60])
def test_a_sign_with_a_red_ring_is_doubted(radius: int) -> None:
    image = np.full((480, 640, 3), (90, 95, 92), np.uint8)
    centre = (300, 200)
    cv2.circle(image, centre, radius, (30, 25, 210), -1, cv2.LINE_AA)
    cv2.circle(image, centre, round(0.82 * radius), (235, 235, 235), -1, cv2.LINE_AA)
    cv2.ellipse(image, centre, (round(0.6 * radius),) * 2, 20.0, 0.0, 180.0, (20, 20, 20), -1, cv2.LINE_AA)
    image = cv2.GaussianBlur(image, (3, 3), 0.6)
    box = np.array([centre[0] - radius, centre[1] - radius, centre[0] + radius, centre[1] + radius], np.float64)
    assert look_at(image, box, PAD).is_doubtful


def test_what_cannot_be_seen_is_not_doubted() -> None:
    # fog so thick that nothing is left, and a box at the border
    image = np.full((480, 640, 3), 128, np.uint8)
    sight = look_at(image, np.array([300.0, 200.0, 400.0, 300.0]), PAD)
    assert (sight.box_px, sight.is_doubtful) == (None, False)
    sight = look_at(image, np.array([-0.5, 200.0, 30.0, 240.0]), PAD)
    assert (sight.box_px, sight.is_doubtful) == (None, False)
