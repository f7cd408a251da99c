from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.pad import PadSpec, Ring
from landtool.synth.render import render_pad
from landtool.synth.truth import ring_box_px, tag_corners_px, visible
from tests.unit.synth.brute import BARREL, FISHEYE, PINHOLE, looking_down

PAD = PadSpec()
# a white disc and nothing else, to measure where it is drawn
DISC = PadSpec(board=None, ring=Ring(1.0, 1e-6, (255, 255, 255)), letter=None, quiet_zone=None, tags=())


def test_corners_go_round_from_the_upright_tags_top_left() -> None:
    corners = tag_corners_px(PINHOLE, looking_down(2.0), PAD, PAD.tags[0])
    half = 0.08 * 554.0 / 2.0
    around = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    np.testing.assert_allclose(corners, around + (319.5, 239.5), atol=1e-9)
    assert np.isnan(tag_corners_px(PINHOLE, looking_down(-2.0), PAD, PAD.tags[0])).all()


def test_the_box_of_a_ring_seen_straight_down_is_its_diameter() -> None:
    box = ring_box_px(PINHOLE, looking_down(2.77, 0.1, -0.2), PAD)
    assert box is not None
    centre = np.array([319.5, 239.5]) + np.array([0.1, -0.2]) * 200.0
    np.testing.assert_allclose(box, [*(centre - 100.0), *(centre + 100.0)], atol=2e-3)


@pytest.mark.parametrize("camera", [PINHOLE, BARREL, FISHEYE], ids=["pinhole", "barrel", "fisheye"])
@pytest.mark.parametrize("x", [0.0, 0.9, -0.9])
def test_box_and_visible_part_are_those_of_the_drawn_disc(camera: Camera, x: float) -> None:
    camera, pose = camera.scaled(320, 240), looking_down(1.6, x, 0.1, (0.3, -0.2, 0.4))
    drawn = render_pad(camera, pose, DISC)[:, :, 0]
    box, share = ring_box_px(camera, pose, PAD), visible(camera, pose, PAD)
    assert box is not None
    columns, rows = np.flatnonzero((drawn > 0.01).any(axis=0)), np.flatnonzero((drawn > 0.01).any(axis=1))
    seen = [columns[0] - 0.5, rows[0] - 0.5, columns[-1] + 0.5, rows[-1] + 0.5]
    # a pixel is drawn where the disc has any of it, so its border is at most one pixel outside the box
    outside = (np.array(seen) - box) * [-1, -1, 1, 1]
    assert outside.min() > -0.1
    assert outside.max() < 1.0
    whole = ring_box_px(camera, pose, PAD, clip=False)
    assert whole is not None
    assert (whole[:2] <= box[:2]).all()
    assert (whole[2:] >= box[2:]).all()
    larger = replace(camera, width=720, height=640, cx=camera.cx + 200, cy=camera.cy + 200)
    assert share == pytest.approx(drawn.sum() / render_pad(larger, pose, DISC)[:, :, 0].sum(), abs=2e-3)


def test_half_a_ring_on_the_border_is_half_visible() -> None:
    # its centre on the image's left edge, at -0.5
    pose = looking_down(2.77, -320.0 / 200.0, 0.0)
    assert visible(PINHOLE, pose, PAD) == pytest.approx(0.5, abs=1e-4)
    box = ring_box_px(PINHOLE, pose, PAD)
    assert box is not None
    np.testing.assert_allclose(box, [-0.5, 139.5, 99.5, 339.5], atol=0.02)


def test_what_is_not_seen_has_no_box() -> None:
    upside_down = Pose(np.eye(3), np.array([0.0, 0.0, 2.0]))
    for pose in (upside_down, looking_down(-2.0), looking_down(2.0, 9.0, 0.0)):
        assert ring_box_px(PINHOLE, pose, PAD) is None
        assert visible(PINHOLE, pose, PAD) == 0.0
    without = PadSpec(ring=None)
    assert ring_box_px(PINHOLE, looking_down(2.0), without) is None
    assert visible(PINHOLE, looking_down(2.0), PAD) == pytest.approx(1.0)
