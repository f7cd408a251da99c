from __future__ import annotations

import numpy as np
import pytest

from landtool.detect.search import DetectorSearch, Region
from landtool.errors import UsageError
from landtool.types import Detection

WIDTH, HEIGHT = 1280, 960


def seen(x: float, y: float, side: float = 40.0, score: float = 0.9) -> Detection:
    return Detection("pad", score, x, y, x + side, y + side)


def region(search: DetectorSearch, frame: int, predicted: Detection | None = None) -> Region:
    found = search.next_region(frame, WIDTH, HEIGHT, predicted)
    assert found is not None
    return found


def started(*boxes: Detection, full_every: int = 15) -> DetectorSearch:
    """A search that saw these boxes in the pictures 0, 1, ..."""
    search = DetectorSearch(full_every)
    for frame, box in enumerate(boxes):
        search.next_region(frame, WIDTH, HEIGHT)
        search.saw(frame, [box])
    return search


def test_nothing_known_is_everywhere() -> None:
    search = DetectorSearch()
    for frame in range(3):
        assert search.next_region(frame, WIDTH, HEIGHT) is None
        search.saw(frame, [])


def test_the_region_holds_the_box_and_room() -> None:
    around = region(started(seen(600, 400)), 1)
    assert around.x0 < 600 - 48
    assert around.x1 > 640 + 48
    assert around.x1 - around.x0 <= 257
    assert around.y1 - around.y0 <= 257


def test_the_region_moves_on_with_the_box_and_over_gaps() -> None:
    search = started(seen(400, 400), seen(430, 390))
    for frame, expected in ((2, 460), (3, 490)):
        around = region(search, frame)
        assert (around.x0 + around.x1) / 2 == pytest.approx(expected + 20.5, abs=1)


def test_a_jump_is_not_carried_on_for_ever() -> None:
    around = region(started(seen(100, 400), seen(900, 400)), 2)
    assert (around.x0 + around.x1) / 2 == pytest.approx(900 + 88 + 20.5, abs=1)


def test_a_large_box_is_looked_for_everywhere() -> None:
    assert started(seen(300, 100, side=700)).next_region(1, WIDTH, HEIGHT) is None


def test_a_region_that_shows_nothing_gives_way_to_everywhere() -> None:
    search = started(seen(600, 400))
    region(search, 1)
    search.saw(1, [])
    assert search.next_region(2, WIDTH, HEIGHT) is None


def test_everywhere_every_so_often() -> None:
    search = DetectorSearch(full_every=5)
    full = []
    for frame in range(16):
        if search.next_region(frame, WIDTH, HEIGHT) is None:
            full.append(frame)
        search.saw(frame, [seen(600, 400)])
    assert full == [0, 5, 10, 15]


def test_a_box_cut_by_the_region_is_looked_for_everywhere() -> None:
    search = started(seen(600, 400))
    around = region(search, 1)
    search.saw(1, [Detection("pad", 0.9, around.x1 - 60.0, 400, around.x1 - 0.5, 440)])
    assert search.next_region(2, WIDTH, HEIGHT) is None


def test_a_box_cut_by_the_picture_is_not() -> None:
    search = started(seen(-0.5, 400))
    assert region(search, 1).x0 == 0
    search.saw(1, [seen(-0.5, 400)])
    region(search, 2)


def test_the_box_that_was_followed_is_kept_not_the_best() -> None:
    search = started(seen(600, 400, score=0.6))
    search.next_region(1, WIDTH, HEIGHT)
    search.saw(1, [seen(700, 450, score=0.9), seen(605, 400, score=0.6)])
    around = region(search, 2)
    assert around.x0 < 610 < around.x1
    assert (around.x0 + around.x1) / 2 == pytest.approx(630, abs=2)


def test_a_given_prediction_replaces_its_own() -> None:
    around = region(started(seen(600, 400)), 1, predicted=seen(200, 700))
    assert around.x0 < 200 < 240 < around.x1
    assert around.y0 < 700 < 740 < around.y1


def test_a_prediction_outside_the_picture_is_everywhere() -> None:
    assert started(seen(600, 400)).next_region(1, WIDTH, HEIGHT, seen(5000, 400)) is None


def test_pictures_of_another_size_start_anew() -> None:
    assert started(seen(600, 400)).next_region(1, 1920, 1080) is None


def test_a_box_that_shrinks_fast_stays_a_box() -> None:
    around = region(started(seen(500, 300, side=300), seen(620, 420, side=60)), 2)
    assert around.x0 < around.x1
    assert around.y0 < around.y1


def test_full_every_has_bounds() -> None:
    with pytest.raises(UsageError, match="full_every"):
        DetectorSearch(0)


def test_a_random_walk_stays_within_its_regions() -> None:
    rng = np.random.default_rng(2)
    search, place = DetectorSearch(), np.array([600.0, 400.0])
    velocity = np.array([6.0, -4.0])
    for frame in range(60):
        around = search.next_region(frame, WIDTH, HEIGHT)
        if around is not None:
            assert around.x0 <= place[0]
            assert place[0] + 40 <= around.x1
            assert around.y0 <= place[1]
            assert place[1] + 40 <= around.y1
        search.saw(frame, [seen(*place)])
        velocity = np.clip(velocity + rng.normal(0, 3, 2), -15, 15)
        place = np.clip(place + velocity, 0, [WIDTH - 40, HEIGHT - 40])
