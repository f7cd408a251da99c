from __future__ import annotations

import csv

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec, Ring
from landtool.synth.truth import ring_box_px
from landtool.target.ellipse import Ellipse, circle, contour, start_ellipses
from landtool.target.ring import fit_ring
from landtool.types import Image
from tests.scenes import CAMERA, PAD, photograph, view
from tests.shared import shared_data

BENT = Camera(640, 480, 554.0, 554.0, 319.5, 239.5, distortion=(-0.15, 0.05, 0.001, -0.001, 0.0))


def true_box(camera_T_pad: Pose, camera: Camera = CAMERA, pad: PadSpec = PAD) -> Array:
    box = ring_box_px(camera, camera_T_pad, pad)
    assert box is not None
    return box


def shaken(box: Array, rng: np.random.Generator) -> Array:
    """Return the box as a network might have it: each edge off by up to 12 % and a pixel; cut edges stay cut."""
    side = np.tile(box[2:] - box[:2], 2)
    moved = box + rng.uniform(-0.12, 0.12, 4) * side + rng.uniform(-1.0, 1.0, 4)
    border = np.array([-0.5, -0.5, 639.5, 479.5])
    return np.clip(np.where(box == border, border, moved), -0.5, [639.5, 479.5] * 2)


def iou(a: Array, b: Array) -> float:
    common = float(np.prod(np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0.0)))
    return common / (float(np.prod(a[2:] - a[:2])) + float(np.prod(b[2:] - b[:2])) - common)


@pytest.mark.parametrize(
    ("distance_m", "most_px"),
    # 14, 25, 55, 140 and 350 pixels wide
    [(40.0, 0.25), (22.0, 0.2), (10.0, 0.2), (4.0, 0.3), (1.6, 0.6)],
)
@pytest.mark.parametrize("camera", [CAMERA, BENT])
def test_ring_is_found_to_a_fraction_of_a_pixel(distance_m: float, most_px: float, camera: Camera) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(distance_m, rng.uniform(0, 35), rng.uniform(0, 6.28), rng.uniform(0, 6.28), (0.05, -0.04))
        image = photograph(camera_T_pad, rng, camera=camera, grey_noise=1.5)
        truth = true_box(camera_T_pad, camera)
        fit = fit_ring(image, shaken(truth, rng), PAD)
        assert fit is not None
        assert np.abs(fit.box_px(640, 480) - truth).max() < most_px
        assert fit.share > 0.7


def test_its_standard_error_is_honest() -> None:
    errors = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(rng.uniform(10, 30), rng.uniform(0, 30), rng.uniform(0, 6.28), rng.uniform(0, 6.28))
        truth = true_box(camera_T_pad)
        fit = fit_ring(photograph(camera_T_pad, rng), shaken(truth, rng), PAD)
        if fit is not None:
            errors.append(np.abs(fit.box_px(640, 480) - truth) / fit.sigma_px)
    assert len(errors) > 13
    assert 0.15 < np.sqrt(np.mean(np.square(errors))) < 2.5


def test_a_ring_cut_by_the_border_is_found_from_what_is_seen() -> None:
    for seed, off in enumerate([(0.56, 0.0), (-0.55, 0.1), (0.1, 0.42), (0.55, -0.41)]):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(4.0, 10.0, 0.4, 1.0, off)
        truth = true_box(camera_T_pad)
        assert (truth == [-0.5, -0.5, 639.5, 479.5]).any()
        fit = fit_ring(photograph(camera_T_pad, rng), shaken(truth, rng), PAD)
        assert fit is not None
        assert np.abs(fit.box_px(640, 480) - truth).max() < 1.0


def test_a_quarter_hidden_does_not_pull() -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(6.0, 15.0, 0.4, 1.0)
        image, truth = photograph(camera_T_pad, rng), true_box(camera_T_pad)
        column, row = (truth[:2] + truth[2:]).astype(int) // 2
        image[row:, column:] = (40, 90, 60)
        fit = fit_ring(image, shaken(truth, rng), PAD)
        assert fit is not None
        assert iou(fit.box_px(640, 480), truth) > 0.97
        assert fit.share < 0.85


def test_an_orange_frame_around_the_board_is_not_taken_for_the_ring() -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(12.0, 10.0, 0.4, 0.8)
        image, truth = photograph(camera_T_pad, rng), true_box(camera_T_pad)
        board = PAD.shapes()[0].points_m
        corners = CAMERA.project(camera_T_pad.apply(np.column_stack([1.15 * board, np.zeros(4)])))
        cv2.polylines(image, [corners.round().astype(np.int32)], True, (0, 110, 255), 3)
        fit = fit_ring(image, shaken(truth, rng), PAD)
        assert fit is not None
        assert iou(fit.box_px(640, 480), truth) > 0.96


def grey(image: Image, _: Array) -> Image:
    return np.asarray(cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR), np.uint8)


def foggy(image: Image, _: Array) -> Image:
    noise = np.random.default_rng(1).normal(0.0, 2.0, image.shape)
    return np.asarray(np.clip(200.0 + 0.01 * image + noise, 0, 255), np.uint8)


def blurred(image: Image, box: Array) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.2 * float((box[2:] - box[:2]).min())), np.uint8)


def hidden(image: Image, box: Array) -> Image:
    covered = image.copy()
    covered[:, int(0.7 * box[0] + 0.3 * box[2]) :] = (40, 90, 60)
    return covered


@pytest.mark.parametrize("spoil", [grey, foggy, blurred, hidden])
@pytest.mark.parametrize("distance_m", [20.0, 6.0])
def test_it_declines_what_the_picture_does_not_support(spoil: object, distance_m: float) -> None:
    assert callable(spoil)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(distance_m, 15.0, 0.4, 1.0)
        truth = true_box(camera_T_pad)
        image = spoil(photograph(camera_T_pad, rng), truth)
        assert fit_ring(image, shaken(truth, rng), PAD) is None


@pytest.mark.parametrize("seed", range(3))
def test_it_declines_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (480, 640, 3), dtype=np.uint8)
    for side in (14.0, 40.0, 150.0):
        assert fit_ring(image, np.array([200.0, 150.0, 200.0 + side, 150.0 + side]), PAD) is None


@pytest.mark.parametrize(
    "box",
    [
        [-0.5, -0.5, 639.5, 479.5],  # cut on all sides
        [100.0, 100.0, 103.0, 103.0],
        [100.0, 100.0, 90.0, 120.0],
        [np.nan, 0.0, 50.0, 50.0],
        [-0.5, 100.0, 639.5, 140.0],
    ],
)
def test_boxes_that_say_too_little_are_declined(box: list[float]) -> None:
    image = photograph(view(4.0, 10.0, 0.4, 1.0), np.random.default_rng(0))
    assert fit_ring(image, np.array(box), PAD) is None


def test_a_pad_without_a_ring_is_declined() -> None:
    camera_T_pad = view(4.0, 10.0, 0.4, 1.0)
    image = photograph(camera_T_pad, np.random.default_rng(0))
    assert fit_ring(image, true_box(camera_T_pad), PadSpec(ring=None)) is None


def test_the_pads_own_ring_counts() -> None:
    pad = PadSpec(ring=Ring(outer=0.9, inner=0.7))
    camera_T_pad = view(8.0, 10.0, 0.4, 1.0)
    rng = np.random.default_rng(0)
    truth = true_box(camera_T_pad, pad=pad)
    fit = fit_ring(photograph(camera_T_pad, rng, pad=pad), shaken(truth, rng), pad)
    assert fit is not None
    assert np.abs(fit.box_px(640, 480) - truth).max() < 0.5


def test_the_box_of_an_ellipse_is_that_of_its_points() -> None:
    ellipse = Ellipse(10.0, -4.0, 8.0, 3.0, -0.6)
    points = contour(ellipse, circle(4000)).points
    assert np.concatenate([points.min(axis=1), points.max(axis=1)]) == pytest.approx(ellipse.box_px, abs=1e-4)
    axes, angle = ellipse.axes
    along = np.array([np.cos(angle), np.sin(angle)]) @ (points - [[10.0], [-4.0]])
    assert along.max() == pytest.approx(axes[0], abs=1e-4)


def test_the_jacobian_is_the_motion_of_the_tangents() -> None:
    ellipse, step = Ellipse(10.0, -4.0, 8.0, 3.0, -0.6), 1e-6
    at = contour(ellipse, circle(24))
    for k in range(5):
        moved = ellipse.moved(step * np.eye(5)[k])
        mixed = moved.slant * moved.sx_px * moved.sy_px
        shape = np.array([[moved.sx_px**2, mixed], [mixed, moved.sy_px**2]])
        # where the tangent with the same normal lies now
        support = np.sqrt(np.einsum("in,ij,jn->n", at.normals, shape, at.normals))
        shift = support - at.reach_px + np.array([moved.cx_px - 10.0, moved.cy_px + 4.0]) @ at.normals
        assert shift / step == pytest.approx(at.jacobian[:, k], abs=1e-4)


def test_a_start_from_a_cut_box_is_the_circle_through_what_is_seen() -> None:
    # a circle of radius 50 about (20, 100): cut at x = -0.5, its whole height in the picture
    (start,) = start_ellipses(np.array([-0.5, 50.0, 70.0, 150.0]), np.array([False, True, True, True]))
    assert (start.cx_px, start.cy_px, start.sx_px, start.sy_px) == pytest.approx((20.0, 100.0, 50.0, 50.0))
    # about (-30.5, 100): a chord of 80 is seen, of rise 20
    (start,) = start_ellipses(np.array([-0.5, 60.0, 19.5, 140.0]), np.array([False, True, True, True]))
    assert (start.cx_px, start.cy_px, start.sx_px) == pytest.approx((-30.5, 100.0, 50.0))


def test_path_traced_boxes_get_better() -> None:
    folder = shared_data("rendered/stills")
    rng = np.random.default_rng(0)
    taken, before, after = 0, [], []
    with (folder / "labels.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["present"] == "1"]
    for row in rows:
        image = np.asarray(cv2.imread(str(folder.parent / row["file"])), np.uint8)
        truth = np.array([float(row[name]) for name in ("x_min", "y_min", "x_max", "y_max")]) - 0.5
        box = shaken(truth, rng)
        fit = fit_ring(image, box, PAD)
        if fit is not None:
            taken += 1
            before.append(iou(box, truth))
            after.append(iou(fit.box_px(640, 480), truth))
    assert taken > 0.65 * len(rows)
    assert np.mean(after) > 0.97
    assert (np.array(after) > np.array(before) - 0.02).all()
