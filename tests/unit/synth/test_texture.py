from __future__ import annotations

import numpy as np
import pytest

from landtool.geometry import Array
from landtool.pad import Letter, PadSpec, PadTag, QuietZone
from landtool.synth.texture import PadTexture, pad_texture, polygon_coverage
from landtool.tone import srgb_decode
from tests.unit.synth.brute import pad_light

ODD_PAD = PadSpec(
    diameter_m=0.37,
    letter=Letter(0.613, 0.517, 0.093, (40, 90, 20)),
    quiet_zone=QuietZone(0.29),
    tags=(PadTag("tag25h9", 3, 0.131, 0.013, -0.007, 17.0), PadTag("tagStandard41h12", 8, 0.07, 0.3, 0.11, -80.0)),
)


def area(points: Array) -> float:
    x, y = points[:, 0], points[:, 1]
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def test_a_rectangle_covers_exactly_the_parts_of_its_texels() -> None:
    points = np.array([[2.25, 1.5], [5.125, 1.5], [5.125, 3.75], [2.25, 3.75]])
    covered, x, y = polygon_coverage(points)
    assert (x, y) == (2, 1)
    np.testing.assert_allclose(covered, np.outer([0.5, 1.0, 0.75], [0.75, 1.0, 1.0, 0.125]), atol=1e-12)


@pytest.mark.parametrize("turn", [1, -1])
def test_either_sense_of_turning_gives_the_same_cover(turn: int) -> None:
    covered, _, _ = polygon_coverage(np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])[::turn])
    np.testing.assert_allclose(covered, np.flipud(np.tri(4, k=-1) + np.eye(4) / 2.0), atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_area_and_centre_of_any_star_shaped_polygon_are_kept(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = (np.arange(9) + rng.uniform(0.0, 0.9, 9)) * 2.0 * np.pi / 9.0
    points = rng.uniform(3.0, 20.0, (9, 1)) * np.column_stack([np.cos(angle), np.sin(angle)]) + rng.uniform(25, 30, 2)
    covered, x, y = polygon_coverage(points)
    assert covered.sum() == pytest.approx(area(points), abs=1e-9)
    # the centre of a polygon: sum of (x_i + x_j) (x_i y_j - x_j y_i) / (6 A)
    after = np.roll(points, -1, axis=0)
    cross = points[:, 0] * after[:, 1] - after[:, 0] * points[:, 1]
    centre = ((points + after) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
    columns, rows = x + 0.5 + np.arange(covered.shape[1]), y + 0.5 + np.arange(covered.shape[0])
    found = np.array([covered.sum(axis=0) @ columns, covered.sum(axis=1) @ rows]) / covered.sum()
    np.testing.assert_allclose(found, centre, atol=0.02)


def test_the_default_pads_straight_edges_lie_between_texels() -> None:
    texture = pad_texture(PadSpec())
    coverage = texture.levels[0][:, :, 3]
    assert set(np.unique(coverage)) == {0, 65535}
    assert texture.texel_m == pytest.approx(1.0 / 2000.0)
    side = (coverage == 65535).sum() ** 0.5
    assert side == 2200


def test_the_rings_edges_are_where_the_circle_is() -> None:
    texture = pad_texture(PadSpec())
    red = texture.levels[0][:, :, 1] / 65535.0  # green is low where the ring is
    paint = srgb_decode(np.array([25.0]) / 255.0)[0]
    n = len(red)
    x, y = np.meshgrid(np.arange(n) - n / 2 + 0.5, np.arange(n) - n / 2 + 0.5)
    distance = np.hypot(x, y)
    near = (distance > 810) & (distance < 1030)
    ring_area = ((1.0 - red[near]) / (1.0 - paint)).sum()
    # an edge displaced by 1/50 texel changes this area by 2 pi r / 50, about 115 texels
    assert ring_area == pytest.approx(np.pi * (1000.0**2 - 840.0**2), abs=10.0)


@pytest.mark.parametrize("pad", [PadSpec(), ODD_PAD], ids=["v1", "odd"])
@pytest.mark.parametrize("level", [0, 3, 5])
def test_a_texel_is_the_mean_of_the_shapes_in_it(pad: PadSpec, level: int) -> None:
    texture = pad_texture(pad)
    picture, edge, k = texture.levels[level], texture.texel_m * 2**level, 16
    n = len(picture)
    rng = np.random.default_rng(5)
    cells = rng.integers(n // 20, n - n // 20, (3000, 2))  # column, row
    inner = (np.stack(np.meshgrid(np.arange(k), np.arange(k)), axis=-1).reshape(-1, 2) + 0.5) / k
    places = (n / 2.0 - (cells[:, None] + inner)) * edge  # y, x
    expected = pad_light(pad, places[:, :, ::-1].reshape(-1, 2)).reshape(len(cells), -1, 3).mean(axis=1)
    error = np.abs(picture[cells[:, 1], cells[:, 0], :3] / 65535.0 - expected)
    # shapes of several colours meeting in one texel are mixed by cover, not by place: rare, and never displaced
    assert error.mean() < 0.002
    assert np.quantile(error, 0.995) < 0.04


def test_levels_are_means_of_two_by_two() -> None:
    for fine, coarse in zip(pad_texture(PadSpec()).levels, pad_texture(PadSpec()).levels[1:], strict=False):
        n = len(coarse)
        mean = fine.reshape(n, 2, n, 2, 4).mean(axis=(1, 3))
        assert np.abs(mean - coarse).max() <= 1.5


def test_a_texel_called_calm_has_one_colour_around_it() -> None:
    texture: PadTexture = pad_texture(ODD_PAD)
    for level in (0, 2, 4):
        calm = np.argwhere(~texture.busy[level][1:-1, 1:-1]) + 1
        for row, column in calm[:: max(len(calm) // 200, 1)]:
            first, last = (row - 1) << level, (row + 2) << level
            left, right = (column - 1) << level, (column + 2) << level
            around = texture.levels[0][first:last, left:right].reshape(-1, 4)
            assert (around == around[0]).all()
            assert (texture.levels[level][row, column] == around[0]).all()


def test_a_texture_is_made_once() -> None:
    assert pad_texture(PadSpec()) is pad_texture(PadSpec(name="pad v1"))
