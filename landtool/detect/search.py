"""Where to look for boxes next: around the place they are moving to, or everywhere when nothing is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.errors import UsageError
from landtool.geometry import Array
from landtool.types import Detection

FULL_EVERY = 15
_MARGIN_SHARE = 0.75  # of the box's longer side, on every side of it
_MARGIN_PX = 48.0
_SMALLEST_PX = 256.0  # of a region's side: a network needs surroundings, and a small target may hop
_MOST_SHARE = 0.6  # of the picture; a larger region is no saving
_CUT_PX = 1.0  # a box that ends this near to the region's rim may be cut by it


@dataclass(frozen=True)
class Region:
    """Part of a picture: pixels x0 <= x < x1, y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int


@dataclass(frozen=True, eq=False)
class _Sighting:
    """A box (4,) x_min, y_min, x_max, y_max in pixels, and the number of its picture."""

    frame: int
    box_px: Array


class DetectorSearch:
    """Predicts the region of the next picture from the last two boxes, in pixels, without a camera model.

    The whole picture is searched at the start, as soon as a region shows nothing or cuts the box, and every
    `full_every` pictures, for what comes into view elsewhere.
    """

    def __init__(self, full_every: int = FULL_EVERY) -> None:
        if full_every < 1:
            raise UsageError(f"full_every = {full_every} is impossible", hint="give 1 or more")
        self._full_every = full_every
        self._last: _Sighting | None = None
        self._before: _Sighting | None = None
        self._last_full: int | None = None
        self._region: Region | None = None
        self._size = (0, 0)

    def next_region(
        self, frame_index: int, width: int, height: int, predicted: Detection | None = None
    ) -> Region | None:
        """Return where to look in picture number `frame_index` of width x height pixels; None for everywhere.

        predicted: where another source, as the tracker, expects the box; it replaces the search's own prediction.
        """
        if (width, height) != self._size:
            self._forget()
        self._size = (width, height)
        self._region = None
        due = self._last_full is None or not 0 <= frame_index - self._last_full < self._full_every
        if not due and (predicted is not None or self._last is not None):
            box = self._predicted(frame_index) if predicted is None else _box(predicted)
            self._region = _around(box, width, height)
        if self._region is None:
            self._last_full = frame_index
        return self._region

    def saw(self, frame_index: int, detections: Sequence[Detection]) -> None:
        """Take in what was found in picture number `frame_index`, where `next_region` said to look."""
        found = self._ours(frame_index, detections)
        if found is None or self._cut(found):
            self._forget()
            return
        self._before, self._last = self._last, _Sighting(frame_index, found)

    def _ours(self, frame: int, detections: Sequence[Detection]) -> Array | None:
        """Return the box nearest to the predicted place; with nothing known that of the highest score."""
        if not detections:
            return None
        if self._last is None:
            return _box(max(detections, key=lambda seen: seen.score))
        expected = self._predicted(frame)
        return min((_box(seen) for seen in detections), key=lambda box: float(np.abs(box - expected).max()))

    def _cut(self, box: Array) -> bool:
        """Tell whether the region, not the picture, ends where the box ends."""
        if self._region is None:
            return False
        width, height = self._size
        rim = np.array([self._region.x0, self._region.y0, self._region.x1, self._region.y1]) - 0.5
        inside = rim != np.array([0, 0, width, height]) - 0.5
        return bool((inside & (np.abs(box - rim) < _CUT_PX)).any())

    def _predicted(self, frame: int) -> Array:
        """Move the box on as it moved between its last two sightings, at most by its own size."""
        last, before = self._last, self._before
        assert last is not None
        if before is None:
            return last.box_px
        share = (frame - last.frame) / max(last.frame - before.frame, 1)
        most = np.tile(last.box_px[2:] - last.box_px[:2], 2) + _MARGIN_PX
        box = last.box_px + np.clip(share * (last.box_px - before.box_px), -most, most)
        # a box that shrinks fast must not turn inside out
        return np.concatenate([np.minimum(box[:2], box[2:]), np.maximum(box[:2], box[2:])])

    def _forget(self) -> None:
        self._last = self._before = self._last_full = None


def _around(box: Array, width: int, height: int) -> Region | None:
    """Return the region around a box, None where the whole picture is as good."""
    centre, sides = (box[:2] + box[2:]) / 2.0, box[2:] - box[:2]
    margin = _MARGIN_SHARE * float(sides.max()) + _MARGIN_PX
    half = np.maximum(sides / 2.0 + margin, _SMALLEST_PX / 2.0)
    x0, y0 = np.maximum(np.floor(centre - half + 0.5), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(centre + half + 0.5), [width, height]).astype(int)
    if x1 - x0 < 8 or y1 - y0 < 8 or (x1 - x0) * (y1 - y0) > _MOST_SHARE * width * height:
        return None
    return Region(int(x0), int(y0), int(x1), int(y1))


def _box(seen: Detection) -> Array:
    return np.array([seen.x_min_px, seen.y_min_px, seen.x_max_px, seen.y_max_px])
