from __future__ import annotations

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Pose, rotvec_from_rotation
from landtool.pad import PadSpec
from landtool.synth.render import encode, render_pad
from landtool.tags.pose import Corners, Solution, pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.target.edges import measure_edges
from landtool.target.refine import refine_on_edges
from landtool.types import Image
from tests.scenes import CAMERA, PAD, photograph, view

BENT = Camera(640, 480, 554.0, 554.0, 319.5, 239.5, distortion=(-0.15, 0.05, 0.001, -0.001, 0.0))


def solved(image: Image, camera: Camera = CAMERA) -> tuple[Corners, tuple[Solution, ...]]:
    corners = pad_corners(TagReader(ReaderConfig.of_pad(PAD)).read_frame(image), camera, PAD)
    assert corners is not None
    return corners, pad_solutions(corners)


@pytest.mark.parametrize("camera", [CAMERA, BENT])
def test_edges_are_where_the_truth_has_them(camera: Camera) -> None:
    camera_T_pad = view(4.0, 20.0, 1.0, 0.5, off=(0.1, -0.1))
    image = photograph(camera_T_pad, np.random.default_rng(0), camera=camera)
    edges = measure_edges(image, camera, camera_T_pad, PAD, "srgb")
    assert edges is not None
    assert edges.share == 1.0
    assert np.std(edges.offsets_px) < 0.12
    assert abs(np.mean(edges.offsets_px)) < 0.03


def test_edges_show_a_shift() -> None:
    camera_T_pad = view(4.0, 10.0, 1.0, 0.5)
    image = photograph(camera_T_pad, np.random.default_rng(0))
    one_px = 4.0 / CAMERA.fx
    edges = measure_edges(image, CAMERA, camera_T_pad.perturbed([one_px, 0, 0, 0, 0, 0]), PAD, "srgb")
    assert edges is not None
    # the picture lies one pixel to the left of where that pose has it
    assert edges.offsets_px == pytest.approx(-edges.normals[:, 0], abs=0.4)


def test_wrong_tone_moves_dark_edges_inwards() -> None:
    camera_T_pad = view(4.0, 0.0, 1.0, 0.5)
    image = photograph(camera_T_pad, np.random.default_rng(0), grey_noise=0.1)
    edges = measure_edges(image, CAMERA, camera_T_pad, PAD, "none")
    assert edges is not None
    assert np.mean(edges.offsets_px) > 0.1


@pytest.mark.parametrize("seed", range(4))
def test_either_mirror_pose_leads_to_the_truth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera_T_pad = view(4.5, 5.0, rng.uniform(0, 6.28), rng.uniform(0, 6.28))
    image = photograph(camera_T_pad, rng)
    corners, solutions = solved(image)
    for start in solutions:
        refined = refine_on_edges(image, corners, start, PAD, "srgb")
        assert refined is not None
        assert np.degrees(refined.camera_T_pad.angle_to(camera_T_pad)) < 0.6


def test_the_covariance_is_honest() -> None:
    nees = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        camera_T_pad = view(3.5, rng.uniform(2, 25), rng.uniform(0, 6.28), rng.uniform(0, 6.28))
        image = photograph(camera_T_pad, rng)
        corners, solutions = solved(image)
        refined = refine_on_edges(image, corners, solutions[0], PAD, "srgb")
        assert refined is not None
        pose = refined.camera_T_pad
        error = np.concatenate(
            [
                camera_T_pad.translation - pose.translation,
                rotvec_from_rotation(camera_T_pad.rotation @ pose.rotation.T),
            ]
        )
        nees.append(error @ np.linalg.solve(refined.covariance, error))
    # the edges' floor makes it a little cautious; over-confidence is what must not happen
    assert 2.5 < np.mean(nees) < 7.4  # chi-square of 6, the upper 95 % bound of the mean of 30


def test_a_covered_pad_leaves_the_tag_to_itself() -> None:
    camera_T_pad = view(3.0, 5.0, 1.0, 0.5)
    image = photograph(camera_T_pad, np.random.default_rng(0))
    corners, solutions = solved(image)
    centre = CAMERA.project(camera_T_pad.translation[None])[0].astype(int)
    keep = image[centre[1] - 22 : centre[1] + 22, centre[0] - 22 : centre[0] + 22].copy()
    image[:] = 90
    image[centre[1] - 22 : centre[1] + 22, centre[0] - 22 : centre[0] + 22] = keep
    assert refine_on_edges(image, corners, solutions[0], PAD, "srgb") is None


def test_a_pad_without_ring_and_letter_has_no_edges() -> None:
    bare = PadSpec(ring=None, letter=None)
    camera_T_pad = Pose(view(2.0, 5.0, 1.0, 0.5).rotation, np.array([0.0, 0.0, 2.0]))
    image = photograph(camera_T_pad, np.random.default_rng(0), pad=bare)
    assert measure_edges(image, CAMERA, camera_T_pad, bare, "srgb") is None


@pytest.mark.parametrize("seed", range(3))
def test_a_bare_tag_on_a_busy_ground_is_left_to_itself(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bare = PadSpec(board=None, ring=None, letter=None)
    camera_T_pad = view(3.5, 8.0, rng.uniform(0, 6.28), rng.uniform(0, 6.28))
    clutter = cv2.GaussianBlur(rng.uniform(0.0, 1.0, (480, 640, 3)).astype(np.float32), (0, 0), 2.0)
    clutter = np.clip((clutter - 0.5) * 6.0 + 0.4, 0.0, 1.0)
    scene = render_pad(CAMERA, camera_T_pad, bare, background=clutter)
    image = encode(0.8 * scene, blur_sigma_px=0.6, noise_sigma=3.0, rng=rng)
    corners, solutions = solved(image)
    assert refine_on_edges(image, corners, solutions[0], PAD, "srgb") is None
