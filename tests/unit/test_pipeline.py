"""What sees the dehazed picture and what the original, and how the parts of the method work together."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from landtool.config import DetectConfig, TrackConfig
from landtool.dehaze.stage import Dehazed
from landtool.detect.stage import FoundBoxes
from landtool.geometry import Pose
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.follower import PadFollower
from landtool.landing.found import Found, FoundPad
from landtool.landing.stages import StageSwitch
from landtool.pipeline import TOO_SMALL, find, process
from landtool.run.haze import dehaze_stage
from landtool.tags.finder import FoundTags
from landtool.tracking.config import TrackerConfig
from landtool.tracking.platform import ExpectedPad, PlatformTracker
from landtool.types import Detection, Frame, FrameResult, LostFrame, PadPose, PoseMethod, Stage, TagObservation

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


class Finder:
    """Sees pads of given methods at given places in the camera, and remembers what it was told.

    It asks for the dehazed picture in the far stage, as the network does, and nowhere else.
    """

    def __init__(self, *pads: tuple[PoseMethod, tuple[float, float, float]]) -> None:
        self.pads = pads
        self.stages: list[Stage] = []
        self.expected: list[tuple[ExpectedPad, ...]] = []
        self.kept: list[tuple[tuple[int | None, ...], tuple[int, ...]]] = []
        self.saw: list[int] = []

    def find(
        self,
        frame: Frame,
        clear: Callable[[], Frame],
        stage: Stage,
        expected: Sequence[ExpectedPad],
        world_T_body: Pose | None,  # noqa: ARG002
    ) -> Found:
        self.stages.append(stage)
        self.expected.append(tuple(expected))
        self.saw.append(int((clear() if stage == "far" else frame).image[0, 0, 0]))
        pads = tuple(FoundPad(measured(method, place), PadFollower(STRAIGHT_DOWN), None) for method, place in self.pads)
        return Found(pads=pads, reason="" if pads else "nothing", seconds={"target": 0.001})

    def keep(self, found: Found, taken: Sequence[int | None], living: Sequence[int]) -> None:  # noqa: ARG002
        self.kept.append((tuple(taken), tuple(living)))


def measured(method: PoseMethod, place: tuple[float, float, float]) -> PadPose:
    facing = STRAIGHT_DOWN.rotation.T
    return PadPose(Pose(facing, np.array(place)), np.eye(6) * 1e-4, method, 0.0, 0.1)


def processed(
    finder: Finder, frames: Sequence[Frame | LostFrame], haze: Haze | None = None, altitude_m: float | None = 5.0
) -> list[FrameResult]:
    tracker, switch = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN), StageSwitch(altitude_m)
    parts = {"finder": finder, "switch": switch, "tracker": tracker, "body_T_camera": STRAIGHT_DOWN}
    return [result for _, result in process(frames, **parts, dehazer=haze)]  # type: ignore[arg-type]


def at(*indices: int) -> list[Frame | LostFrame]:
    return [Frame(i, i * 33_000_000, FOGGY) for i in indices]


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


def test_only_what_asks_for_it_sees_the_dehazed_picture() -> None:
    far, near = Finder(("target", (0.0, 0.0, 9.0))), Finder(("tag", (0.0, 0.0, 3.0)))
    hazy = processed(far, at(0, 1), Haze(dehazes=True))
    assert (far.saw, [result.dehazed for result in hazy]) == ([60, 60], [True, True])
    clear = processed(near, at(0, 1), Haze(dehazes=True))
    # before anything is known of the height the stage is the far one
    assert (near.saw, [result.dehazed for result in clear]) == ([60, 200], [True, False])
    assert [result.haze for result in clear] == [0.7, 0.7]
    assert set(clear[1].stage_seconds) == {"dehaze", "target", "track"}


def test_the_height_of_the_last_pose_makes_the_stage_and_the_reason_is_said() -> None:
    finder = Finder(("tag", (0.0, 0.0, 9.0)))
    results = processed(finder, at(0, 1))
    assert results[0].altitude_m == pytest.approx(9.0)
    finder.pads = (("tag", (0.0, 0.0, 3.0)),)
    results = processed(finder, at(0, 1, 2))
    # before the first pose nothing tells the height: it is looked for as from afar, and known to be near once found
    assert finder.stages[2:] == ["far", "near", "near"]
    assert [result.stage for result in results] == ["near", "near", "near"]
    assert [result.reason for result in results] == ["", "", ""]


def test_a_change_of_stage_is_a_reason() -> None:
    finder = Finder(("tag", (0.0, 0.0, 6.0)))
    tracker, switch = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN), StageSwitch(5.0)
    frames = process(at(*range(40)), finder=finder, switch=switch, tracker=tracker, body_T_camera=STRAIGHT_DOWN)
    results = []
    for _, result in frames:
        results.append(result)
        finder.pads = (("tag", (0.0, 0.0, 6.0 - 0.1 * len(results))),)
    (change,) = [result for result in results if result.reason]
    assert change.stage == "near"
    assert re.fullmatch(r"near stage: 4\.[345] m high, below the switch at 5\.0 m", change.reason)


def test_the_tracks_say_where_a_pad_is_expected_and_the_finder_learns_where_it_went() -> None:
    finder = Finder(("tag", (0.2, 0.0, 3.0)))
    results = processed(finder, at(0, 1))
    assert finder.expected[0] == ()
    (expected,) = finder.expected[1]
    assert expected.track_id == 1
    assert expected.camera_T_pad.translation == pytest.approx([0.2, 0.0, 3.0])
    assert finder.kept == [((1,), (1,))] * 2
    assert results[1].body_T_pad is not None
    assert results[1].body_T_pad.translation == pytest.approx(STRAIGHT_DOWN.apply([[0.2, 0.0, 3.0]])[0])


def test_of_two_pads_the_one_tracked_first_stays_the_main_one() -> None:
    first, second = ("target", (-0.8, 0.0, 3.0)), ("tag", (0.8, 0.0, 3.0))
    finder = Finder(first)
    processed_with = iter([(first,), (first,), (first, second), (second, first), (second,)])
    finder.pads = next(processed_with)
    tracker, switch = PlatformTracker(TrackerConfig(), STRAIGHT_DOWN), StageSwitch(5.0)
    frames = process(at(*range(5)), finder=finder, switch=switch, tracker=tracker, body_T_camera=STRAIGHT_DOWN)
    results = []
    for _, result in frames:
        results.append(result)
        finder.pads = next(processed_with, ())
    assert [result.pose and result.pose.method for result in results] == ["target"] * 4 + [None]
    assert [[pose.method for pose in result.other_poses] for result in results] == [[], [], ["tag"], ["tag"], ["tag"]]


def test_a_lost_frame_lets_the_track_coast() -> None:
    finder = Finder(("tag", (0.0, 0.0, 3.0)))
    frames = [*at(0, 1, 2), LostFrame(3, 3 * 33_000_000, "no picture"), *at(4)]
    results = processed(finder, frames)
    assert len(finder.stages) == 4
    lost = results[3]
    assert (lost.status, lost.reason, lost.pose) == ("damaged", "no picture", None)
    assert [track.status for track in lost.tracks] == ["coasting"]
    assert [track.track_id for track in results[4].tracks] == [1]


def test_a_tiny_picture_is_not_looked_at() -> None:
    finder = Finder(("tag", (0.0, 0.0, 3.0)))
    (result,) = processed(finder, [Frame(0, 0, np.zeros((8, 200, 3), np.uint8))])
    assert (finder.stages, result.pose, result.reason) == ([], None, TOO_SMALL)


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
