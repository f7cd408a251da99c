from __future__ import annotations

import numpy as np

from landtool.tags.finder import FULL_EVERY, TagFinder
from landtool.tags.reader import ReaderConfig, Region, TagReader
from landtool.types import Detection, Frame, Image, TagObservation
from tests.scenes import CAMERA, PAD, photograph, view


class Watched(TagReader):
    """A reader that remembers where it looked."""

    def __init__(self) -> None:
        super().__init__(ReaderConfig.of_pad(PAD))
        self.looked: list[str] = []

    def read_frame(self, image: Image) -> tuple[TagObservation, ...]:
        self.looked.append("frame")
        return super().read_frame(image)

    def read_region(self, image: Image, region: Region) -> tuple[TagObservation, ...]:
        self.looked.append("region")
        return super().read_region(image, region)


def box_of(x: float = 0.0, y: float = 0.0) -> tuple[Image, Detection]:
    pose = view(3.0, 5.0, 1.0, 0.5)
    ring = CAMERA.project(pose.apply(PAD.outline_m)) + [x, y]
    image = np.roll(photograph(pose, np.random.default_rng(0)), (round(y), round(x)), axis=(0, 1))
    return image, Detection("pad", 0.9, *map(float, (*ring.min(axis=0), *ring.max(axis=0))))


EMPTY = np.full((480, 640, 3), 90, np.uint8)
NOWHERE = Detection("pad", 0.4, 20.0, 20.0, 120.0, 120.0)


def test_a_tag_is_read_in_its_box_without_the_whole_frame() -> None:
    image, box = box_of()
    reader = Watched()
    found = TagFinder(reader, PAD).find(Frame(0, 0, image), [NOWHERE, box])
    assert [tag.tag_id for tag in found.tags] == [5]
    assert found.ours == found.tags
    assert (found.search, reader.looked) == ("region", ["region", "region"])


def test_what_is_read_in_a_box_is_what_is_read_in_the_frame() -> None:
    image, box = box_of()
    (in_box,) = TagFinder(Watched(), PAD).find(Frame(0, 0, image), [box]).tags
    (in_frame,) = TagFinder(Watched(), PAD).find(Frame(0, 0, image)).tags
    assert np.abs(in_box.corners_px - in_frame.corners_px).max() < 0.05


def test_a_tag_in_two_boxes_counts_once() -> None:
    image, box = box_of()
    larger = Detection("pad", 0.5, box.x_min_px - 4, box.y_min_px - 4, box.x_max_px + 4, box.y_max_px + 4)
    assert len(TagFinder(Watched(), PAD).find(Frame(0, 0, image), [box, larger]).tags) == 1


def test_two_pads_are_both_read() -> None:
    left, left_box = box_of(-150.0)
    right, right_box = box_of(150.0)
    both = np.concatenate([left[:, :320], right[:, 320:]], axis=1)
    finder = TagFinder(Watched(), PAD)
    for index in range(2):
        found = finder.find(Frame(index, index, both), [left_box, right_box])
        assert len(found.tags) == 2
        assert len(found.ours) == 1


def test_boxes_without_a_tag_spare_the_whole_frame_most_times() -> None:
    reader = Watched()
    finder = TagFinder(reader, PAD)
    searches = [finder.find(Frame(i, i, EMPTY), [NOWHERE]).search for i in range(FULL_EVERY + 2)]
    assert [i for i, search in enumerate(searches) if search == "frame"] == [0, FULL_EVERY]


def test_pictures_that_do_not_follow_each_other_are_searched_whole() -> None:
    image, _ = box_of()
    reader = Watched()
    finder = TagFinder(reader, PAD, follow=False)
    for index, (picture, boxes, count) in enumerate([(image, [], 1), (EMPTY, [NOWHERE], 0), (EMPTY, [], 0)]):
        found = finder.find(Frame(index, None, picture), boxes)
        assert (found.search, len(found.tags)) == ("frame", count)
    assert reader.looked == ["frame", "region", "frame", "frame"]


def test_all_tags_are_looked_for_everywhere() -> None:
    image, box = box_of()
    reader = Watched()
    finder = TagFinder(reader, PAD, everywhere=True)
    assert [finder.find(Frame(i, i, image), [box]).search for i in range(2)] == ["frame", "frame"]
    assert reader.looked == ["frame", "frame"]
