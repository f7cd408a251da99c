from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.random import Generator

from landtool.synth import markings
from landtool.synth.grounds import KINDS
from landtool.synth.markings import Layout
from landtool.synth.outlines import crack, strip

LAYOUTS = [
    markings.road,
    markings.crossing,
    markings.parking_lot,
    markings.apron,
    markings.stains,
    markings.cracks,
    markings.manhole,
]
Make = Callable[[Generator], Layout]


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2.0


def drawn(seed: int, make: Make) -> Layout:
    return make(np.random.default_rng(seed))


@pytest.mark.parametrize("make", LAYOUTS)
def test_a_layout_can_be_painted(make: Make) -> None:
    for seed in range(25):
        layout = drawn(seed, make)
        assert layout.marks or make is markings.road
        assert len(layout.marks) <= 5  # each costs as much as a whole picture
        for mark in layout.marks:
            assert all(0.0 <= value <= 1.0 for value in (*mark.albedo, mark.opacity, mark.wear))
            for polygon in mark.polygons_m:
                assert polygon.ndim == 2
                assert polygon.shape[1] == 2
                assert np.isfinite(polygon).all()
                assert area(polygon) > 1e-6
        assert len(layout.regions) <= 4
        assert all(kind in KINDS for _, kind in layout.regions)
        for thing in layout.things:
            assert min(mesh.points_m[:, 2].min() for mesh in thing) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("make", LAYOUTS)
def test_the_same_state_gives_the_same_layout_and_another_state_another(make: Make) -> None:
    first, second, other = (drawn(seed, make).marks[-1].polygons_m for seed in (4, 4, 5))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert len(first) != len(other) or not all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))


@pytest.mark.parametrize("make", [markings.road, markings.crossing])
def test_roads_run_out_of_sight_and_their_verges_leave_the_road_free(make: Make) -> None:
    reaches = []
    for seed in range(25):
        layout = drawn(seed, make)
        painted = [p for mark in layout.marks for p in mark.polygons_m]
        if not painted:
            continue
        along = np.concatenate(painted)
        reaches.append(float(np.abs(along[:, 0]).max()))
        for polygon, _ in layout.regions:
            assert abs(polygon[:, 0]).max() >= 70.0
            assert np.abs(polygon[:, 1]).min() >= np.abs(along[:, 1]).max() - 1e-6
    assert max(reaches) >= 70.0


def test_a_strip_is_as_wide_as_asked_all_along() -> None:
    assert area(strip([[0.0, 0.0], [3.0, 4.0]], 0.2)) == pytest.approx(1.0)
    angle = np.linspace(0.0, np.pi / 2.0, 60)
    bow = strip(5.0 * np.column_stack([np.cos(angle), np.sin(angle)]), 0.3)
    assert area(bow) == pytest.approx(5.0 * np.pi / 2.0 * 0.3, rel=1e-3)


def test_cracks_are_thin_and_close_at_their_end() -> None:
    line = np.column_stack([np.linspace(0.0, 2.0, 30), np.zeros(30)])
    outline = crack(np.random.default_rng(0), line, 0.01)
    widths = outline[:30, 1] - outline[30:][::-1, 1]
    assert widths.min() > 0.0
    assert widths.max() <= 0.014 + 1e-12
    assert widths[-5:].mean() < 0.6 * widths[:5].mean()


def test_open_cracks_and_sealed_ones_have_their_widths() -> None:
    thickest = []
    for seed in range(20):
        for polygon in drawn(seed, markings.cracks).marks[0].polygons_m:
            half = len(polygon) // 2
            thickest.append(np.linalg.norm(polygon[:half] - polygon[half:][::-1], axis=1).max())
    assert min(thickest) < 0.02
    assert max(thickest) < 0.1


def test_a_layout_laid_over_another_is_painted_later() -> None:
    below, above = drawn(1, markings.parking_lot), drawn(1, markings.stains)
    assert above.over(below).marks == below.marks + above.marks


def test_a_manhole_is_round_and_as_large_as_real_ones() -> None:
    for seed in range(10):
        cover = drawn(seed, markings.manhole).marks[1].polygons_m[0]
        (_, (width, height), _) = cv2.minAreaRect(cover.astype(np.float32))
        assert width == pytest.approx(height, rel=0.02)
        assert 0.5 < width < 0.9
