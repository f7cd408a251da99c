"""What sees the dehazed picture, and what the original."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.config import DetectConfig, TrackConfig
from landtool.dehaze.stage import Dehazed
from landtool.detect.stage import FoundBoxes
from landtool.pipeline import find, process
from landtool.run.haze import dehaze_stage
from landtool.tags.finder import FoundTags
from landtool.tags.stage import TagReading
from landtool.types import Detection, Frame, FrameResult, TagObservation

FOGGY, CLEAR = np.full((48, 64, 3), 200, np.uint8), np.full((48, 64, 3), 60, np.uint8)
FRAME = Frame(0, 0, FOGGY)
BOX = Detection("pad", 0.9, 1.0, 1.0, 9.0, 9.0)
TAG = TagObservation("tag36h11", 5, 0, 90.0, np.zeros((4, 2)), np.eye(8))


class Haze:
    def __init__(self, *, dehazes: bool) -> None:
        self._dehazes = dehazes

    def see(self, frame: Frame) -> Dehazed:
        return Dehazed(CLEAR, 0.7, True, None) if self._dehazes else Dehazed(frame.image, 0.2, False)


class Looks:
    """Finds things in one of the two pictures only, and remembers what it was shown."""

    def __init__(self, shown_in: np.ndarray | None) -> None:
        self._shown_in = shown_in
        self.saw: list[int] = []

    def _finds(self, frame: Frame) -> bool:
        self.saw.append(int(frame.image[0, 0, 0]))
        return self._shown_in is not None and frame.image is self._shown_in


class Boxes(Looks):
    def find(self, frame: Frame) -> FoundBoxes:
        return FoundBoxes((BOX,) if self._finds(frame) else (), "frame")


class Tags(Looks):
    def find(self, frame: Frame, boxes: object) -> FoundTags:  # noqa: ARG002
        tags = (TAG,) if self._finds(frame) else ()
        return FoundTags(tags, tags, "frame")

    def read(self, frame: Frame, world_T_body: object) -> TagReading:  # noqa: ARG002
        return TagReading((TAG,) if self._finds(frame) else (), None, "frame", "")


class Tracker:
    def world_T_body(self, t_ns: int | None) -> None: ...

    def step(self, t_ns: int | None, pose: object) -> tuple[tuple[()], str]:  # noqa: ARG002
        return (), ""

    def placed(self, t_ns: int | None, pose: object) -> tuple[None, None]:  # noqa: ARG002
        return None, None


def found(boxes: Boxes, tags: Tags | None, haze: Haze | None) -> FrameResult:
    ((_, result),) = find([FRAME], detector=boxes, tags=tags, dehazer=haze)
    return result


@pytest.mark.parametrize(("shown_in", "saw", "count"), [(CLEAR, [60], 1), (FOGGY, [60, 200], 1), (None, [60, 200], 0)])
def test_the_detector_looks_at_the_dehazed_picture_first(
    shown_in: np.ndarray | None, saw: list[int], count: int
) -> None:
    boxes = Boxes(shown_in)
    result = found(boxes, None, Haze(dehazes=True))
    assert (boxes.saw, len(result.detections)) == (saw, count)
    assert (result.haze, result.dehazed) == (0.7, True)
    assert set(result.stage_seconds) == {"dehaze", "detect"}


@pytest.mark.parametrize(("shown_in", "saw", "count"), [(FOGGY, [200], 1), (CLEAR, [200, 60], 1), (None, [200, 60], 0)])
def test_tags_are_read_in_the_original_first(shown_in: np.ndarray | None, saw: list[int], count: int) -> None:
    tags = Tags(shown_in)
    assert len(found(Boxes(CLEAR), tags, Haze(dehazes=True)).tags) == count
    assert tags.saw == saw
    again = Tags(shown_in)
    ((_, result),) = process([FRAME], tags=again, tracker=Tracker(), dehazer=Haze(dehazes=True))
    assert (again.saw, len(result.tags), result.haze, result.dehazed) == (saw, count, 0.7, True)


def test_what_is_not_dehazed_is_looked_at_once() -> None:
    boxes, tags = Boxes(None), Tags(None)
    result = found(boxes, tags, Haze(dehazes=False))
    assert (boxes.saw, tags.saw) == ([200], [200])
    assert (result.haze, result.dehazed) == (0.2, False)


def test_without_a_dehazer_nothing_is_said_of_haze() -> None:
    result = found(Boxes(CLEAR), Tags(None), None)
    assert (result.haze, result.dehazed) == (None, False)
    assert "dehaze" not in result.stage_seconds


def test_detect_and_track_dehaze_later_than_the_command() -> None:
    for config in (DetectConfig(), TrackConfig()):
        assert (config.dehaze, config.dehazer.haze_on) == ("auto", 0.55)
    assert dehaze_stage("off", DetectConfig().dehazer) is None
    even = dehaze_stage("on", DetectConfig().dehazer)
    assert even is not None
    assert even.see(FRAME).dehazed
