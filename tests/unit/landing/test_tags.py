from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from landtool.landing.tags import TagLook
from landtool.pad import PadSpec, PadTag
from landtool.tags.reader import ReaderConfig, Region, TagReader
from landtool.types import Image, TagObservation
from tests.method import edges_of, ring_box
from tests.scenes import CAMERA, PAD, photograph, view

TWO_TAGS = PadSpec(quiet_zone=None, letter=None, tags=(PadTag(x=0.2), PadTag(id=7, x=-0.2)))


class Watched(TagReader):
    """A reader that remembers where it looked."""

    def __init__(self, pad: PadSpec = PAD) -> None:
        super().__init__(ReaderConfig.of_pad(pad))
        self.regions: list[Region] = []

    def read_region(self, image: Image, region: Region) -> tuple[TagObservation, ...]:
        self.regions.append(region)
        return super().read_region(image, region)


def look(pad: PadSpec = PAD) -> tuple[TagLook, Watched]:
    reader = Watched(pad)
    return TagLook(reader, CAMERA, pad), reader


@lru_cache(maxsize=2)
def side_by_side(pad: PadSpec = PAD) -> Image:
    """Two pads, one picture."""
    rng = np.random.default_rng(0)
    left, right = (
        photograph(view(4.0, 5.0, 1.0, yaw, off=(off, 0.0)), rng, pad=pad) for off, yaw in ((-0.3, 0.5), (0.3, 2.0))
    )
    return np.concatenate([left[:, :320], right[:, 320:]], axis=1)


@pytest.mark.parametrize(("pad", "each"), [(PAD, 1), (TWO_TAGS, 2)], ids=["one tag", "two tags"])
def test_the_tags_of_two_pads_are_two_groups(pad: PadSpec, each: int) -> None:
    tags, _ = look(pad)
    seen = tags.anywhere(side_by_side(pad))
    assert len(seen) == 2 * each
    groups = tags.pads_of(seen)
    assert [len(group) for group in groups] == [each, each]
    sides = [{tag.corners_px[:, 0].mean() < 320 for tag in group} for group in groups]
    assert sorted(map(len, sides)) == [1, 1]
    assert sides[0] != sides[1]


def test_strange_tags_belong_to_no_pad() -> None:
    tags, _ = look()
    (seen,) = tags.anywhere(photograph(view(3.0, 5.0, 1.0, 0.5), np.random.default_rng(0)))
    strange = TagObservation("tag36h11", 6, 0, 90.0, seen.corners_px + 40.0, seen.covariance_px2)
    assert tags.pads_of([strange, seen]) == [(seen,)]
    assert tags.pads_of([strange]) == tags.pads_of([]) == []


def test_the_largest_pad_comes_first() -> None:
    tags, _ = look()
    (near,) = tags.anywhere(photograph(view(2.5, 5.0, 1.0, 0.5, off=(-0.2, 0.0)), np.random.default_rng(0)))
    (far,) = tags.anywhere(photograph(view(4.5, 5.0, 1.0, 0.5, off=(0.35, 0.0)), np.random.default_rng(1)))
    assert tags.pads_of([far, near]) == [(near,), (far,)]


def test_an_expected_pad_is_read_about_its_place_alone() -> None:
    tags, reader = look()
    truth = view(3.0, 5.0, 1.0, 0.5, off=(0.1, 0.05))
    image = photograph(truth, np.random.default_rng(0))
    (tag,) = tags.near(image, truth, 0.02)
    (region,) = reader.regions
    side_px = CAMERA.fx * PAD.tag_size_m(PAD.tags[0]) / 3.0
    assert region.x1 - region.x0 < 4.0 * side_px
    assert region.module_px == pytest.approx(side_px / 8.0, rel=0.05)
    (anywhere,) = tags.anywhere(image)
    assert np.abs(tag.corners_px - anywhere.corners_px).max() < 0.05
    # the less is known of the place, the more is looked at
    tags.near(image, truth, 0.2)
    assert reader.regions[1].x1 - reader.regions[1].x0 > region.x1 - region.x0 + 100


def test_of_two_pads_only_the_expected_one_is_read() -> None:
    tags, _ = look()
    (tag,) = tags.near(side_by_side(), view(4.0, 5.0, 1.0, 0.5, off=(-0.3, 0.0)), 0.05)
    assert tag.corners_px[:, 0].mean() < 320


def test_a_box_is_read_with_a_margin() -> None:
    tags, reader = look()
    truth = view(3.0, 5.0, 1.0, 0.5)
    box = edges_of(ring_box(truth))
    assert len(tags.in_box(photograph(truth, np.random.default_rng(0)), box)) == 1
    (region,) = reader.regions
    assert (region.x0, region.y1) == (pytest.approx(box[0] - 18.0, abs=3.0), pytest.approx(box[3] + 18.0, abs=3.0))


def test_nothing_is_read_beside_the_picture() -> None:
    tags, reader = look()
    image = np.full((480, 640, 3), 90, np.uint8)
    assert tags.near(image, view(3.0, 5.0, 1.0, 0.5, off=(1.5, 0.0)), 0.02) == ()
    assert tags.in_box(image, np.array([-200.0, 10.0, -50.0, 160.0])) == ()
    assert reader.regions == []


def test_a_tag_is_worth_a_look_from_some_size_on() -> None:
    tags, _ = look()
    assert [tags.is_readable(view(d, 5.0, 1.0, 0.5)) for d in (3.0, 7.0, 12.0)] == [True, True, False]
    assert [tags.is_readable_in(px) for px in (180.0, 80.0, 45.0)] == [True, True, False]
    without, _ = look(PadSpec(ring=None))
    assert not without.is_readable_in(180.0)
    assert without.in_box(np.full((480, 640, 3), 90, np.uint8), np.array([200.0, 100.0, 300.0, 200.0])) == ()


def test_another_tone_is_used_from_then_on() -> None:
    tags, reader = look()
    tags.use_tone(1.8)
    assert tags.reader.config.tone == 1.8
    assert reader.config.tone == "srgb"
    assert tags.reader.config.wanted == reader.config.wanted
