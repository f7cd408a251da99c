"""Finds the tags of each frame, looking first where they are expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from landtool.families import tag_family
from landtool.pad import PadSpec
from landtool.tags.reader import Region, TagReader, module_px
from landtool.tags.search import TagSearch
from landtool.types import Detection, Frame, Image, Search, TagObservation

FULL_EVERY = 15
MOST_BOXES = 8
_BOX_MARGIN_SHARE = 0.1  # of a box's longer side: it may be off by that
_SAME_TAG_MODULES = 2.0


@dataclass(frozen=True, eq=False)
class FoundTags:
    """The tags of one frame; ours: one of each tag of the pad. search: where was looked."""

    tags: tuple[TagObservation, ...]
    ours: tuple[TagObservation, ...]
    search: Search


class TagFinder:
    """Reads tags frame by frame, and remembers where the pad's were.

    everywhere: search every whole picture, as needed when all tags of a family are wanted and not only the pad's.
    follow: the frames follow each other in time, so that a place can be predicted.
    """

    def __init__(self, reader: TagReader, pad: PadSpec, *, everywhere: bool = False, follow: bool = True) -> None:
        self.reader = reader
        self._pad = pad
        self._search = TagSearch(pad)
        self._everywhere, self._follow = everywhere, follow
        self._last_full: int | None = None

    def find(self, frame: Frame, boxes: Sequence[Detection] = ()) -> FoundTags:
        """Read the tags of one frame. boxes: where a detector sees the pad's outer circle, best first.

        The predicted place is read, and the boxes no tag of which was read there; the whole picture where there is
        neither. Boxes without a readable tag, as those of a pad far away, spare the whole picture, too, except every
        `FULL_EVERY` frames: they may be wrong.
        """
        tags, search = self._read(frame, boxes[:MOST_BOXES])
        ours = self._search.ours(frame.index, tags)
        self._search.saw(frame.index, ours)
        return FoundTags(tags, ours, search)

    def _read(self, frame: Frame, boxes: Sequence[Detection]) -> tuple[tuple[TagObservation, ...], Search]:
        image, (height, width) = frame.image, frame.image.shape[:2]
        if not self._everywhere:
            expected = self._search.region(frame.index, width, height) if self._follow else None
            tags = () if expected is None else self.reader.read_region(image, expected)
            regions = [region for box in boxes if (region := self._inside(box, width, height)) is not None]
            tags = self._with_those_in(image, regions, tags)
            if tags or expected is not None or (regions and self._follow and not self._due(frame.index)):
                return tags, "region"
        self._last_full = frame.index
        return self.reader.read_frame(image), "frame"

    def _with_those_in(
        self, image: Image, regions: Sequence[Region], known: Sequence[TagObservation]
    ) -> tuple[TagObservation, ...]:
        found = list(known)
        for region in regions:
            if any(_holds(region, tag) for tag in found):
                continue
            found += [
                tag for tag in self.reader.read_region(image, region) if not any(map(partial(_is_same, tag), found))
            ]
        return tuple(sorted(found, key=lambda tag: (tag.family, tag.tag_id, *tag.corners_px[0])))

    def _inside(self, box: Detection, width: int, height: int) -> Region | None:
        """Return the region of a box (of the outer circle), None where the pad has no ring or tag to tell its scale."""
        if self._pad.ring is None or not self._pad.tags:
            return None
        sides = np.array([box.x_max_px - box.x_min_px, box.y_max_px - box.y_min_px])
        module = min(tag.size / tag_family(tag.family).border_modules for tag in self._pad.tags)
        # of a tilted pad the shorter side has the smaller modules
        expected_px = float(sides.min()) * module / self._pad.ring.outer
        margin = _BOX_MARGIN_SHARE * float(sides.max())
        x0, y0 = np.maximum(np.floor([box.x_min_px - margin, box.y_min_px - margin]), 0).astype(int)
        ends = np.ceil([box.x_max_px + margin, box.y_max_px + margin]) + 1
        x1, y1 = np.minimum(ends, [width, height]).astype(int)
        if x1 <= x0 or y1 <= y0 or not expected_px > 0.0:
            return None
        return Region(int(x0), int(y0), int(x1), int(y1), expected_px)

    def _due(self, index: int) -> bool:
        return self._last_full is None or not 0 <= index - self._last_full < FULL_EVERY


def _holds(region: Region, tag: TagObservation) -> bool:
    x, y = tag.corners_px.mean(axis=0)
    return bool(region.x0 <= x < region.x1 and region.y0 <= y < region.y1)


def _is_same(tag: TagObservation, other: TagObservation) -> bool:
    """Tell whether two readings are of one tag, as two boxes that overlap give."""
    if (tag.family, tag.tag_id) != (other.family, other.tag_id):
        return False
    distance = np.linalg.norm(tag.corners_px.mean(axis=0) - other.corners_px.mean(axis=0))
    return bool(distance < _SAME_TAG_MODULES * module_px(other.corners_px, other.family))
