"""What the network sees in pictures that are judged: every box with its score, as `landtool detect` finds them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Literal

from landtool.config import TrackConfig
from landtool.detect.config import DetectorConfig
from landtool.detect.stage import BoxDetector, DetectStage
from landtool.pad import PadSpec
from landtool.pipeline import find
from landtool.run.haze import dehaze_stage
from landtool.types import Detection, Frame, FrameResult, Image, LostFrame

LEAST_SCORE = 0.001  # an average precision needs the boxes nobody would act on, too
MOVED_FROM = 0.05  # of those that are as good as nothing the ring is not looked for: it would take half of the time


def judged(config: DetectorConfig) -> DetectorConfig:
    """Return the settings of a network that is to be judged: it gives out what it is least sure of."""
    return replace(config, conf=min(LEAST_SCORE, config.conf))


def boxes(
    frames: Iterable[Frame | LostFrame],
    detector: BoxDetector,
    pad: PadSpec,
    config: TrackConfig,
    *,
    dehaze: Literal["auto", "on", "off"] | None = None,
) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    """Yield each frame with its boxes; dehaze: in place of the settings' own choice."""
    stage = DetectStage(detector, ring_of=pad if pad.ring is not None else None, moved_from=MOVED_FROM)
    return find(frames, detector=stage, tags=None, dehazer=dehaze_stage(dehaze or config.dehaze, config.dehazer))


class Remembered:
    """A network that has looked at this picture before: gives out what it saw, from `conf` on."""

    def __init__(self, seen: tuple[Detection, ...], conf: float) -> None:
        self._seen = tuple(box for box in seen if box.score >= conf)

    def detect(self, image: Image) -> tuple[Detection, ...]:  # noqa: ARG002 (it is the picture that was looked at)
        """Return the boxes of the whole picture."""
        return self._seen

    def detect_region(self, image: Image, region: object) -> tuple[Detection, ...]:  # noqa: ARG002
        """Return the boxes of the whole picture, of which the region is a part."""
        return self._seen
