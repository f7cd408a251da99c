"""The far stage: where a network sees objects in each frame, the pad's boxes moved onto its red ring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from landtool.detect.nms import suppress
from landtool.detect.search import DetectorSearch, Region
from landtool.pad import PadSpec
from landtool.target.sight import Sight, look_at
from landtool.tone import Tone
from landtool.types import Detection, Frame, Image, Search

PAD_LABEL = "pad"  # the class whose boxes are of the ring's outer circle
MOST_RINGS = 16  # boxes of a picture that are moved: more are false ones, let in by a low --conf
_DOUBT = 0.3  # what is left of the score of a box that shows no pad where one would be seen
_PART = 0.8  # share of a box that lies in a pad's, from which on it is a part of that
_SAME_RING_IOU = 0.8  # two boxes moved onto one ring overlap by more


class BoxDetector(Protocol):
    """What finds boxes in pictures, best first: `landtool.detect.detector.Detector`, or a stand-in for it."""

    def detect(self, image: Image) -> tuple[Detection, ...]:
        """Look at a whole picture (H, W, 3) BGR uint8."""
        ...

    def detect_region(self, image: Image, region: Region) -> tuple[Detection, ...]:
        """Look at a part of it; boxes are in pixels of the whole picture."""
        ...


@dataclass(frozen=True)
class FoundBoxes:
    """The detections of one frame, best first; search: where was looked."""

    detections: tuple[Detection, ...]
    search: Search

    @property
    def pads(self) -> tuple[Detection, ...]:
        """Those of the pad's own class."""
        return tuple(seen for seen in self.detections if seen.label == PAD_LABEL)


class DetectStage:
    """Detects frame by frame.

    regions: look around the expected place where there is one. ring_of: the pad whose ring the boxes labelled
    PAD_LABEL are moved onto; None leaves them as they are. tone: the pictures' curve. least_score: of a box that is
    given out, after what is seen at it has changed its score. moved_from: least score of a box that is moved.
    """

    def __init__(
        self,
        detector: BoxDetector,
        *,
        regions: bool = False,
        ring_of: PadSpec | None = None,
        tone: Tone = "srgb",
        least_score: float = 0.0,
        moved_from: float = 0.0,
    ) -> None:
        self._detector = detector
        self._search = DetectorSearch() if regions else None
        self._ring_of, self._tone = ring_of, tone
        self._least_score, self._moved_from = least_score, moved_from

    def find(self, frame: Frame, expected: Detection | None = None) -> FoundBoxes:
        """Detect in one frame. Raises InputError for a network that gives no usable output.

        expected: where another source, as the tracker, expects the pad's box; regions lie around it.
        """
        seen, search = self._look(frame, expected)
        if self._ring_of is not None:
            seen = self._on_ring(frame.image, seen, self._ring_of)
            seen = tuple(box for box in sorted(seen, key=lambda b: -b.score) if box.score >= self._least_score)
        return FoundBoxes(seen, search)

    def _look(self, frame: Frame, expected: Detection | None) -> tuple[tuple[Detection, ...], Search]:
        image, index = frame.image, frame.index
        height, width = image.shape[:2]
        region = None if self._search is None else self._search.next_region(index, width, height, expected)
        if self._search is None or region is None:
            seen = self._detector.detect(image)
        else:
            seen = self._detector.detect_region(image, region)
            self._search.saw(index, seen)
            if self._search.next_region(index, width, height, expected) is not None:
                return seen, "region"
            # lost, or cut off by the region's rim: this frame's boxes are not given up
            seen = self._detector.detect(image)
        if self._search is not None:
            self._search.saw(index, seen)
        return seen, "frame"

    def _on_ring(self, image: Image, seen: Sequence[Detection], pad: PadSpec) -> tuple[Detection, ...]:
        """Move the pad's boxes to where its print is seen; of several at one place the best stays."""
        pads = [index for index, box in enumerate(seen) if box.label == PAD_LABEL]
        moved = list(seen)
        on_print: list[int] = []
        for index in [index for index in pads if seen[index].score >= self._moved_from][:MOST_RINGS]:
            sight = look_at(image, np.array(_edges(seen[index])), pad, self._tone)
            moved[index] = _moved(seen[index], sight)
            if sight.box_px is not None and not sight.is_doubtful:
                on_print.append(index)
        if len(pads) < 2:
            return tuple(moved)
        edges = np.array([_edges(moved[index]) for index in pads])
        scores = np.array([moved[index].score for index in pads])
        kept = suppress(edges, scores, np.zeros(len(pads), np.int64), iou=_SAME_RING_IOU, most=len(pads))
        gone = set(pads) - {pads[index] for index in kept}
        left = [index for index in pads if index not in gone]
        for index in left:
            better = [i for i in left if i in on_print or moved[i].score > moved[index].score]
            if any(_is_part(moved[index], moved[whole]) for whole in better):
                gone.add(index)
        return tuple(box for index, box in enumerate(moved) if index not in gone)


def _moved(box: Detection, sight: Sight) -> Detection:
    """Return the box where the print is seen; its score falls where something else is seen there."""
    box = replace(box, score=_DOUBT * box.score) if sight.is_doubtful else box
    if sight.box_px is None:
        return box
    x0, y0, x1, y1 = (float(edge) for edge in sight.box_px)
    if x1 <= x0 or y1 <= y0:
        return box
    return replace(box, x_min_px=x0, y_min_px=y0, x_max_px=x1, y_max_px=y1)


def _is_part(box: Detection, whole: Detection) -> bool:
    """Whether a box lies in another: no pad lies in a pad, but its parts look a little like one."""
    (x0, y0, x1, y1), (left, top, right, bottom) = _edges(box), _edges(whole)
    width, height = min(x1, right) - max(x0, left), min(y1, bottom) - max(y0, top)
    area, larger = (x1 - x0) * (y1 - y0), (right - left) * (bottom - top)
    return area < larger and min(width, height) > 0.0 and width * height > _PART * area


def _edges(box: Detection) -> tuple[float, float, float, float]:
    return box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px
