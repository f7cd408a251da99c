from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from landtool.pad import PadSpec
from landtool.target.letter import letter_likeness
from landtool.target.ring import fit_ring
from landtool.types import Image
from tests.scenes import PAD, photograph, view
from tests.unit.target.test_ring import true_box


def likeness(image: Image, camera_T_pad: object, pad: PadSpec = PAD) -> float | None:
    fit = fit_ring(image, true_box(camera_T_pad), PAD)  # type: ignore[arg-type]
    assert fit is not None
    return letter_likeness(image, fit.ellipse, pad)


@pytest.mark.parametrize("distance_m", [15.0, 6.0, 3.5])
@pytest.mark.parametrize("tilt_deg", [0.0, 25.0, 50.0])
def test_the_letter_is_found_at_any_angle(distance_m: float, tilt_deg: float) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(distance_m, tilt_deg, rng.uniform(0, 6.28), rng.uniform(0, 6.28))
        found = likeness(photograph(camera_T_pad, rng), camera_T_pad)
        assert found is not None
        assert found > 0.75


def test_other_things_in_a_ring_are_not_it() -> None:
    rng = np.random.default_rng(1)
    camera_T_pad = view(4.0, 10.0, 0.3, 0.2)
    clean = photograph(camera_T_pad, rng)
    x0, y0, x1, y1 = true_box(camera_T_pad)
    centre, radius = (round((x0 + x1) / 2), round((y0 + y1) / 2)), round((x1 - x0) / 2)
    for text in ("50", "P", "X", "30"):
        sign = clean.copy()
        cv2.circle(sign, centre, round(0.8 * radius), (210, 210, 210), -1)
        (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 1.0, 2)
        scale = 0.9 * radius / max(width, height)
        place = (centre[0] - round(width * scale / 2), centre[1] + round(height * scale / 2))
        cv2.putText(sign, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, (20, 20, 20), max(1, radius // 8), cv2.LINE_AA)
        found = likeness(sign, camera_T_pad)
        assert found is not None
        assert found < 0.5, text


def test_where_nothing_can_be_told_it_says_so() -> None:
    rng = np.random.default_rng(2)
    camera_T_pad = view(4.0, 5.0, 0.3, 0.2)
    image = photograph(camera_T_pad, rng)
    fit = fit_ring(image, true_box(camera_T_pad), PAD)
    assert fit is not None
    assert letter_likeness(image, fit.ellipse, replace(PAD, letter=None)) is None
    assert letter_likeness(np.full_like(image, 90), fit.ellipse, PAD) is None
    beyond = replace(fit.ellipse, cx_px=-0.3 * fit.ellipse.sx_px)
    assert letter_likeness(image, beyond, PAD) is None
