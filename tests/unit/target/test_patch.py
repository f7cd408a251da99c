"""The rays of a patch against the camera's own, and its light."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.target.patch import Patch, cut_patch, on_print
from landtool.target.print_model import FINE
from landtool.tone import linear_lut
from landtool.types import Image
from tests.scenes import CAMERA, PAD, photograph, view

BARREL = Camera(640, 480, 520.0, 530.0, 310.0, 245.0, "plumb_bob", (-0.32, 0.12, 0.001, -0.002, 0.0))
FISHEYE = Camera(640, 480, 420.0, 420.0, 319.5, 239.5, "equidistant", (0.02, -0.005, 0.001, 0.0))
GROUND = 0.16  # of `photograph`: 0.2 of its light
GREY = np.full((480, 640, 3), 128, np.uint8)
MOST_PX = 84.0
CAMERAS = pytest.mark.parametrize("camera", [CAMERA, BARREL, FISHEYE], ids=["pinhole", "barrel", "fisheye"])


def cut(camera: Camera, around: Pose, image: Image = GREY) -> Patch:
    patch = cut_patch(image, camera, around, PAD, "srgb", MOST_PX)
    assert patch is not None
    return patch


@CAMERAS
@pytest.mark.parametrize("distance_m", [1.5, 4.0, 15.0])
def test_the_rays_are_the_cameras(camera: Camera, distance_m: float) -> None:
    patch = cut(camera, view(distance_m, 20.0, 1.0, 0.5, off=(0.2, -0.15)))
    rays = np.stack(patch.middle, axis=-1).reshape(-1, 2).astype(np.float64)
    pixels = camera.project(np.column_stack([rays, np.ones(len(rays))])).reshape(*patch.light.shape, 2)
    # the samples' middles are pixels' middles, or lie between those that were put together
    half_px = (patch.shrink - 1) / 2.0
    rows, columns = patch.light.shape
    place = (rows // 2, columns // 2)
    first = (pixels[place] - half_px).round() + half_px - patch.shrink * np.array(place[::-1])
    grid = first + patch.shrink * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1)
    assert np.abs(pixels - grid).max() < (0.05 if distance_m < 2.0 else 0.001)
    assert np.abs(camera.normalize(grid.reshape(-1, 2)) - rays).max() < (1e-3 if distance_m < 2.0 else 1e-5)


@CAMERAS
def test_the_fine_samples_are_even_about_each_middle(camera: Camera) -> None:
    patch = cut(camera, view(6.0, 10.0, 1.0, 0.5, off=(0.2, 0.1)))
    for fine, middle in zip(patch.fine, patch.middle, strict=True):
        rows, columns = middle.shape
        assert fine.shape == (rows * FINE, columns * FINE)
        means = fine.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
        assert np.abs(means - middle).max() < 1e-5


@CAMERAS
def test_the_slope_says_how_far_a_pixel_moves(camera: Camera) -> None:
    patch = cut(camera, view(6.0, 10.0, 1.0, 0.5, off=(0.2, 0.1)))
    rows, columns = patch.light.shape
    middle = (slice(rows // 2 - 1, rows // 2 + 2), slice(columns // 2 - 1, columns // 2 + 2))
    x, y = (plane[middle].astype(np.float64) for plane in patch.middle)
    by_column = np.array([x[1, 2] - x[1, 0], y[1, 2] - y[1, 0]]) / 2.0
    by_row = np.array([x[2, 1] - x[0, 1], y[2, 1] - y[0, 1]]) / 2.0
    assert patch.px_by_flat @ np.column_stack([by_column, by_row]) == pytest.approx(np.eye(2), abs=0.02)


def test_a_large_pad_is_shrunken_and_a_small_one_is_not() -> None:
    assert cut(CAMERA, view(15.0, 5.0, 1.0, 0.5)).shrink == 1
    near = cut(CAMERA, view(1.5, 5.0, 1.0, 0.5))
    assert near.shrink >= 5
    assert max(near.light.shape) < 1.2 * MOST_PX


def test_its_light_is_linear() -> None:
    truth = view(8.0, 5.0, 1.0, 0.5)
    assert np.unique(cut(CAMERA, truth).light) == pytest.approx([linear_lut("srgb")[128]])
    seen = cut(CAMERA, truth, photograph(truth, np.random.default_rng(0), grey_noise=0.0)).light
    # paper is as bright as the light
    assert seen[0, 0] == pytest.approx(GROUND, abs=0.02)
    assert seen.max() == pytest.approx(0.8, abs=0.05)


@pytest.mark.parametrize(
    "around",
    [view(3.0, 5.0, 1.0, 0.5, off=(1.0, 0.0)), Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, -2.0]))],
    ids=["beside the picture", "behind"],
)
def test_there_is_no_patch_where_the_pad_is_not_seen(around: Pose) -> None:
    assert cut_patch(GREY, CAMERA, around, PAD, "srgb", MOST_PX) is None


def test_at_the_border_it_ends_with_the_picture() -> None:
    patch = cut(CAMERA, view(4.0, 5.0, 1.0, 0.5, off=(-0.55, 0.0)))
    rays = np.stack([plane[0, 0] for plane in patch.middle])
    assert CAMERA.project([[*rays, 1.0]])[0, 0] == pytest.approx((patch.shrink - 1) / 2.0, abs=0.05)
    assert patch.light.shape[1] < patch.light.shape[0]


def test_rays_meet_the_print_where_its_points_are_seen() -> None:
    pose = view(4.0, 30.0, 1.0, 0.5, off=(0.1, -0.2))
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 2))
    seen = pose.apply(np.column_stack([points, np.zeros(20)]))
    x, y = on_print((seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]), pose)
    assert np.column_stack([x, y]) == pytest.approx(points, abs=1e-9)
