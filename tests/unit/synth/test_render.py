from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from apriltag import apriltag

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec, Ring
from landtool.synth.render import Linear, encode, pixel_corner_rays, render_pad, sample_weights
from landtool.synth.truth import tag_corners_px
from landtool.tone import srgb_decode, srgb_encode
from tests.unit.synth.brute import BARREL, FISHEYE, PINHOLE, brute_force, looking_down

PAD = PadSpec()
# a plain white square, to measure edges on: its side is 1.10 m
SQUARE = PadSpec(ring=Ring(color=(255, 255, 255)), letter=None, quiet_zone=None, tags=())
CAMERAS = {"pinhole": PINHOLE, "barrel": BARREL, "fisheye": FISHEYE}

# The tag of pad.md, upright
REFERENCE = """
..........
.########.
.#....###.
.#..###.#.
.#..#..##.
.#.#.#..#.
.###...##.
.#.#..###.
.########.
..........
"""


def at_size(camera: Camera, size_px: float, rotvec: tuple[float, float, float], shift: float = 0.1) -> Pose:
    """Return the pose at which the board is about `size_px` wide, somewhat off the optical axis."""
    z = 1.1 * camera.fx / size_px
    return looking_down(z, shift * z, -0.7 * shift * z, rotvec)


def centre_px(camera: Camera, camera_T_pad: Pose, x_m: float, y_m: float) -> tuple[int, int]:
    x, y = camera.project(camera_T_pad.apply([[x_m, y_m, 0.0]]))[0]
    return round(x), round(y)


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize(
    ("size_px", "rotvec"),
    [(8, (0.3, 0.2, 0.4)), (20, (0.2, -0.4, 2.0)), (60, (0.0, 0.5, -1.0)), (130, (0.1, 0.1, 0.03)), (300, (0.5, 0, 1))],
)
def test_it_agrees_with_brute_force(name: str, size_px: int, rotvec: tuple[float, float, float]) -> None:
    camera, camera_T_pad = CAMERAS[name], at_size(CAMERAS[name], size_px, rotvec)
    image = render_pad(camera, camera_T_pad, PAD)
    half = min(size_px // 2 + 4, 11)
    for x_m, y_m in [(0.0, 0.0), (0.5, 0.1)]:  # the tag, the ring and the board's edge
        x, y = centre_px(camera, camera_T_pad, x_m, y_m)
        error = image[y - half : y + half, x - half : x + half] - brute_force(
            camera, camera_T_pad, PAD, (x - half, y - half, x + half, y + half)
        )
        assert np.abs(error).mean() < 0.002
        assert np.abs(error).max() < 0.03
        assert abs(error.mean()) < 3e-4


@pytest.mark.parametrize("name", CAMERAS)
def test_more_samples_come_closer_to_brute_force(name: str) -> None:
    camera, camera_T_pad = CAMERAS[name], at_size(CAMERAS[name], 40, (0.3, 0.2, 0.4))
    x, y = centre_px(camera, camera_T_pad, 0.0, 0.0)
    box = (x - 12, y - 12, x + 12, y + 12)
    truth = brute_force(camera, camera_T_pad, PAD, box)
    errors = [
        float(
            np.abs(
                render_pad(camera, camera_T_pad, PAD, supersample=k)[box[1] : box[3], box[0] : box[2]] - truth
            ).mean()
        )
        for k in (2, 4, 8, 16)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.001


def left_edges(image: Linear, rows: slice, middle: int) -> Array:
    """Return where the white begins in each row, in pixels: so much white lies left of `middle`."""
    white: Array = image[rows, :middle, 1].sum(axis=1, dtype=np.float64)
    return middle - 0.5 - white


@pytest.mark.parametrize("size_px", [8.3, 23.7, 61.1, 117.0, 233.0, 401.0])
@pytest.mark.parametrize("yaw", [0.0, 0.02, 0.3, 0.55])
def test_edges_are_never_displaced(size_px: float, yaw: float) -> None:
    z = 1.1 * PINHOLE.fx / size_px
    errors = []
    for phase in np.linspace(0.0, 1.0, 7):
        camera_T_pad = looking_down(z, phase * z / PINHOLE.fx, 0.3 * z / PINHOLE.fx, (0.0, 0.0, yaw))
        image = render_pad(PINHOLE, camera_T_pad, SQUARE)
        # the left edge is y = +0.55 in the pad frame; its line, at the centres of the rows well inside it
        ends = PINHOLE.project(camera_T_pad.apply([[0.55, 0.55, 0.0], [-0.55, 0.55, 0.0]]))
        low, high = sorted(ends[:, 1])
        # less the rows that the top edge cuts left of the middle
        margin = 1.5 + 0.5 * size_px * (np.cos(yaw) + np.sin(yaw) - 1.0 / np.cos(yaw))
        rows = np.arange(int(np.ceil(low + margin)), int(np.floor(high - margin)) + 1)
        slope = (ends[1, 0] - ends[0, 0]) / (ends[1, 1] - ends[0, 1])
        truth = ends[0, 0] + slope * (rows - ends[0, 1])
        middle = int(centre_px(PINHOLE, camera_T_pad, 0.0, 0.0)[0])
        errors.append(left_edges(image, slice(rows[0], rows[-1] + 1), middle) - truth)
    found = np.concatenate(errors)
    assert abs(found.mean()) < 0.001
    assert np.abs(found).max() < 0.02
    assert max(abs(float(e.mean())) for e in errors) < 0.005  # at no phase either


@pytest.mark.parametrize("size_px", [12, 90, 300])
def test_one_pixel_further_is_the_same_picture_one_pixel_further(size_px: int) -> None:
    z = 1.1 * PINHOLE.fx / size_px
    turn = (0.0, 0.0, 0.7)
    here = render_pad(PINHOLE, looking_down(z, 0.0, 0.0, turn), PAD)
    there = render_pad(PINHOLE, looking_down(z, z / PINHOLE.fx, -2.0 * z / PINHOLE.fy, turn), PAD)
    np.testing.assert_allclose(there[:-2, 1:], here[2:, :-1], atol=2e-4)
    assert np.abs(there - here).max() > 0.2


def test_the_upright_tag_is_the_reference_image() -> None:
    # image top along pad x; a module is 12 pixels
    z = 0.02 * PINHOLE.fx / 12.0
    image = render_pad(PINHOLE, looking_down(z), PAD)
    modules = np.array([[c == "." for c in line] for line in REFERENCE.split()])
    at = 12.0 * (np.arange(10) - 4.5)
    seen = image[np.rint(239.5 + at).astype(int)][:, np.rint(319.5 + at).astype(int)]
    np.testing.assert_allclose(seen, np.repeat(modules[:, :, None], 3, axis=2), atol=1e-4)


def test_colours_are_blue_first_and_the_h_stands_upright() -> None:
    camera_T_pad = looking_down(2.0)
    image = encode(render_pad(PINHOLE, camera_T_pad, PAD))

    def seen(x_m: float, y_m: float) -> list[int]:
        x, y = centre_px(PINHOLE, camera_T_pad, x_m, y_m)
        return [int(v) for v in image[y, x]]

    assert seen(0.46, 0.0) == [28, 25, 215]  # ring, at the top
    assert seen(0.0, -0.13) == [20, 20, 20]  # crossbar
    assert seen(0.25, 0.21) == [20, 20, 20]  # top of the left stem
    assert seen(0.25, 0.0) == [255, 255, 255]  # nothing between the stems: it is an H, not an I
    assert seen(0.53, 0.53) == [255, 255, 255]  # board
    assert seen(0.57, 0.0) == [0, 0, 0]  # beside the board


@pytest.mark.parametrize("name", ["pinhole", "barrel"])
def test_apriltags_corners_are_the_projected_ones(name: str) -> None:
    camera, rng = CAMERAS[name], np.random.default_rng(3)
    detector = apriltag("tag36h11", decimate=1.0)
    errors = []
    for _ in range(25):
        z = rng.uniform(1.0, 2.0)  # nearer, the lens bends the edges that AprilTag takes for straight
        a, b, c = rng.normal(0.0, [0.2, 0.2, 1.0])
        x, y = rng.uniform(-0.15, 0.15, 2) * z
        camera_T_pad = looking_down(z, x, y, (a, b, c))
        # the library wants grey levels; these are linear light
        grey = np.rint(render_pad(camera, camera_T_pad, PAD)[:, :, 1] * 255.0).astype(np.uint8)
        found = [d for d in detector.detect(np.ascontiguousarray(grey)) if d["id"] == 5]
        assert len(found) == 1
        # AprilTag: left-bottom, right-bottom, right-top, left-top; first pixel's centre at 0.5
        corners = found[0]["lb-rb-rt-lt"][[3, 2, 1, 0]] - 0.5
        errors.append(corners - tag_corners_px(camera, camera_T_pad, PAD, PAD.tags[0]))
    error = np.concatenate(errors)
    assert np.median(np.linalg.norm(error, axis=1)) < 0.05
    assert np.abs(error.mean(axis=0)).max() < 0.02


@pytest.mark.parametrize("name", CAMERAS)
def test_a_cropped_cameras_picture_is_the_part_of_the_whole(name: str) -> None:
    camera, camera_T_pad = CAMERAS[name], at_size(CAMERAS[name], 250, (0.2, 0.3, 0.5))
    x, y = centre_px(camera, camera_T_pad, 0.3, 0.3)  # the crop's border cuts the pad
    part = render_pad(camera.cropped(x, y, 120, 90), camera_T_pad, PAD, supersample=6)
    whole = render_pad(camera, camera_T_pad, PAD, supersample=6)
    np.testing.assert_allclose(part, whole[y : y + 90, x : x + 120], atol=2e-3)


def test_the_same_call_gives_the_same_bytes() -> None:
    pose = at_size(BARREL, 100, (0.1, 0.2, 0.3))
    assert render_pad(BARREL, pose, PAD).tobytes() == render_pad(BARREL, pose, PAD).tobytes()


def test_the_background_shows_where_the_pad_is_not_and_is_left_alone() -> None:
    rng = np.random.default_rng(0)
    background = rng.uniform(0.0, 1.0, (480, 640, 3)).astype(np.float32)
    kept = background.copy()
    pose = looking_down(4.0, rotvec=(0.0, 0.0, 0.3))
    image = render_pad(PINHOLE, pose, PAD, background=background, light=0.5)
    np.testing.assert_array_equal(background, kept)
    np.testing.assert_array_equal(image[:100], background[:100])
    x, y = centre_px(PINHOLE, pose, 0.25, 0.0)
    np.testing.assert_allclose(image[y, x], 0.5, atol=1e-6)
    # light is mixed by cover: pad alone plus background weighted by what a black pad leaves of it
    black = render_pad(PINHOLE, pose, PAD, background=background, light=0.0)
    np.testing.assert_allclose(image, black + 0.5 * render_pad(PINHOLE, pose, PAD), atol=1e-5)


@pytest.mark.parametrize("name", CAMERAS)
def test_nothing_is_drawn_where_there_is_nothing_to_see(name: str) -> None:
    camera = CAMERAS[name]
    below = Pose(np.eye(3), np.array([0.0, 0.0, 2.0]))  # the pad's z points away from the camera
    poses = [looking_down(-2.0), below, looking_down(2.0, 50.0, 0.0), Pose(looking_down(1.0).rotation, np.zeros(3))]
    for camera_T_pad in poses:
        assert not render_pad(camera, camera_T_pad, PAD).any()


@pytest.mark.parametrize("name", CAMERAS)
def test_a_pad_partly_behind_the_camera_is_drawn_in_front(name: str) -> None:
    # standing on the pad's edge, looking almost along it
    camera = CAMERAS[name]
    camera_T_pad = looking_down(0.1, 0.0, 0.2, (-1.45, 0.0, 0.0))
    image = render_pad(camera, camera_T_pad, SQUARE)
    depth = camera_T_pad.apply([[0.55, 0.0, 0.0], [-0.55, 0.0, 0.0]])[:, 2]
    assert depth.min() < 0.0 < depth.max()
    assert image.any()
    assert not image.all()
    truth = brute_force(camera, camera_T_pad, SQUARE, (310, 460, 330, 480), k=2)
    ahead = image[460:, 310:330]
    assert np.abs(ahead - truth).mean() < 0.02


@pytest.mark.parametrize(("x", "y"), [(0.58, 0.0), (-0.58, 0.43), (0.0, -0.43), (0.57, 0.43)])
def test_a_pad_on_the_border_is_the_part_of_a_larger_picture(x: float, y: float) -> None:
    larger = replace(PINHOLE, width=1040, height=880, cx=PINHOLE.cx + 200, cy=PINHOLE.cy + 200)
    pose = looking_down(3.0, 3.0 * x, 3.0 * y, (0.2, 0.1, 0.4))
    image = render_pad(PINHOLE, pose, PAD, supersample=4)
    assert image.any()
    np.testing.assert_allclose(image, render_pad(larger, pose, PAD, supersample=4)[200:680, 200:840], atol=1e-3)


def test_a_lens_polynomial_is_not_followed_beyond_its_valid_circle() -> None:
    # r (1 - 0.8 r^2) turns back at r = 0.65: outside it the image has no rays, and nothing may be drawn there
    camera = Camera(640, 480, 400.0, 400.0, 319.5, 239.5, "plumb_bob", (-0.8, 0.0, 0.0, 0.0, 0.0))
    rays = pixel_corner_rays(camera)
    assert np.isnan(rays[0, 0]).all()
    assert np.isfinite(rays[240, 320]).all()
    image = render_pad(camera, looking_down(0.3), SQUARE)
    assert not image[0, 0].any()
    assert image[240, 320].all()


@pytest.mark.parametrize("samples", [1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144, 233, 377])
def test_sample_places_are_even_and_symmetric(samples: int) -> None:
    weights = sample_weights(samples).astype(np.float64)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-6)
    places = np.column_stack([weights[:, 1] + weights[:, 3], weights[:, 2] + weights[:, 3]])
    assert places.min() > 0.0
    assert places.max() < 1.0

    def ordered(points: Array) -> Array:
        return np.array(sorted(np.round(points, 5).tolist()))

    np.testing.assert_allclose(ordered(places), ordered(1.0 - places), atol=2e-5)
    for axis in (0, 1):
        np.testing.assert_allclose(np.sort(places[:, axis]), (np.arange(samples) + 0.5) / samples, atol=1e-5)


def test_requests_that_make_no_sense_are_refused() -> None:
    with pytest.raises(UsageError, match="background"):
        render_pad(PINHOLE, looking_down(2.0), PAD, background=np.zeros((10, 10, 3), np.float32))
    for k in (0, -1, 20):
        with pytest.raises(UsageError, match="supersample"):
            render_pad(PINHOLE, looking_down(2.0), PAD, supersample=k)


def test_encoding_is_the_curve_then_rounding() -> None:
    grey = np.arange(256, dtype=np.float32) / 255.0
    linear = np.repeat(srgb_decode(grey)[None, :, None], 3, axis=2)
    np.testing.assert_array_equal(encode(linear)[0, :, 0], np.arange(256))
    np.testing.assert_array_equal(encode(grey[None, :, None], curve="linear")[0, :, 0], np.arange(256))
    np.testing.assert_array_equal(encode(grey[None, :, None] ** 2.2, curve=2.2)[0, :, 0], np.arange(256))


def test_blur_acts_on_light_before_the_curve() -> None:
    linear = np.zeros((41, 41, 3), np.float32)
    linear[:, 20:] = 1.0
    blurred = encode(linear, blur_sigma_px=1.5, curve="linear")[20, :, 0] / 255.0
    assert blurred.sum() == pytest.approx(21.0, abs=0.05)
    encoded = encode(linear, blur_sigma_px=1.5)[20, :, 0] / 255.0
    np.testing.assert_allclose(encoded, srgb_encode(blurred), atol=0.03)
    assert 0.0 < blurred[19] < 0.5 < blurred[20] < 1.0


def test_noise_is_of_the_given_grey_levels_and_from_the_given_generator() -> None:
    linear = np.full((200, 200, 3), 0.2, np.float32)
    first = encode(linear, noise_sigma=3.0, rng=np.random.default_rng(7))
    again = encode(linear, noise_sigma=3.0, rng=np.random.default_rng(7))
    np.testing.assert_array_equal(first, again)
    assert first.std() == pytest.approx(np.hypot(3.0, 12**-0.5), rel=0.02)
    assert first.mean() == pytest.approx(255.0 * float(srgb_encode(0.2)), abs=0.05)
    with pytest.raises(UsageError, match="generator"):
        encode(linear, noise_sigma=3.0)
