from __future__ import annotations

import numpy as np
import pytest

from landtool.pad import PadSpec, PadTag
from landtool.tags.search import TagSearch
from landtool.types import TagObservation


def seen(x: float, y: float, side: float = 40.0, tag_id: int = 5) -> TagObservation:
    corners = np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]])
    return TagObservation("tag36h11", tag_id, 0, 60.0, corners, np.eye(8) * 1e-4)


def test_nothing_known_is_everywhere() -> None:
    assert TagSearch(PadSpec()).region(0, 640, 480) is None


def test_the_region_holds_the_tag_and_little_more() -> None:
    search = TagSearch(PadSpec())
    search.saw(0, [seen(300, 200)])
    region = search.region(1, 640, 480)
    assert region is not None
    assert region.x0 < 300 - 10
    assert region.x1 > 340 + 10
    assert (region.x1 - region.x0) * (region.y1 - region.y0) < 0.1 * 640 * 480
    assert region.module_px == pytest.approx(5.0)


def test_the_region_moves_on_with_the_tag() -> None:
    search = TagSearch(PadSpec())
    search.saw(0, [seen(100, 200)])
    search.saw(1, [seen(130, 200)])
    region = search.region(2, 640, 480)
    assert region is not None
    assert (region.x0 + region.x1) / 2 == pytest.approx(180.5, abs=2)


def test_misses_widen_the_region_and_end_it() -> None:
    search = TagSearch(PadSpec())
    search.saw(0, [seen(300, 200, side=16)])
    widths = []
    for frame in range(1, 12):
        region = search.region(frame, 640, 480)
        if region is None:
            break
        widths.append(region.x1 - region.x0)
        search.saw(frame, [])
    assert widths == sorted(widths)
    assert 2 <= len(widths) <= 7
    assert search.region(20, 640, 480) is None


def test_a_tag_of_another_pad_is_no_sighting() -> None:
    search = TagSearch(PadSpec())
    search.saw(0, [seen(300, 200, tag_id=7)])
    assert search.region(1, 640, 480) is None


def test_one_tag_of_several_leads_to_all() -> None:
    pad = PadSpec(ring=None, letter=None, tags=(PadTag(id=3, x=0.0), PadTag(id=4, y=-0.5)))
    search = TagSearch(pad)
    search.saw(0, [seen(100, 200, tag_id=3)])
    region = search.region(1, 640, 480)
    assert region is not None
    # tag 4 is 0.5 D to the right, 0.5 / 0.16 tag sides away
    assert region.x1 > 120 + 0.5 / 0.16 * 40 + 20


def test_of_two_pads_the_closer_is_taken_and_then_kept() -> None:
    search = TagSearch(PadSpec())
    near, far = seen(100, 100, side=40), seen(400, 300, side=30)
    assert search.ours(0, [far, near]) == (near,)
    search.saw(0, [far])
    assert search.ours(1, [near, far]) == (far,)


def test_only_the_pads_own_tags_are_ours() -> None:
    assert TagSearch(PadSpec()).ours(0, [seen(100, 100, tag_id=9)]) == ()
