from __future__ import annotations

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.synth.view import View
from tests.unit.synth.views import BENT, PINHOLE, moving, over


@pytest.mark.parametrize("camera", [PINHOLE, BENT])
def test_the_lens_is_the_cameras_own_inverse(camera: Camera) -> None:
    x, y = View.still(camera, over(3.0)).lens
    pixels = np.array([[0, 0], [319, 0], [0, 239], [319, 239], [160, 120], [37, 201]])
    rays = np.array([[x[v, u], y[v, u], 1.0] for u, v in pixels])
    np.testing.assert_allclose(camera.project(rays), pixels, atol=2e-3)


@pytest.mark.parametrize("camera", [PINHOLE, BENT])
@pytest.mark.parametrize("rolling", [False, True])
def test_what_a_pixel_sees_is_projected_to_that_pixel(camera: Camera, rolling: bool) -> None:
    pose = over(4.0, tilt_rad=0.4, yaw_rad=1.1)
    view = moving(camera, pose) if rolling else View.still(camera, pose)
    depth = view.plane_depth(0.3)
    for u, v in [(10, 10), (300, 15), (160, 120), (40, 220), (311, 231)]:
        ray = np.array([r[v, u] for r in view.rays])
        origin = np.array([view.origin(axis)[v, 0] for axis in range(3)])
        point = origin + depth[v, u] * ray
        assert point[2] == pytest.approx(0.3, abs=1e-4)
        np.testing.assert_allclose(view.project(point[None])[0], [u, v], atol=5e-3)


def test_a_platform_that_keeps_up_with_the_camera_is_not_sheared() -> None:
    view = View(PINHOLE, over(4.0), np.array([3.0, 1.0, 0.0]), np.zeros(3), 0.0, 0.03)
    points = np.array([[0.4, 0.7, 0.0], [-0.8, -0.2, 0.0]])
    still = View.still(PINHOLE, over(4.0)).project(points)
    np.testing.assert_allclose(view.project(points, (3.0, 1.0, 0.0)), still, atol=1e-6)
    assert np.abs(view.project(points) - still).max() > 0.5


def test_a_sight_over_the_horizon_never_meets_the_ground() -> None:
    view = View.still(Camera.from_hfov(320, 240, 100.0), over(4.0, tilt_rad=1.3))
    depth = view.plane_depth(0.0)
    assert np.isinf(depth).any()
    assert (depth > 0).all()
