from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.synth.print_layer import place_on_print, print_layer
from landtool.synth.render import render_pad
from landtool.synth.scene import Target
from landtool.synth.sheet import clean_sheet, random_curl
from landtool.synth.view import View
from tests.unit.synth.views import BENT, PAD, PINHOLE, moving, over

AT = Pose.from_rotvec([0.1, -0.05, 0.4], [0.02, -0.03, 0.7])


def target(**changes: object) -> Target:
    return replace(Target(PAD, clean_sheet(PAD), AT), **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("camera", [PINHOLE, BENT])
@pytest.mark.parametrize("height_m", [25.0, 6.0, 2.5, 1.1])
def test_it_equals_the_exact_renderer(camera: Camera, height_m: float) -> None:
    world_T_camera = over(height_m, tilt_rad=0.3, yaw_rad=0.4, off_m=(-0.1 * height_m, 0.05 * height_m))
    layer = print_layer(View.still(camera, world_T_camera), target())
    assert layer is not None
    exact = render_pad(camera, world_T_camera.inverse() @ AT, PAD)[layer.window]
    # the border's pixels hold some of what is around the print in the one, none of it in the other
    inside = (np.abs(layer.x_m) < 0.5) & (np.abs(layer.y_m) < 0.5)
    error = (layer.albedo - exact)[inside]
    assert np.abs(error).mean() < 0.01
    assert abs(error.mean()) < 0.003
    assert np.percentile(np.abs(error), 99) < 0.12


def test_it_knows_where_on_the_print_a_pixel_looks() -> None:
    view = moving(BENT, over(2.0, tilt_rad=0.2))
    moved = target(velocity_mps=(1.0, 0.5, 0.0))
    x, y, _ = place_on_print(view, moved, (60, 40, 260, 200))
    for column, row in [(60, 40), (200, 100), (259, 199)]:
        point = AT.apply(np.array([[x[row - 40, column - 60], y[row - 40, column - 60], 0.0]]))
        np.testing.assert_allclose(view.project(point, moved.velocity_mps)[0], [column, row], atol=0.01)


def test_a_bent_sheet_is_met_where_it_is() -> None:
    sheet = replace(clean_sheet(PAD), curl=random_curl(np.random.default_rng(4), PAD.extent_m / 2.0))
    bent = target(sheet=sheet)
    view = View.still(PINHOLE, over(2.0, tilt_rad=0.5))
    x, y, depth = place_on_print(view, bent, (100, 60, 220, 180))
    height = sheet.height_m(x, y)
    assert np.abs(height).max() > 0.005
    for column, row in [(0, 0), (60, 60), (119, 119)]:
        point = AT.apply(np.array([[x[row, column], y[row, column], height[row, column]]]))
        np.testing.assert_allclose(view.project(point)[0], [column + 100, row + 60], atol=0.02)
        assert view.in_camera(point)[0, 2] == pytest.approx(depth[row, column], rel=1e-3)


def test_from_behind_and_out_of_sight_there_is_none() -> None:
    assert print_layer(View.still(PINHOLE, over(0.2)), target()) is None  # under the pad
    assert print_layer(View.still(PINHOLE, over(5.0, off_m=(40.0, 0.0))), target()) is None
