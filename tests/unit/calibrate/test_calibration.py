from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from landtool.calibrate.board import KINDS, Board, BoardKind
from landtool.calibrate.calibration import Calibration, NamedView, calibrate_views
from landtool.calibrate.choose import choose_views, coverage
from landtool.calibrate.corners import BoardView
from landtool.calibrate.models import better_model
from landtool.calibrate.picture import _draw_uncertainty, draw_report
from landtool.calibrate.solve import solve
from landtool.calibrate.text import calibration_lines, calibration_values
from landtool.camera import Camera, DistortionModel
from landtool.errors import InputError
from landtool.geometry import Array, Pose
from tests.unit.calibrate.scenes import CAMERAS, PINHOLE, SIZE, straight, views


def named(found: list[BoardView]) -> list[NamedView]:
    return [NamedView(i, f"{i}.png", view) for i, view in enumerate(found)]


def exact(board: Board, camera: Camera, pose: Pose, rng: np.random.Generator, sigma: float = 0.05) -> BoardView:
    """A view without pictures: the truth and noise."""
    pixels = camera.project(pose.apply(board.points_m))
    ids = np.flatnonzero(np.isfinite(pixels).all(axis=1))
    noisy = pixels[ids] + rng.normal(0.0, sigma, (len(ids), 2))
    return BoardView(ids, noisy, np.full(len(ids), sigma), np.full(len(ids), 0.8))


def many(count: int = 20, *, tilt: float = 0.5, camera: Camera = PINHOLE, seed: int = 0) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    board, found = Board(), []
    for _ in range(count):
        turn = Pose.from_rotvec(np.zeros(3), rng.uniform(-tilt, tilt, 3))
        middle = np.array([*(v / 2 for v in board.extent_m), 0.0])
        z = rng.uniform(0.22, 0.4)
        place = np.array([*rng.uniform(-0.3, 0.3, 2) * z, z])
        found.append(exact(board, camera, Pose(turn.rotation, place - turn.rotation @ middle), rng))
    return found


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lens", ["pinhole", "fisheye", pytest.param("tele", marks=pytest.mark.full)])
def test_the_camera_of_rendered_boards_comes_back(kind: BoardKind, lens: str) -> None:
    truth = CAMERAS[lens]
    found = solve(Board.usual(kind), [view for view, _ in views(kind, lens)], SIZE, truth.model)
    camera, sigma = found.camera, found.sigmas
    assert abs(camera.fx / truth.fx - 1) < 0.002
    assert abs(camera.fy / truth.fy - 1) < 0.002
    error = np.array([camera.fx - truth.fx, camera.fy - truth.fy, camera.cx - truth.cx, camera.cy - truth.cy])
    if lens != "tele":  # ten views through it say the principal point to half a pixel only
        assert np.abs(error[2:]).max() < 1.0
    assert (np.abs(error) < 4.0 * sigma[:4]).all()


def test_uncertainties_are_honest() -> None:
    z = []
    for seed in range(16):
        found = solve(Board(), many(10, seed=seed), SIZE, "plumb_bob")
        camera = found.camera
        got: Array = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])
        true = np.array([PINHOLE.fx, PINHOLE.fy, PINHOLE.cx, PINHOLE.cy, *PINHOLE.distortion])
        z.append(((got - true) / np.where(found.sigmas > 0, found.sigmas, np.inf))[found.free])
    values = np.abs(np.concatenate(z))
    assert 0.5 < np.median(values) < 0.95
    assert (values < 3.0).mean() > 0.97


def test_outlying_corners_and_views_take_no_part() -> None:
    found = many(16)
    rng = np.random.default_rng(5)
    for view in found[:8]:
        view.pixels[rng.integers(0, len(view.ids), 3)] += 6.0
    found[3] = replace(found[3], pixels=found[3].pixels + rng.normal(0.0, 3.0, found[3].pixels.shape))
    result = calibrate_views(Board(), named(found), SIZE, "plumb_bob")
    assert [refused.frame for refused in result.refused] == [3]
    assert "does not fit the others" in result.refused[0].reason
    assert abs(result.camera.fx / PINHOLE.fx - 1) < 0.001


def test_blurred_views_are_refused() -> None:
    found = many(12)
    found[5] = replace(found[5], blur_px=np.full_like(found[5].blur_px, 2.5))
    result = calibrate_views(Board(), named(found), SIZE, "plumb_bob")
    assert [(r.frame, r.reason) for r in result.refused] == [(5, "blurred by 2.5 px")]


def test_what_the_data_does_not_say_is_left_at_zero() -> None:
    plain = Camera(640, 480, 520.0, 522.0, 315.0, 244.0)
    found = solve(Board(), many(camera=plain), SIZE, "plumb_bob")
    assert found.camera.distortion[4] == 0.0
    assert not found.free[8]
    bent = replace(PINHOLE, distortion=(-0.28, 0.2, 0.0, 0.0, -0.12))
    assert solve(Board(), many(30, camera=bent), SIZE, "plumb_bob").free[8]


def test_a_rational_lens_is_solved() -> None:
    found = solve(Board(), many(), SIZE, "rational_polynomial")
    rays = np.column_stack([np.random.default_rng(0).uniform(-0.4, 0.4, (50, 2)), np.ones(50)])
    assert np.abs(found.camera.project(rays) - PINHOLE.project(rays)).max() < 0.5


def warned(found: list[BoardView]) -> Calibration:
    return calibrate_views(Board(), named(found), SIZE, "plumb_bob")


def test_poor_views_are_said() -> None:
    good = warned(many(25))
    assert good.verdict == "good"
    assert good.warnings == ()
    few = warned(many(4))
    assert any("only 4 views" in text for text in few.warnings)
    assert few.verdict != "good"
    rng = np.random.default_rng(0)
    left = [replace(v, pixels=v.pixels[k], ids=v.ids[k], sigma_px=v.sigma_px[k], blur_px=v.blur_px[k])
            for v in many(25) for k in [v.pixels[:, 0] < 420] if k.sum() > 20]  # fmt: skip
    assert any("at the right" in text for text in warned(left).warnings)
    flat = []
    for z in rng.uniform(0.25, 0.4, 15):
        pose = straight(float(z))
        flat.append(exact(Board(), PINHOLE, Pose(Pose.from_rotvec(np.zeros(3), rng.normal(0, 0.03, 3)).rotation,
                                                pose.translation), rng))  # fmt: skip
    result = warned(flat)
    assert any("never tilted" in text for text in result.warnings)
    assert result.verdict != "good"


def test_a_camera_no_view_determines() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="2 views of the board, 3 are needed"):
        warned(many(2))
    same = [exact(Board(), PINHOLE, straight(0.3), rng, 0.3) for _ in range(4)]
    with pytest.raises(InputError, match=r"the views do not determine the camera.*tilted"):
        warned(same)


def test_a_tilt_that_is_noise_is_not_said() -> None:
    result = warned(many(12))
    tilt = result.largest_tilt_deg
    assert tilt is not None
    assert 15.0 < tilt[0] < 60.0
    assert 0.0 < tilt[1] < 1.0
    unsure = replace(result, tilts_deg=result.tilt_sigmas_deg * 2.0)
    assert unsure.largest_tilt_deg is None
    assert any("tilt not told from none" in line for line in calibration_lines(unsure))


def test_the_scale_of_uncertainty_ends_at_the_number_of_the_text() -> None:
    result = warned(many(12))
    axes = Figure().subplots()
    _draw_uncertainty(axes, result)
    assert axes.images[0].norm.vmax == result.edge_sigma_px
    bar = axes.images[0].colorbar
    assert bar is not None
    labels = [label.get_text() for label in bar.ax.get_yticklabels()]
    assert any(f"corners {labels[-1]} px" in line for line in calibration_lines(result))


@pytest.mark.parametrize(("model", "better"), [("equidistant", "--model plumb_bob"), ("plumb_bob", "")])
def test_a_model_that_fits_better_is_named(model: DistortionModel, better: str) -> None:
    said = better_model(calibrate_views(Board(), named(many(16)), SIZE, model))
    assert [text.partition("px: ")[2] for text in said] == ([better] if better else [])


def test_views_are_chosen_for_what_they_add() -> None:
    found = many(60)
    # most of them the same one
    crowd = [found[0]] * 50 + found[1:]
    chosen = choose_views(Board(), crowd, SIZE, 20)
    assert len(chosen) == 20
    assert (chosen < 50).sum() <= 2
    all_cells = coverage(found, SIZE) > 0
    assert (coverage([crowd[i] for i in chosen], SIZE) > 0).sum() > 0.9 * all_cells.sum()


def test_the_report_is_a_picture_and_has_every_number() -> None:
    result = warned(many(12))
    png = draw_report(result, "clip $x^2$ \n")
    assert png.startswith(b"\x89PNG")
    lines = calibration_lines(result)
    assert lines[1].startswith("rms 0.")
    assert any(line.startswith("fx ") and " +- " in line for line in lines)
    values = calibration_values(result)
    assert values["parameters"]["fx"]["value"] == result.camera.fx
    assert len(values["views"]) == len(result.views)
