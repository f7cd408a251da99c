from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.synth.compose import render
from landtool.synth.faces import Faces
from landtool.synth.fog import Fog
from landtool.synth.mesh import box
from landtool.synth.raster import paint
from landtool.synth.scene import Sun
from landtool.synth.view import View
from landtool.tone import srgb_decode, srgb_encode
from tests.unit.synth.views import BENT, PAD, PINHOLE, over, scene_of

FLAT = Pose.from_rotvec([0.0, 0.0, 0.5], [0.0, 0.0, 0.3])


def test_a_face_covers_the_share_of_each_pixel_that_it_fills() -> None:
    view = View.still(PINHOLE, over(2.0))
    square = np.array([[0.31, 0.27, 0.0], [-0.29, 0.33, 0.0], [-0.35, -0.3, 0.0], [0.3, -0.31, 0.0]])
    share = paint(view, Faces.of([square], 5), exact=5).coverage(5)
    x, y = view.project(square).T
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert share.sum() == pytest.approx(area, rel=2e-3)


def test_of_two_faces_the_later_is_seen() -> None:
    view = View.still(BENT, over(2.0))
    low = np.array([[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]])
    raster = paint(view, Faces.joined([Faces.of([low], 3), Faces.of([0.4 * low + (0.0, 0.0, 0.2)], 7)]))
    assert raster.centre[121, 158] == 7
    total = raster.coverage(3) + raster.coverage(7)
    assert total[121, 158] == 1.0
    assert 0 < raster.coverage(7).sum() < raster.coverage(3).sum() + raster.coverage(7).sum()


def test_faces_partly_behind_the_camera_are_clipped_not_folded() -> None:
    view = View.still(Camera.from_hfov(320, 240, 90.0), over(1.0, tilt_rad=0.9))
    endless = np.array([[300.0, 1.0, 0.0], [-300.0, 1.0, 0.0], [-300.0, -1.0, 0.0], [300.0, -1.0, 0.0]])
    share = paint(view, Faces.of([endless], 2)).coverage(2)
    depth = view.plane_depth(0.0)
    y = view.origin(1) + np.where(np.isfinite(depth), depth, 0.0) * view.rays[1]
    inside = np.isfinite(depth) & (np.abs(y) < 0.97)
    outside = ~np.isfinite(depth) | (np.abs(y) > 1.03)
    assert inside.any()
    assert (share[inside] > 0.9).all()
    assert (share[outside] < 0.1).all()


@pytest.mark.parametrize("camera", [PINHOLE, BENT])
def test_distances_are_those_along_the_sight(camera: Camera) -> None:
    block = box((0.8, 0.6, 1.2), (0.9, 0.5, 0.6), (0.3, 0.3, 0.3))
    view = View.still(camera, over(6.0, tilt_rad=0.2))
    rendered = render(scene_of(FLAT, things=((block,),)), view)
    for point in ([0.9, 0.5, 1.2], [0.2, -0.2, 0.5], [-1.2, 0.8, 0.0]):
        pixel = np.rint(view.project(np.array([point]))[0]).astype(int)
        exact = float(np.linalg.norm(np.array(point) - view.world_T_camera.translation))
        assert rendered.distance_m[pixel[1], pixel[0]] == pytest.approx(exact, rel=5e-3)


def test_what_stands_over_the_pad_hides_its_share() -> None:
    view = View.still(PINHOLE, over(4.0))
    free = render(scene_of(FLAT), view)
    assert free.hidden == pytest.approx(0.0, abs=0.01)
    half = box((2.0, 1.0, 0.01), (0.0, 0.5, 0.02), (0.2, 0.2, 0.2))  # in the pad's frame, its left half
    scene = scene_of(FLAT)
    assert scene.target is not None
    covered = render(replace(scene, target=replace(scene.target, above=(half,))), view)
    assert covered.hidden == pytest.approx(0.5, abs=0.03)


def test_the_shadow_of_a_body_falls_away_from_the_sun() -> None:
    post = box((0.2, 0.2, 2.0), (1.0, 0.0, 1.0), (0.3, 0.3, 0.3))
    low = Sun((0.6, 0.0, 0.8), (0.8, 0.8, 0.8), (0.2, 0.2, 0.2))
    view = View.still(PINHOLE, over(6.0))
    scene = replace(scene_of(FLAT, things=((post,),)), sun=low)
    shaded, bright = (render(replace(scene, things=t), view).linear for t in (((post,),), ()))
    # 2 m of height throw 1.5 m of shadow towards -x
    inside = np.rint(view.project(np.array([[0.0, -0.02, 0.0]]))[0]).astype(int)
    before = np.rint(view.project(np.array([[1.6, 0.0, 0.0]]))[0]).astype(int)
    assert shaded[inside[1], inside[0]].mean() < 0.5 * bright[inside[1], inside[0]].mean()
    assert shaded[before[1], before[0]].mean() > 0.8 * bright[before[1], before[0]].mean()


def test_a_leaning_deck_does_not_shade_the_pad_on_it_but_a_wall_on_it_does() -> None:
    leaning = Pose.from_rotvec([0.0, 0.0, 1.0], [0.2, -0.1, 0.3])
    deck = box((3.0, 2.0, 0.2), (0.0, 0.0, -0.1), (0.4, 0.3, 0.2))
    wall = box((2.0, 0.1, 1.5), (0.0, -0.8, 0.75), (0.4, 0.3, 0.2))
    sun = Sun((0.0, -0.8, 0.6), (0.8, 0.8, 0.8), (0.2, 0.2, 0.2))
    view = View.still(PINHOLE, over(5.0))
    scene = replace(scene_of(leaning), sun=sun)
    assert scene.target is not None
    shaded = {
        name: render(replace(scene, target=replace(scene.target, carrier=carrier)), view).shaded
        for name, carrier in (("deck", (deck,)), ("walled", (deck, wall)))
    }
    assert shaded["deck"] == 0.0
    assert shaded["walled"] > 0.5


def test_fog_is_undone_by_the_true_transmission_within_two_grey_levels() -> None:
    """Where enough of the light got through for the picture's rounding: t over a half."""
    view = View.still(BENT, over(6.0, tilt_rad=0.3))
    rendered = render(scene_of(FLAT), view)
    clear = np.clip(rendered.linear, 0.0, 1.0)
    for visibility_m in (60.0, 150.0):
        fog = Fog.of_visibility(visibility_m, (0.5, 0.5, 0.5), bank_strength=0.5)
        t = fog.transmission(rendered.distance_m, rendered.x_m, rendered.y_m, (0.0, 0.0))
        foggy = fog.apply(clear.copy(), t)
        back = fog.invert(foggy, t)
        grey = 255.0 * np.abs(_encoded(back) - _encoded(clear))
        assert grey.max() < 0.5  # as light
        stored = np.rint(255.0 * _encoded(foggy)) / 255.0
        again = fog.invert(srgb_decode(stored).astype(np.float32), t)
        grey = np.abs(255.0 * _encoded(again) - 255.0 * _encoded(clear))
        bright = (t > 0.5)[:, :, None] & (clear > 0.1)
        assert bright.any()
        assert grey[bright].max() < 2.0


def _encoded(linear: np.ndarray) -> np.ndarray:
    return np.asarray(srgb_encode(linear))


def test_the_pad_is_where_its_pose_says() -> None:
    view = View.still(BENT, over(3.0, tilt_rad=0.25, yaw_rad=0.5))
    linear = render(scene_of(FLAT), view).linear
    ring = 0.46 * PAD.diameter_m
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        point = FLAT.apply(np.array([[ring * np.cos(angle), ring * np.sin(angle), 0.0]]))
        u, v = np.rint(view.project(point)[0]).astype(int)
        blue, _, red = linear[v, u]
        assert red > 10.0 * blue
