from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from landtool.camera import Camera
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.synth.motion_blur import flow_grid, grid_nodes, line_kernel, motion_blur
from landtool.synth.view import View

Linear = NDArray[np.float32]
CAMERA = Camera(320, 240, 250.0, 252.0, 158.0, 121.0, distortion=(-0.2, 0.05, 0.001, -0.001, 0.0))
DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
STILL = View.still(CAMERA, Pose(DOWN @ rotation_from_rotvec([0.3, -0.2, 0.1]), np.array([0.5, -0.3, 5.0])))
MOVING = replace(
    STILL, velocity_mps=np.array([3.0, -1.0, -2.0]), rate_radps=np.array([0.5, -0.3, 1.2]), exposure_s=1 / 40
)
ROLLING = replace(MOVING, readout_s=0.02)


def same(dx: float, dy: float, shape: tuple[int, int] = (240, 320)) -> Linear:
    grid = np.empty((len(grid_nodes(shape[0])), len(grid_nodes(shape[1])), 2), np.float32)
    grid[...] = (dx, dy)
    return grid


def turning(shape: tuple[int, int], angle_rad: float) -> Linear:
    """Return the flow of a small turn about the picture's middle."""
    y, x = np.meshgrid(*(grid_nodes(n) - (n - 1) / 2 for n in shape), indexing="ij")
    return np.float32(np.stack([-y, x], axis=-1) * angle_rad)


def dot_at(column: int, row: int, shape: tuple[int, int] = (240, 320)) -> Linear:
    light = np.zeros((*shape, 3), np.float32)
    light[row, column] = (1.0, 2.0, 3.0)
    return light


def moments(light: Linear) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return the mean place (x, y), the covariance (2, 2), and the whole light of a picture's green channel."""
    green = light[:, :, 1].astype(np.float64)
    total = green.sum()
    y, x = np.mgrid[: green.shape[0], : green.shape[1]]
    mean = np.array([(x * green).sum(), (y * green).sum()]) / total
    dx, dy = x - mean[0], y - mean[1]
    covariance = np.array([[(dx * dx * green).sum(), (dx * dy * green).sum()], [0.0, (dy * dy * green).sum()]]) / total
    covariance[1, 0] = covariance[0, 1]
    return mean, covariance, float(total)


@pytest.mark.parametrize("motion", [(0.4, 0.0), (3.0, 1.5), (0.0, -5.0), (7.2, 5.4), (-14.0, 9.0), (25.0, 31.0)])
def test_a_point_that_moves_evenly_draws_its_line(motion: tuple[float, float]) -> None:
    mean, covariance, total = moments(motion_blur(dot_at(150, 100), same(*motion)))
    np.testing.assert_allclose(mean, (150.0, 100.0), atol=0.02)
    assert total == pytest.approx(2.0, rel=1e-4)
    # a line of length L has the variance L^2 / 12 along itself; sharing light among pixels adds up to 1/4 an axis
    excess = covariance - np.outer(motion, motion) / 12.0
    assert np.linalg.eigvalsh(excess).min() > -0.02 * np.hypot(*motion) - 1e-3
    assert np.linalg.eigvalsh(excess).max() < 0.5
    kernel = line_kernel(motion)
    assert float(kernel.sum()) == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(kernel, kernel[::-1, ::-1], atol=1e-6)


def test_an_even_motion_along_rows_is_a_box() -> None:
    blurred = motion_blur(dot_at(150, 100), same(5.0, 0.0))[100, :, 0]
    # between pixels a picture is linear, so the ends of the box of 5 are rounded: 1/8 of a step is beyond them
    np.testing.assert_allclose(blurred[147:154], [0.025, 0.175, 0.2, 0.2, 0.2, 0.175, 0.025], atol=1e-3)
    assert not blurred[:147].any()


@pytest.mark.parametrize("angle_rad", [0.005, 0.02, 0.1, 0.3])
def test_a_point_on_a_turning_picture_draws_its_arc(angle_rad: float) -> None:
    shape = (240, 320)
    for column, row in ((40, 60), (250, 130), (160, 200)):
        out = np.array([column - 159.5, row - 119.5])
        motion = angle_rad * np.array([-out[1], out[0]])
        mean, covariance, total = moments(motion_blur(dot_at(column, row), turning(shape, angle_rad)))
        # the middle of a true arc lies nearer to the centre than its ends' tangent: both by about r a^2 / 24
        assert np.hypot(*(mean - (column, row))) < 0.02 + np.hypot(*out) * angle_rad**2 / 12.0
        assert total == pytest.approx(2.0, rel=0.02)
        along = motion / np.hypot(*motion)
        length_px = np.sqrt(12.0 * float(along @ covariance @ along))
        assert length_px == pytest.approx(np.hypot(*motion), rel=0.06, abs=1.6)


def test_what_hardly_moves_is_left_alone() -> None:
    light = dot_at(10, 10)
    assert motion_blur(light, same(0.1, 0.1)) is light
    assert motion_blur(light, same(0.0, 0.0), same(0.1, 0.0), np.ones((240, 320), np.float32)) is light


def test_blurring_leaves_its_input_and_a_plain_picture() -> None:
    plain = np.full((240, 320, 3), 0.3, np.float32)
    mask = np.zeros((240, 320), np.float32)
    mask[80:140, 100:200] = 1.0
    for flow in (same(6.0, 2.0), turning((240, 320), 0.05)):
        np.testing.assert_allclose(motion_blur(plain, flow), 0.3, rtol=1e-4)
        np.testing.assert_allclose(motion_blur(plain, flow, same(-9.0, 0.0), mask), 0.3, rtol=2e-3)
    np.testing.assert_array_equal(plain, np.float32(0.3))


def two_layers() -> tuple[Linear, Linear]:
    """Return a bright square on a striped ground, and the square's mask."""
    light = np.full((240, 320, 3), 0.1, np.float32)
    light[:, ::8] = 0.3
    mask = np.zeros((240, 320), np.float32)
    mask[80:160, 120:220] = 1.0
    light[mask > 0] = 0.9
    return light, mask


def test_a_platform_the_drone_follows_stays_sharp_on_a_smeared_ground() -> None:
    light, mask = two_layers()
    out = motion_blur(light, same(16.0, 0.0), same(0.0, 0.0), mask)
    np.testing.assert_allclose(out[mask > 0], 0.9, atol=1e-4)
    # stripes of one in eight run together, and none of the square's light gets out
    np.testing.assert_allclose(out[100, 20:100], 0.125, atol=0.01)
    np.testing.assert_allclose(out[100, 112:119], 0.125, atol=0.04)
    np.testing.assert_allclose(out[20], motion_blur(light, same(16.0, 0.0))[20], atol=1e-5)


def test_a_platform_that_moves_by_is_smeared_on_a_sharp_ground() -> None:
    light, mask = two_layers()
    light[mask == 0] = 0.1
    out = motion_blur(light, same(0.0, 0.0), same(12.0, 0.0), mask)[120, :, 0]
    np.testing.assert_allclose(out[:112], 0.1, atol=1e-3)
    np.testing.assert_allclose(out[128:210], 0.9, atol=1e-3)
    # the edge, at 119.5, becomes a ramp of 12 px about where it was
    ramp = (out[112:128].astype(float) - 0.1) / 0.8
    np.testing.assert_allclose(ramp, np.clip((np.arange(112, 128) - 119.5) / 12.0 + 0.5, 0.0, 1.0), atol=0.03)


def test_layers_of_one_motion_are_one_layer() -> None:
    light, mask = two_layers()
    one = motion_blur(light, same(9.0, 0.0))
    two = motion_blur(light, same(9.0, 0.0), same(9.2, 0.0), mask)
    np.testing.assert_allclose(two, one, atol=0.03)


def test_a_camera_at_rest_sees_no_motion() -> None:
    assert not flow_grid(STILL, 0.0).any()
    assert not flow_grid(replace(STILL, exposure_s=0.1), 0.0).any()


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (2.0, 1.0, 0.0)])
def test_the_flow_is_that_of_points_on_the_plane(velocity: tuple[float, float, float]) -> None:
    z = 0.4
    flow = flow_grid(MOVING, z, velocity)
    depth = MOVING.plane_depth(z)
    for i, j in ((0, 0), (3, 4), (7, 9)):
        row, column = grid_nodes(240)[i], grid_nodes(320)[j]
        ray = np.array([float(r[row, column]) for r in MOVING.rays])
        point = MOVING.world_T_camera.translation + float(depth[row, column]) * ray
        half = MOVING.exposure_s / 2
        # another way to the same: the camera and the point are moved, not the camera's frame
        ends = []
        for t in (-half, half):
            turned = MOVING.world_T_camera.rotation @ rotation_from_rotvec(MOVING.rate_radps * t)
            there = Pose(turned, MOVING.world_T_camera.translation + MOVING.velocity_mps * t)
            ends.append(CAMERA.project(there.inverse().apply(point + np.array(velocity) * t)[None])[0])
        np.testing.assert_allclose(flow[i, j], ends[1] - ends[0], atol=2e-3)
        assert np.hypot(*flow[i, j]) > 1.0


def test_a_platform_the_camera_follows_does_not_move() -> None:
    view = replace(MOVING, velocity_mps=np.array([3.0, -1.0, 0.0]), rate_radps=np.zeros(3))
    assert np.abs(flow_grid(view, 0.5, (3.0, -1.0, 0.0))).max() < 1e-6
    assert np.abs(flow_grid(view, 0.0)).max() > 2.0


def test_the_sky_moves_by_turning_only() -> None:
    level = Pose(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.0, 0.0, 2.0]))
    view = View(CAMERA, level, np.array([5.0, 0.0, 0.0]), np.zeros(3), exposure_s=0.02)
    flow = flow_grid(view, 0.0)
    assert np.isfinite(flow).all()
    assert np.abs(flow[0]).max() < 0.1
    assert np.abs(flow[-1]).max() > 1.0


def test_a_rolling_shutter_smears_what_it_chases_for_longer() -> None:
    view = replace(ROLLING, rate_radps=np.array([1.5, 0.0, 0.0]))
    flow = flow_grid(view, 0.0)
    i, j = 4, 5
    row, column = grid_nodes(240)[i], grid_nodes(320)[j]
    ray = np.array([float(r[row, column]) for r in view.rays])
    origin = np.array([float(view.origin(axis)[row, 0]) for axis in range(3)])
    point = origin + float(view.plane_depth(0.0)[row, column]) * ray
    # the point at many moments, and of those the ones at which the row it is on was open
    t = np.linspace(-0.05, 0.05, 20001)
    place = CAMERA.project(view.in_camera(np.repeat(point[None], len(t), 0), t))
    shown = place[np.abs(t - view.row_time_s(place[:, 1])) <= view.exposure_s / 2]
    np.testing.assert_allclose(np.abs(flow[i, j]), np.abs(shown[-1] - shown[0]), rtol=0.01, atol=0.02)
    fixed = flow_grid(replace(view, readout_s=0.0), 0.0)
    assert abs(flow[i, j, 1] - fixed[i, j, 1]) > 0.3
