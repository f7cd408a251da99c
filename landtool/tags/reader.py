"""Read tags: the AprilTag library finds and decodes them, registration measures their corners.

The library looks at a picture prepared for it (landtool.tags.looks), enlarged where tags are small and reduced where
they are large; what is found there is only the start of the registration in the original (landtool.tags.refine).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from apriltag import apriltag

from landtool.families import tag_family
from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.tags.looks import Grey, Look, look_encoded, look_in_light
from landtool.tags.refine import register
from landtool.tone import Tone
from landtool.types import Image, TagObservation

# Where the size is known a tag is looked for at about this many pixels a module: fewer lose reads, more cost time.
_SEARCH_MODULE_PX = 3.2
_SMALLEST_SCALE, _LARGEST_SCALE = 0.2, 2.5
_FRAME_SCALE = 1.5
_SMALLEST_PX = 8  # of a side: the AprilTag library crashes on two pixels
_MAX_SEARCH_PIXELS = 1_600_000
# Families whose codes differ in few bits are matched by chance in any texture: they must be read without a
# correction and look like their tag.
_STRICT_BELOW_DISTANCE = 10
_MIN_CORRELATION = 0.7
_MIN_CORRELATION_STRICT = 0.9
_MIN_DISTANCE = {"tag36h11": 11, "tag25h9": 9, "tag16h5": 5, "tagStandard41h12": 12, "tagCustom48h12": 12}
# Standard deviation of AprilTag's own corners, kept when a sure tag cannot be registered.
_UNREGISTERED_PX = 0.3
_UNREGISTERED_MODULES = 0.1


@dataclass(frozen=True)
class ReaderConfig:
    """Which tags to read, and what a read must show.

    wanted: ids a family may have; None takes every id. tone: the curve of the pictures. max_hamming: corrected bits
    at the most (0 to 2). min_margin: of the decoder, grey levels of the picture it looked at. threads: of the
    AprilTag library.
    """

    wanted: Mapping[str, frozenset[int] | None]
    tone: Tone = "srgb"
    max_hamming: int = 1
    min_margin: float = 20.0
    threads: int = 1

    @classmethod
    def of_pad(cls, pad: PadSpec, tone: Tone = "srgb") -> ReaderConfig:
        """Read the pad's own tags only."""
        families = {tag.family for tag in pad.tags}
        return cls({f: frozenset(tag.id for tag in pad.tags if tag.family == f) for f in sorted(families)}, tone)


@dataclass(frozen=True)
class Region:
    """Part of an image to search: pixels x0 <= x < x1, y0 <= y < y1; module_px: expected size of a tag's module."""

    x0: int
    y0: int
    x1: int
    y1: int
    module_px: float


class TagReader:
    """Reads the tags of one or more families in pictures (H, W, 3) BGR uint8."""

    def __init__(self, config: ReaderConfig) -> None:
        self.config = config
        self._detectors = {}
        for family in config.wanted:
            hamming = 0 if _MIN_DISTANCE[family] < _STRICT_BELOW_DISTANCE else config.max_hamming
            # every default of the binding is stated: it halves the picture unless told not to
            self._detectors[family] = apriltag(
                family, threads=config.threads, maxhamming=hamming, decimate=1.0, blur=0.0, refine_edges=False
            )

    def read_frame(self, image: Image) -> tuple[TagObservation, ...]:
        """Search the whole picture; the second look is left out once every wanted tag was read."""
        if min(image.shape[:2]) < _SMALLEST_PX:
            return ()
        grey = _grey(image)
        scale = _FRAME_SCALE if grey.size * _FRAME_SCALE**2 <= _MAX_SEARCH_PIXELS else 1.0
        found: list[_Decoded] = []
        for look in self._looks(grey, scale, 1.0):
            found += self._search(look)
            if self._complete(found):
                break
        return self._measure(grey, found)

    def read_region(self, image: Image, region: Region) -> tuple[TagObservation, ...]:
        """Search one region only, at the scale that suits the expected size of the tag.

        The second look is taken only when the first one shows nothing.
        """
        cut = image[region.y0 : region.y1, region.x0 : region.x1]
        if min(cut.shape[:2]) < _SMALLEST_PX:
            return ()
        grey = _grey(cut)
        scale = min(max(_SEARCH_MODULE_PX / region.module_px, _SMALLEST_SCALE), _LARGEST_SCALE)
        scale = min(scale, max(1.0, float(np.sqrt(_MAX_SEARCH_PIXELS / grey.size))))
        origin = np.array([region.x0, region.y0], dtype=np.float64)
        for look in self._looks(grey, scale, 1.5 * scale):
            measured = self._measure(grey, self._search(look))
            if measured:
                return tuple(replace(tag, corners_px=tag.corners_px + origin) for tag in measured)
        return ()

    def _looks(self, grey: Grey, light_scale: float, encoded_scale: float) -> Iterator[Look]:
        yield look_in_light(grey, light_scale, self.config.tone)
        yield look_encoded(grey, encoded_scale)

    def _search(self, look: Look) -> list[_Decoded]:
        found = []
        for family, detector in self._detectors.items():
            wanted = self.config.wanted[family]
            for raw in detector.detect(look.picture):
                if raw["margin"] < self.config.min_margin or (wanted is not None and raw["id"] not in wanted):
                    continue
                corners = look.to_original(raw["lb-rb-rt-lt"][::-1])
                if not look.holds(corners):
                    continue  # cut off by the rim: the library makes the rest up
                found.append(_Decoded(family, raw["id"], raw["hamming"], raw["margin"], corners))
        return found

    def _complete(self, found: list[_Decoded]) -> bool:
        """Whether every wanted tag was found; never when every id is wanted."""
        read = {(tag.family, tag.tag_id) for tag in found}
        wanted = self.config.wanted.items()
        return all(ids is not None and all((family, i) in read for i in ids) for family, ids in wanted)

    def _measure(self, grey: Grey, decoded: list[_Decoded]) -> tuple[TagObservation, ...]:
        """Register every distinct decoded tag and drop what does not look like its tag."""
        observations: list[TagObservation] = []
        for raw in sorted(decoded, key=lambda d: (d.hamming, -d.margin)):
            if any(_same_place(raw.corners_px, seen.corners_px) for seen in observations):
                continue
            measured = self._observe(grey, raw)
            if measured is not None:
                observations.append(measured)
        return tuple(sorted(observations, key=lambda o: (o.family, o.tag_id, *o.corners_px[0])))

    def _observe(self, grey: Grey, raw: _Decoded) -> TagObservation | None:
        strict = _MIN_DISTANCE[raw.family] < _STRICT_BELOW_DISTANCE
        fit = register(grey, raw.family, raw.tag_id, raw.corners_px, self.config.tone)
        if fit is not None:
            if fit.correlation < (_MIN_CORRELATION_STRICT if strict else _MIN_CORRELATION):
                return None
            corners, covariance = fit.corners_px, fit.covariance_px2
        elif raw.hamming == 0 and not strict:
            # too sure a code to throw away: occluded or glaring, it is still there
            spread = max(_UNREGISTERED_PX, _UNREGISTERED_MODULES * module_px(raw.corners_px, raw.family))
            corners, covariance = raw.corners_px, spread**2 * np.eye(8)
        else:
            return None
        return TagObservation(raw.family, raw.tag_id, raw.hamming, raw.margin, corners, covariance)


@dataclass(frozen=True, eq=False)
class _Decoded:
    """What the AprilTag library says of one tag; corners as in TagObservation."""

    family: str
    tag_id: int
    hamming: int
    margin: float
    corners_px: Array


def _grey(image: Image) -> Grey:
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)


def _same_place(corners_px: Array, others_px: Array) -> bool:
    """Whether two quadrilaterals are one tag: alike in size, the middle of one inside the other.

    A tag inside another's free middle is a tag of its own.
    """
    middle = corners_px.mean(axis=0).tolist()
    areas = sorted(cv2.contourArea(c.astype(np.float32)) for c in (corners_px, others_px))
    return areas[0] > 0.3 * areas[1] and cv2.pointPolygonTest(others_px.astype(np.float32), middle, False) >= 0


def module_px(corners_px: Array, family: str) -> float:
    """Mean size of a tag's module in pixels, from its corners (4, 2)."""
    edges = np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1)
    return float(edges.mean()) / tag_family(family).border_modules
