"""Finds and measures every pad in a frame: where one is expected first, then where the network sees one.

    expected pad --> its tags, else its whole print, else the box it is seen in
    box of no known pad --> the same
    nothing at all --> tags anywhere

Far away the network looks in every frame, around the expected place; near it looks when a pad is lost, and now and then
for a pad nobody expects.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from landtool.camera import Camera
from landtool.detect.stage import DetectStage
from landtool.geometry import Array, Pose
from landtool.landing.box import box_edges, box_pose
from landtool.landing.follower import PadFollower
from landtool.landing.measure import PRINT_PX, PadMeasurer
from landtool.landing.tags import TagLook
from landtool.target.sight import look_at
from landtool.target.tone_gauge import ToneGauge
from landtool.tracking.platform import ExpectedPad
from landtool.types import Detection, Frame, Image, PadPose, Search, Stage, TagObservation

Given = TypeVar("Given")
LOOK_ROUND_EVERY = 30  # frames, near: for a pad nobody expects
_TAGS_AGAIN_EVERY = 5  # frames, when nothing is known for long
_LONG = 15  # frames
_MOST_BOXES = 6
_SURE_BOX = 0.5  # score of a box that is believed without its print
_SMALL_PX = 48.0  # a ring this wide is shown with its print, if it is one
_LEGIBLE_PX = 20.0  # of a tag's side: from here on it is read, if it is one of the pad
_MOST_UNREAD = 20  # frames
_ALIKE = 1.6  # a box of a pad differs from what is expected by less
_BOX_SHARES = (1.0, 0.75)  # a network may take a bright board, or what it lies on, for a part of the pad
_MISREAD_PX = 1.0  # corners farther from their places are not where they were read
_STALE_S = 0.5  # an older expectation is worse than a box
_NOTHING = "nothing of the pad found"


@dataclass(frozen=True, eq=False)
class FoundPad:
    """A measured pad. track_id: of the track it was expected by, None for a new one. said: for a log."""

    pose: PadPose
    follower: PadFollower
    track_id: int | None
    said: str = ""


@dataclass(frozen=True, eq=False)
class Found:
    """What a frame shows. pads: the expected first. search: where was looked. seconds: spent, by stage."""

    detections: tuple[Detection, ...] = ()
    tags: tuple[TagObservation, ...] = ()
    pads: tuple[FoundPad, ...] = ()
    search: Search = "region"
    reason: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)


class PadFinder:
    """Looks for pads frame by frame. detector: None where there is none, as for a pad without a ring.

    body_T_camera: the camera's mount. everywhere: read the tags of every whole picture. gauge: tells the pictures' tone
    curve while the pad is near; what it settles on is used from then on.
    """

    def __init__(
        self,
        measurer: PadMeasurer,
        tags: TagLook,
        detector: DetectStage | None,
        body_T_camera: Pose,
        *,
        everywhere: bool = False,
        gauge: ToneGauge | None = None,
    ) -> None:
        self.measurer, self._tags, self._detector, self._gauge = measurer, tags, detector, gauge
        self._body_T_camera, self._everywhere = body_T_camera, everywhere
        self._followers: dict[int, PadFollower] = {}
        self._looked_round = -LOOK_ROUND_EVERY
        self._lost_for = 0

    def find(
        self,
        frame: Frame,
        clear: Callable[[], Frame],
        stage: Stage,
        expected: Sequence[ExpectedPad],
        world_T_body: Pose | None,
    ) -> Found:
        """Look at one frame. clear: gives it without its haze. expected: where the tracks' pads should be."""
        look = _Look(self, frame, clear, stage, expected, world_T_body)
        found = look.run()
        self._lost_for = 0 if found.pads else self._lost_for + 1
        if self._gauge is not None and found.pads and found.pads[0].pose.method != "box":
            self._gauge_tone(self._gauge, frame.image, found.pads[0].pose.camera_T_pad)
        return found

    def _gauge_tone(self, gauge: ToneGauge, image: Image, camera_T_pad: Pose) -> None:
        gauge.add(image, camera_T_pad)
        told = gauge.estimate()
        if told is not None and told.is_settled and told.tone != self.measurer.tone:
            self.measurer = replace(self.measurer, tone=told.tone)
            self._tags.use_tone(told.tone)

    def keep(self, found: Found, taken: Sequence[int | None], living: Sequence[int]) -> None:
        """Take in which track each found pad went to, None for none, and which tracks live."""
        now = {track_id: pad.follower for pad, track_id in zip(found.pads, taken, strict=True) if track_id is not None}
        known = {**self._followers, **now}
        self._followers = {track_id: follower for track_id, follower in known.items() if track_id in living}

    def follower(self, track_id: int | None) -> PadFollower:
        """Return the memory of a track's pad, a new one for a new pad."""
        known = None if track_id is None else self._followers.get(track_id)
        return known or PadFollower(self._body_T_camera)

    @property
    def camera(self) -> Camera:
        """The pictures' camera."""
        return self.measurer.camera


class _Look:
    """One frame being looked at."""

    def __init__(
        self, finder: PadFinder, frame: Frame, clear: Callable[[], Frame], stage: Stage,
        expected: Sequence[ExpectedPad], world_T_body: Pose | None,
    ) -> None:  # fmt: skip
        self.finder, self.frame, self.clear, self.stage = finder, frame, clear, stage
        self.expected, self.world_T_body = expected, world_T_body
        self.measurer = finder.measurer
        self.pads: list[FoundPad] = []
        self.tags: list[TagObservation] = []
        self.detections: tuple[Detection, ...] = ()
        self.search: Search = "region"
        self.seconds: dict[str, float] = {}
        self.said: list[str] = []

    def run(self) -> Found:
        height, width = self.frame.image.shape[:2]
        camera = self.finder.camera
        if (width, height) != (camera.width, camera.height):
            self.tags += self._timed("tags", lambda: self.finder._tags.anywhere(self.frame.image))
            reason = f"picture of {width}x{height}, calibration for {camera.width}x{camera.height}"
            return Found((), tuple(self.tags), (), "frame", reason, self.seconds)
        if self.finder._everywhere:
            self._read_anywhere()
        missing = [e for e in self.expected if not self._where_expected(e)]
        self._at_boxes(missing)
        if not self.pads and not self.finder._everywhere and self._tags_are_due():
            self._read_anywhere()
        if not self.pads and not self.said:
            self.said.append(_NOTHING)
        said = [*self.said, *(pad.said for pad in self.pads)]
        return Found(
            self.detections,
            tuple(self.tags),
            tuple(self.pads),
            self.search,
            "; ".join(filter(None, said)),
            self.seconds,
        )

    def _where_expected(self, expected: ExpectedPad) -> bool:
        """Measure a pad where its track has it; False where it is not seen there."""
        if self._known_at(expected.camera_T_pad):
            return True
        follower, start = self.finder.follower(expected.track_id), expected.camera_T_pad
        if not self.finder._everywhere and self.finder._tags.is_readable(start):
            tags = self._timed("tags", lambda: self.finder._tags.near(self.frame.image, start, expected.sigma_m))
            if tags and self._by_tags(tags, follower, expected.track_id, start):
                return True
        if expected.age_s > _STALE_S:
            return False
        return self._by_print(follower, expected.track_id, lambda: follower.by_print(*self._where, start, *self._when))

    def _at_boxes(self, missing: list[ExpectedPad]) -> None:
        """Look with the network where that is due, and measure what it sees besides the pads already measured."""
        detector, index = self.finder._detector, self.frame.index
        round_due = not 0 <= index - self.finder._looked_round < LOOK_ROUND_EVERY
        if detector is None or not (self.stage == "far" or missing or not self.expected or round_due):
            return
        self._detect(detector)
        boxes = [box for box in self.detections if box.label == "pad"][:_MOST_BOXES]
        for box in boxes:
            edges = box_edges(box)
            middle = (edges[:2] + edges[2:]) / 2.0
            if self._covered(middle):
                continue
            near = [e for e in missing if self._is_of(e, edges)]
            track_id = near[0].track_id if near else None
            last = near[0].camera_T_pad if near else None
            if self._at_box(box, edges, self.finder.follower(track_id), track_id, last) and near:
                missing.remove(near[0])

    def _detect(self, detector: DetectStage) -> None:
        frame = self.clear()

        def look() -> None:
            boxes = detector.find(frame, self._expected_box())
            if frame is not self.frame and not boxes.detections:
                boxes = detector.find(self.frame)
            self.detections, self.search = boxes.detections, boxes.search
            if boxes.search == "frame":
                self.finder._looked_round = self.frame.index

        self._timed("detect", look)

    def _expected_box(self) -> Detection | None:
        if len(self.expected) != 1:  # a region shows only one of several
            return None
        edges = self._outline(self.expected[0].camera_T_pad)
        return None if edges is None else Detection("pad", 1.0, *(float(v) for v in edges))

    def _at_box(
        self, box: Detection, edges: Array, follower: PadFollower, track_id: int | None, last: Pose | None
    ) -> bool:
        image = self.frame.image
        side = float((edges[2:] - edges[:2]).max())
        if not self.finder._everywhere and self.finder._tags.is_readable_in(side):
            tags = self._timed("tags", lambda: self.finder._tags.in_box(image, edges))
            if tags and self._by_tags(tags, follower, track_id):
                return True
        shows_letter = False
        for share in _BOX_SHARES:
            inner = _shrunk(edges, share)
            starts = self._timed("target", partial(self.measurer.starts, image, inner))
            if self._by_print(follower, track_id, partial(follower.at_box, *self._where, starts, *self._when)):
                return True
            shows_letter |= bool(starts)
        if self._is_cut(edges):
            self.said.append("a box is cut by the picture's border: neither its size nor its middle is known")
            return False
        # a ring with a letter that the print does not explain is of something else
        if track_id is None and (box.score < _SURE_BOX or side >= _SMALL_PX or shows_letter):
            self.said.append("a box shows no print of the pad")
            return False
        return self._timed("target", lambda: self._by_box(image, edges, follower, track_id, last))

    def _by_box(
        self, image: Image, edges: Array, follower: PadFollower, track_id: int | None, last: Pose | None
    ) -> bool:
        if look_at(image, edges, self.measurer.pad, self.measurer.tone).is_doubtful:
            self.said.append("a box shows something else than the pad")
            return False
        pad = self.measurer.pad
        level = (self.world_T_body or Pose.identity()) @ self.finder._body_T_camera
        pose = box_pose(self.finder.camera, pad, edges, level.rotation, last)
        if pose is None:
            return False
        self.pads.append(FoundPad(pose, follower, track_id, "the print is not seen, only its box"))
        return True

    def _by_tags(
        self,
        tags: Sequence[TagObservation],
        follower: PadFollower,
        track_id: int | None,
        expected: Pose | None = None,
    ) -> bool:
        self.tags += tags
        solutions = self._timed("target", lambda: self.measurer.by_tags(self.frame.image, tags, expected))
        if not solutions:
            self.said.append("no pose explains the tag's corners")
            return False
        is_misread = solutions[0].reproj_px > _MISREAD_PX
        place = solutions[0].camera_T_pad
        if self.measurer.is_flat(place, PRINT_PX) and not is_misread:
            # the tag says which way round, the whole print how
            follower.head_by_tag(place, *self._when)
            whole = self._timed("target", lambda: follower.by_print(*self._where, place, *self._when))
            if whole is not None:
                self.pads.append(FoundPad(replace(whole[0], method="tag"), follower, track_id, whole[1]))
                return True
        elif expected is not None and (is_misread or follower.is_surprised(solutions[0], *self._when)):
            whole = self._timed("target", lambda: follower.by_print(*self._where, expected, *self._when))
            if whole is not None:
                self.pads.append(FoundPad(whole[0], follower, track_id, "the tag's corners contradict the whole print"))
                return True
        pose, said = follower.by_tag(solutions, *self._when)
        self.pads.append(FoundPad(pose, follower, track_id, said))
        return True

    @property
    def _where(self) -> tuple[Image, PadMeasurer]:
        return self.frame.image, self.measurer

    @property
    def _when(self) -> tuple[int | None, Pose | None]:
        return self.frame.t_ns, self.world_T_body

    def _by_print(
        self, follower: PadFollower, track_id: int | None, measure: Callable[[], tuple[PadPose, str] | None]
    ) -> bool:
        seen = self._timed("target", measure)
        if seen is None:
            return False
        pose, said = seen
        if self._lacks_tag(pose.camera_T_pad, follower, is_new=track_id is None):
            self.said.append("a print like the pad's, but without its tag")
            return True
        if not self._known_at(pose.camera_T_pad):  # two tracks led to one pad
            self.pads.append(FoundPad(pose, follower, track_id, said))
        return True

    def _lacks_tag(self, camera_T_pad: Pose, follower: PadFollower, *, is_new: bool) -> bool:
        """Whether a print is of another pad: one whose tag was never read, though it is in the picture and large.

        A tag may be blurred or covered for a while, so that a print that is tracked is believed for some frames more.
        """
        if follower.tag_was_read or not self.finder._tags.is_legible(camera_T_pad, _LEGIBLE_PX):
            return False
        follower.unread += 1
        return is_new or follower.unread > _MOST_UNREAD

    def _read_anywhere(self) -> None:
        """Read the tags of the whole picture; each group of them is a pad."""
        tags = self._timed("tags", lambda: self.finder._tags.anywhere(self.frame.image))
        if not tags:
            clear = self.clear()
            if clear is not self.frame:
                tags = self._timed("tags", lambda: self.finder._tags.anywhere(clear.image))
        self.search = "frame"
        groups = self.finder._tags.pads_of(tags)
        grouped = {id(tag) for group in groups for tag in group}
        self.tags += [tag for tag in tags if id(tag) not in grouped]
        for group in groups:
            middle = np.concatenate([tag.corners_px for tag in group]).mean(axis=0)
            if self._covered(middle):
                self.tags += group
                continue
            near = [e for e in self.expected if self._holds(e.camera_T_pad, middle)]
            track_id = near[0].track_id if near else None
            self._by_tags(group, self.finder.follower(track_id), track_id)
        if tags and not groups:
            self.said.append("no tag of the pad read")

    def _tags_are_due(self) -> bool:
        return self.finder._lost_for < _LONG or self.frame.index % _TAGS_AGAIN_EVERY == 0

    def _known_at(self, camera_T_pad: Pose) -> bool:
        place = self.finder.camera.project(camera_T_pad.translation[None])[0]
        return bool(np.isfinite(place).all()) and self._covered(place)

    def _covered(self, place_px: Array) -> bool:
        return any(self._holds(pad.pose.camera_T_pad, place_px) for pad in self.pads)

    def _holds(self, camera_T_pad: Pose, place_px: Array) -> bool:
        edges = self._outline(camera_T_pad)
        return edges is not None and bool((place_px > edges[:2]).all() and (place_px < edges[2:]).all())

    def _is_cut(self, edges: Array) -> bool:
        """Whether a box ends at the picture's border."""
        camera = self.finder.camera
        return bool((edges[:2] < 1.0).any() or (edges[2:] > np.array([camera.width, camera.height]) - 2.0).any())

    def _is_of(self, expected: ExpectedPad, edges: Array) -> bool:
        """Whether a box may be of an expected pad: of its size, and not farther from it than it is wide."""
        own = self._outline(expected.camera_T_pad)
        if own is None:
            return True
        apart = np.abs((own[:2] + own[2:] - edges[:2] - edges[2:]) / 2.0).max()
        wide, seen = float((own[2:] - own[:2]).max()), float((edges[2:] - edges[:2]).max())
        reach = max(expected.age_s, 0.0) + 1.0
        return bool(apart < reach * wide and 1.0 / _ALIKE < seen / wide < _ALIKE)

    def _outline(self, camera_T_pad: Pose) -> Array | None:
        """Return the box (4,) of a pad's outline, pixels; None where it is not all in front of the camera."""
        seen = self.finder.camera.project(camera_T_pad.apply(self.measurer.pad.outline_m[::8]))
        if not np.isfinite(seen).all():
            return None
        return np.concatenate([seen.min(axis=0), seen.max(axis=0)])

    def _timed(self, stage: str, call: Callable[[], Given]) -> Given:
        began = time.perf_counter()
        try:
            return call()
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - began


def _shrunk(edges: Array, share: float) -> Array:
    """Return a box (4,) shrunk about its middle."""
    middle, half = (edges[:2] + edges[2:]) / 2.0, (edges[2:] - edges[:2]) / 2.0
    return np.concatenate([middle - share * half, middle + share * half])
