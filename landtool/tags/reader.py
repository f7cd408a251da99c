"""Read tags: the AprilTag library finds and decodes them, registration measures their corners.

The library looks at encoded values, where it separates black from white best; every corner is measured again in
linear light (landtool.tags.refine). A small tag is looked for in an enlarged picture, a large one in a reduced one:
what is found there is only the start of the registration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from apriltag import apriltag
from numpy.typing import NDArray

from landtool.families import tag_family
from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.tags.refine import register
from landtool.tone import Tone
from landtool.types import Image, TagObservation

Grey = NDArray[np.uint8]
# A tag is looked for at about this many pixels a module: fewer lose reads, more only cost time.
_SEARCH_MODULE_PX = 5.0
_SCALES = (0.5, 1.0, 2.0, 3.0)
_MAX_SEARCH_PIXELS = 1280 * 960
# Families whose codes differ in few bits are matched by chance in any texture: they must be read without a
# correction and look like their tag.
_STRICT_BELOW_DISTANCE = 9
_MIN_CORRELATION = 0.6
_MIN_CORRELATION_STRICT = 0.85
_MIN_DISTANCE = {"tag36h11": 11, "tag25h9": 9, "tag16h5": 5, "tagStandard41h12": 12, "tagCustom48h12": 12}


@dataclass(frozen=True)
class ReaderConfig:
    """Which tags to read, and what a read must show.

    wanted: ids a family may have; None takes every id. tone: the curve of the pictures. max_hamming: corrected bits
    at the most (0 to 2). min_margin: of the decoder, grey levels. threads: of the AprilTag library.
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
        """Search the whole picture, as it is and enlarged twice."""
        grey = _grey(image)
        found = self._search(grey, np.zeros(2), 1.0)
        if grey.size <= _MAX_SEARCH_PIXELS:
            found += self._search(grey, np.zeros(2), 2.0)
        return self._measure(grey, found)

    def read_region(self, image: Image, region: Region) -> tuple[TagObservation, ...]:
        """Search one region only, at the scale that suits the expected size of the tag."""
        cut = image[region.y0 : region.y1, region.x0 : region.x1]
        if min(cut.shape[:2]) < 8:
            return ()
        grey = _grey(cut)
        wanted = _SEARCH_MODULE_PX / region.module_px
        scale = next((s for s in _SCALES if s >= 0.75 * wanted), _SCALES[-1])
        scale = min(scale, max(1.0, float(np.sqrt(_MAX_SEARCH_PIXELS / grey.size))))
        origin = np.array([region.x0, region.y0], dtype=np.float64)
        shifted = self._measure(grey, self._search(grey, np.zeros(2), scale))
        return tuple(_moved(tag, origin) for tag in shifted)

    def _search(self, grey: Grey, origin: Array, scale: float) -> list[_Decoded]:
        if scale != 1.0:
            size = (round(grey.shape[1] * scale), round(grey.shape[0] * scale))
            kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
            grey = cv2.resize(grey, size, interpolation=kind).astype(np.uint8, copy=False)
        found = []
        for family, detector in self._detectors.items():
            wanted = self.config.wanted[family]
            for raw in detector.detect(grey):
                if raw["margin"] < self.config.min_margin or (wanted is not None and raw["id"] not in wanted):
                    continue
                # the library's pixel centres lie at +0.5
                corners = raw["lb-rb-rt-lt"][::-1] / scale - 0.5 + origin
                found.append(_Decoded(family, raw["id"], raw["hamming"], raw["margin"], corners))
        return found

    def _measure(self, grey: Grey, decoded: list[_Decoded]) -> tuple[TagObservation, ...]:
        """Register every distinct decoded tag and drop what does not look like its tag."""
        observations: list[TagObservation] = []
        for raw in sorted(decoded, key=lambda d: (d.hamming, -d.margin)):
            if any(_same_place(raw, seen) for seen in observations):
                continue
            fit = register(grey, raw.family, raw.tag_id, raw.corners_px, self.config.tone)
            strict = _MIN_DISTANCE[raw.family] < _STRICT_BELOW_DISTANCE
            if fit is None or fit.correlation < (_MIN_CORRELATION_STRICT if strict else _MIN_CORRELATION):
                continue
            observations.append(
                TagObservation(raw.family, raw.tag_id, raw.hamming, raw.margin, fit.corners_px, fit.covariance_px2)
            )
        return tuple(sorted(observations, key=lambda o: (o.family, o.tag_id, *o.corners_px[0])))


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


def _same_place(raw: _Decoded, seen: TagObservation) -> bool:
    """Whether the middle of one lies inside the other."""
    middle = raw.corners_px.mean(axis=0).tolist()
    return cv2.pointPolygonTest(seen.corners_px.astype(np.float32), middle, False) >= 0


def _moved(tag: TagObservation, offset: Array) -> TagObservation:
    corners = tag.corners_px + offset
    return TagObservation(tag.family, tag.tag_id, tag.hamming, tag.margin, corners, tag.covariance_px2)


def module_px(corners_px: Array, family: str) -> float:
    """Mean size of a tag's module in pixels, from its corners (4, 2)."""
    edges = np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1)
    return float(edges.mean()) / tag_family(family).border_modules
