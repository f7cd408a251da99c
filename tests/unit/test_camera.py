"""Projection, its inverse, and what scaling, cropping and turning the image do to a camera."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.errors import InputError, UsageError
from landtool.geometry import Array

PINHOLE = Camera(640, 480, 554.0, 551.0, 322.5, 237.0)
PLUMB_BOB = Camera(640, 480, 554.0, 551.0, 322.5, 237.0, "plumb_bob", (-0.28, 0.09, 0.0012, -0.0007, -0.01))
RATIONAL = Camera(
    640, 480, 420.0, 421.0, 318.0, 243.0, "rational_polynomial", (5.2, 2.1, 3e-4, -2e-4, 0.11, 5.5, 3.9, 0.5)
)
EQUIDISTANT = Camera(640, 480, 300.0, 301.0, 321.0, 239.0, "equidistant", (0.02, -0.005, 0.001, -0.0002))
CAMERAS = {"pinhole": PINHOLE, "plumb_bob": PLUMB_BOB, "rational": RATIONAL, "equidistant": EQUIDISTANT}


@pytest.fixture(params=CAMERAS)
def camera(request: pytest.FixtureRequest) -> Camera:
    return CAMERAS[request.param]


def whole_image(camera: Camera) -> Array:
    """A grid of pixels that covers the image, edges included."""
    u, v = np.meshgrid(np.linspace(-0.5, camera.width - 0.5, 17), np.linspace(-0.5, camera.height - 0.5, 13))
    return np.column_stack([u.ravel(), v.ravel()])


def points_in_view(camera: Camera) -> Array:
    rays = camera.unproject(whole_image(camera))
    return np.asarray(rays * np.linspace(0.3, 20.0, len(rays))[:, None], dtype=np.float64)


def test_projecting_a_ray_gives_its_pixel_back(camera: Camera) -> None:
    pixels = whole_image(camera)
    rays = camera.unproject(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(camera.project(7.0 * rays), pixels, atol=1e-6)
    flat = camera.normalize(pixels)
    np.testing.assert_allclose(camera.project(np.column_stack([flat, np.ones(len(flat))])), pixels, atol=1e-6)


def test_projection_is_opencv_s_own(camera: Camera) -> None:
    points = points_in_view(camera)
    d = np.array(camera.distortion)
    if camera.model == "equidistant":
        want, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), camera.matrix, d)
    else:
        want, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, d)
    np.testing.assert_allclose(camera.project(points), want.reshape(-1, 2), atol=1e-9)


def test_optical_axis_meets_the_principal_point(camera: Camera) -> None:
    np.testing.assert_allclose(camera.project([[0.0, 0.0, 2.0]]), [[camera.cx, camera.cy]], atol=1e-9)


def test_points_not_in_front_have_no_pixel(camera: Camera) -> None:
    pixels = camera.project([[0.1, 0.1, 1.0], [0.1, 0.1, 0.0], [0.1, 0.1, -1.0], [np.nan, 0.0, 1.0]])
    assert np.isfinite(pixels[0]).all()
    assert np.isnan(pixels[1:3]).all()
    assert np.isnan(pixels[3]).any()


FOLDING = {
    "plumb_bob": Camera(640, 480, 554.0, 554.0, 320.0, 240.0, "plumb_bob", (-0.3, 0.0, 0.0, 0.0, 0.0)),
    "rational": Camera(640, 480, 554.0, 554.0, 320.0, 240.0, "rational_polynomial", (0.1, 0, 0, 0, 0, 0.5, 0.3, 0)),
    "equidistant": Camera(640, 480, 300.0, 300.0, 320.0, 240.0, "equidistant", (0.0, -0.2, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", FOLDING)
def test_a_point_far_to_the_side_does_not_land_in_the_picture(name: str) -> None:
    camera = FOLDING[name]
    x = np.linspace(0.0, 6.0, 2001)
    u = camera.project(np.column_stack([x, np.zeros_like(x), np.ones_like(x)]))[:, 0]
    seen = np.isfinite(u)
    assert 0 < seen.sum() < len(x)
    assert not np.diff(seen.astype(int)).max() > 0  # once out of view, out of view
    assert (np.diff(u[seen]) > 0).all()
    # and what is cut off is no more than the folding part: the last step is nearly flat
    assert np.diff(u[seen])[-1] < 0.02 * np.diff(u[seen])[0]


def test_lenses_that_do_not_fold_see_everything_in_front(camera: Camera) -> None:
    assert np.isfinite(camera.project(points_in_view(camera))).all()
    assert np.isfinite(PINHOLE.project([[1e6, 0.0, 1.0]])).all()


def test_no_points_give_no_pixels(camera: Camera) -> None:
    assert camera.project(np.zeros((0, 3))).shape == (0, 2)
    assert camera.normalize(np.zeros((0, 2))).shape == (0, 2)
    assert camera.unproject(np.zeros((0, 2))).shape == (0, 3)


@pytest.mark.parametrize("size", [(1280, 960), (320, 240), (320, 480), (123, 457)])
def test_scaled_camera_sees_the_resized_image(camera: Camera, size: tuple[int, int]) -> None:
    points = points_in_view(camera)
    # resizing maps areas: the image's edges, at -0.5 and W - 0.5, stay its edges
    factor = np.array(size) / (camera.width, camera.height)
    want = (camera.project(points) + 0.5) * factor - 0.5
    scaled = camera.scaled(*size)
    assert (scaled.width, scaled.height) == size
    np.testing.assert_allclose(scaled.project(points), want, atol=1e-9)


def test_scaling_agrees_with_resizing_a_picture() -> None:
    image = np.zeros((48, 64), np.float32)
    image[20:24, 30:34] = 1.0  # a blob centred on (31.5, 21.5)
    big = cv2.resize(image, (192, 144), interpolation=cv2.INTER_LINEAR)
    v, u = np.mgrid[:144, :192]
    centre = np.array([(u * big).sum(), (v * big).sum()]) / big.sum()
    camera = Camera(64, 48, 50.0, 50.0, 31.5, 21.5).scaled(192, 144)
    np.testing.assert_allclose((camera.cx, camera.cy), centre, atol=1e-5)


def test_cropped_camera_sees_the_part(camera: Camera) -> None:
    points = points_in_view(camera)
    part = camera.cropped(37, 91, 200, 100)
    assert (part.width, part.height) == (200, 100)
    np.testing.assert_allclose(part.project(points), camera.project(points) - (37, 91), atol=1e-9)


@pytest.mark.parametrize("turns", [-1, 0, 1, 2, 3, 4, 5])
def test_rotated_camera_sees_the_turned_image(camera: Camera, turns: int) -> None:
    points = points_in_view(camera)
    pixels = camera.project(points)
    size = np.array([camera.width, camera.height])
    turned_points = points.copy()
    for _ in range(turns % 4):  # as a picture turned clockwise: (u, v) goes to (H - 1 - v, u)
        pixels = np.column_stack([size[1] - 1 - pixels[:, 1], pixels[:, 0]])
        turned_points = np.column_stack([-turned_points[:, 1], turned_points[:, 0], turned_points[:, 2]])
        size = size[::-1]
    turned = camera.rotated(turns)
    assert (turned.width, turned.height) == tuple(size)
    np.testing.assert_allclose(turned.project(turned_points), pixels, atol=1e-9)
    np.testing.assert_allclose(turned.rotated(-turns).project(points), camera.project(points), atol=1e-9)


def test_clockwise_is_what_opencv_calls_clockwise() -> None:
    image = np.zeros((4, 6), np.uint8)
    image[1, 4] = 255
    turned = cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE)
    v, u = np.argwhere(turned)[0]
    camera = Camera(6, 4, 5.0, 5.0, 4.0, 1.0).rotated(1)
    assert (camera.cx, camera.cy) == (u, v)


def test_scaling_and_turning_may_swap(camera: Camera) -> None:
    points = points_in_view(camera)
    points = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    a, b = camera.rotated(1).scaled(240, 320), camera.scaled(320, 240).rotated(1)
    np.testing.assert_allclose(a.project(points), b.project(points), atol=1e-9)


def test_a_fisheye_has_no_plane_coordinates_beyond_90_degrees() -> None:
    wide = Camera(1200, 1200, 300.0, 300.0, 599.5, 599.5, "equidistant", (0.0,) * 4)
    inside, outside = wide.normalize([[599.5 + 300.0, 599.5], [599.5 + 590.0, 599.5]])
    np.testing.assert_allclose(inside, [math.tan(1.0), 0.0], atol=1e-6)
    assert np.isnan(outside).all()


def test_field_of_view_comes_back_and_is_said() -> None:
    camera = Camera.from_hfov(640, 480, 60.0)
    rays = camera.unproject([[-0.5, camera.cy], [639.5, camera.cy]])
    assert math.degrees(math.acos(rays[0] @ rays[1])) == pytest.approx(60.0)
    assert camera.fx == camera.fy
    assert "60" in camera.assumed
    assert camera.scaled(320, 240).assumed == camera.assumed
    with pytest.raises(UsageError):
        Camera.from_hfov(640, 480, 180.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"fx": 0.0}, "not positive"),
        ({"fy": -1.0}, "not positive"),
        ({"cx": math.nan}, "not a finite"),
        ({"distortion": (math.inf, 0.0, 0.0, 0.0, 0.0)}, "not a finite"),
        ({"distortion": (0.1, 0.2)}, "needs 5"),
        ({"model": "fov"}, "unknown distortion model"),
        ({"width": 0}, "not positive"),
    ],
)
def test_impossible_cameras_are_refused(changes: dict[str, object], said: str) -> None:
    values: dict[str, object] = {"width": 640, "height": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}
    with pytest.raises(InputError, match=said):
        Camera(**{**values, **changes})  # type: ignore[arg-type]
