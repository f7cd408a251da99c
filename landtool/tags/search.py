"""Where to look for the tags next: around the place they are moving to, or everywhere when nothing is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.tags.reader import Region, module_px
from landtool.types import TagObservation

_MARGIN_MODULES = 5.0
_MARGIN_PX = 8.0
_GROWTH = 1.6  # of the margin with every miss
_MOST_MISSES = 5
_MOST_SHARE = 0.6  # of the picture; a larger region is no saving


@dataclass(frozen=True, eq=False)
class _Sighting:
    """Where the pad's tags are in a picture: the box around all of them, read or not, and the smallest module."""

    frame: int
    low_px: Array
    high_px: Array
    module_px: float


class TagSearch:
    """Predicts the region of the next picture from the last two sightings, in pixels, without a camera model."""

    def __init__(self, pad: PadSpec) -> None:
        self._pad = pad
        self._last: _Sighting | None = None
        self._before: _Sighting | None = None
        self._misses = 0

    def region(self, frame: int, width: int, height: int) -> Region | None:
        """Return where to look in picture number `frame` of width x height pixels; None for everywhere."""
        if self._last is None:
            return None
        low, high = self._predicted(frame)
        margin = (_MARGIN_MODULES * self._last.module_px + _MARGIN_PX) * _GROWTH**self._misses
        x0, y0 = np.maximum(np.floor(low - margin), 0).astype(int)
        x1, y1 = np.minimum(np.ceil(high + margin) + 1, [width, height]).astype(int)
        if x1 - x0 < 8 or y1 - y0 < 8 or (x1 - x0) * (y1 - y0) > _MOST_SHARE * width * height:
            return None
        return Region(int(x0), int(y0), int(x1), int(y1), self._last.module_px)

    def ours(self, frame: int, observations: Sequence[TagObservation]) -> tuple[TagObservation, ...]:
        """Return one observation of each tag of the pad.

        Where a tag is seen twice, as with two pads in view, the one nearer to the predicted place is ours; with
        nothing known the larger, which is the closer pad.
        """
        low, high = self._predicted(frame) if self._last is not None else (None, None)

        def strangeness(seen: TagObservation) -> float:
            if low is None or high is None:
                return -module_px(seen.corners_px, seen.family)
            return float(np.linalg.norm(seen.corners_px.mean(axis=0) - (low + high) / 2.0))

        found: dict[tuple[str, int], TagObservation] = {}
        for seen in sorted(observations, key=strangeness):
            if any((tag.family, tag.id) == (seen.family, seen.tag_id) for tag in self._pad.tags):
                found.setdefault((seen.family, seen.tag_id), seen)
        return tuple(found.values())

    def saw(self, frame: int, observations: Sequence[TagObservation]) -> None:
        """Take in what was read in picture number `frame`; after too many misses nothing is known any more."""
        sighting = self._sighting(frame, observations)
        if sighting is not None:
            self._before, self._last, self._misses = self._last, sighting, 0
            return
        self._misses += 1
        if self._misses > _MOST_MISSES:
            self._last = self._before = None
            self._misses = 0

    def _predicted(self, frame: int) -> tuple[Array, Array]:
        """Move the box on as it moved between its last two sightings, at most by its own size."""
        last, before = self._last, self._before
        assert last is not None
        if before is None:
            return last.low_px, last.high_px
        share = (frame - last.frame) / max(last.frame - before.frame, 1)
        most = last.high_px - last.low_px + _MARGIN_PX
        low = last.low_px + np.clip(share * (last.low_px - before.low_px), -most, most)
        high = last.high_px + np.clip(share * (last.high_px - before.high_px), -most, most)
        return low, high

    def _sighting(self, frame: int, observations: Sequence[TagObservation]) -> _Sighting | None:
        tags = {(tag.family, tag.id): tag for tag in self._pad.tags}
        seen = [o for o in observations if (o.family, o.tag_id) in tags]
        if not seen:
            return None
        corners = np.concatenate([o.corners_px for o in seen])
        if len(seen) < len(tags):
            corners = np.concatenate([corners, self._all_corners(seen[0])])
        module = min(module_px(o.corners_px, o.family) for o in seen)
        return _Sighting(frame, corners.min(axis=0), corners.max(axis=0), module)

    def _all_corners(self, seen: TagObservation) -> Array:
        """Project the corners (N, 2) of all tags of the pad through the homography of one that was read."""
        tags = {(tag.family, tag.id): self._pad.tag_corners_m(tag)[:, :2] for tag in self._pad.tags}
        start = tags[seen.family, seen.tag_id].astype(np.float32)
        homography = cv2.getPerspectiveTransform(start, seen.corners_px.astype(np.float32))
        points = np.concatenate(list(tags.values()))
        q = np.column_stack([points, np.ones(len(points))]) @ homography.T
        visible = q[:, 2] > 1e-6 * abs(homography[2, 2])
        return np.asarray(q[visible, :2] / q[visible, 2:])
