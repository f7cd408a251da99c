"""One frame being looked at: where a pad is expected first, then where the network sees one.

    expected pad --> its tags, else its whole print, else the box it is seen in
    box of no known pad --> the same
    nothing at all --> tags anywhere

Far away the network looks in every frame, around the expected place; near it looks when a pad is lost, and now and then
for a pad nobody expects.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from landtool.detect.stage import DetectStage
from landtool.geometry import Array, Pose
from landtool.landing.box import box_edges, box_pose
from landtool.landing.follower import PadFollower
from landtool.landing.found import Found, FoundPad
from landtool.landing.measure import PRINT_PX, PadMeasurer
from landtool.landing.memory import LOOK_ROUND_EVERY, Memory, Tools
from landtool.landing.outline import is_cut, may_be_of, outline_px, shrunk
from landtool.target.sight import look_at
from landtool.tracking.platform import ExpectedPad
from landtool.types import Detection, Frame, Image, PadPose, Search, Stage, TagObservation

Given = TypeVar("Given")
_TAGS_AGAIN_EVERY = 5  # frames, when nothing is known for long
_LONG = 15  # frames
_MOST_BOXES = 6
_SURE_BOX = 0.5  # score of a box that is believed without its print
_SMALL_PX = 48.0  # a ring this wide is shown with its print, if it is one
_LEGIBLE_PX = 20.0  # of a tag's side: from here on it is read, if it is one of the pad
_MOST_UNREAD = 20  # frames
_BOX_SHARES = (1.0, 0.75)  # a network may take a bright board, or what it lies on, for a part of the pad
_MISREAD_PX = 1.0  # corners farther from their places are not where they were read
_STALE_S = 0.5  # an older expectation is worse than a box
_NOTHING = "nothing of the pad found"


class Look:
    """One frame being looked at."""

    def __init__(
        self,
        tools: Tools,
        memory: Memory,
        frame: Frame,
        clear: Callable[[], Frame],
        stage: Stage,
        expected: Sequence[ExpectedPad],
        world_T_body: Pose | None,
    ) -> None:
        self.tools, self.memory = tools, memory
        self.frame, self.clear, self.stage = frame, clear, stage
        self.expected, self.world_T_body = expected, world_T_body
        self.measurer, self.camera = tools.measurer, tools.measurer.camera
        self.pads: list[FoundPad] = []
        self.tags: list[TagObservation] = []
        self.detections: tuple[Detection, ...] = ()
        self.search: Search = "region"
        self.seconds: dict[str, float] = {}
        self.said: list[str] = []

    def run(self) -> Found:
        """Look, once."""
        height, width = self.frame.image.shape[:2]
        camera = self.camera
        if (width, height) != (camera.width, camera.height):
            self.tags += self._timed("tags", lambda: self.tools.tags.anywhere(self.frame.image))
            reason = f"picture of {width}x{height}, calibration for {camera.width}x{camera.height}"
            return Found((), tuple(self.tags), (), "frame", reason, self.seconds)
        if self.tools.everywhere:
            self._read_anywhere()
        missing = [e for e in self.expected if not self._where_expected(e)]
        self._at_boxes(missing)
        if not self.pads and not self.tools.everywhere and self._tags_are_due():
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

    def _follower(self, track_id: int | None) -> PadFollower:
        return self.memory.follower(track_id) or PadFollower(self.tools.body_T_camera)

    def _where_expected(self, expected: ExpectedPad) -> bool:
        """Measure a pad where its track has it; False where it is not seen there."""
        if self._known_at(expected.camera_T_pad):
            return True
        follower, start = self._follower(expected.track_id), expected.camera_T_pad
        if not self.tools.everywhere and self.tools.tags.is_readable(start):
            tags = self._timed("tags", lambda: self.tools.tags.near(self.frame.image, start, expected.sigma_m))
            if tags and self._by_tags(tags, follower, expected.track_id, start):
                return True
        if expected.age_s > _STALE_S:
            return False
        return self._by_print(follower, expected.track_id, lambda: follower.by_print(*self._where, start, *self._when))

    def _at_boxes(self, missing: list[ExpectedPad]) -> None:
        """Look with the network where that is due, and measure what it sees besides the pads already measured."""
        detector, index = self.tools.detector, self.frame.index
        round_due = not 0 <= index - self.memory.looked_round < LOOK_ROUND_EVERY
        if detector is None or not (self.stage == "far" or missing or not self.expected or round_due):
            return
        self._detect(detector)
        boxes = [box for box in self.detections if box.label == "pad"][:_MOST_BOXES]
        for box in boxes:
            edges = box_edges(box)
            middle = (edges[:2] + edges[2:]) / 2.0
            if self._covered(middle):
                continue
            if self.memory.was_refused(self.frame.index, edges):
                self.said.append("a box shows no pad, as in the frames before")
                continue
            near = [e for e in missing if may_be_of(self._outline(e.camera_T_pad), edges, e.age_s)]
            track_id = near[0].track_id if near else None
            last = near[0].camera_T_pad if near else None
            if not self._at_box(box, edges, self._follower(track_id), track_id, last):
                self.memory.refuse(self.frame.index, edges)
            elif near:
                missing.remove(near[0])

    def _detect(self, detector: DetectStage) -> None:
        frame = self.clear()

        def look() -> None:
            boxes = detector.find(frame, self._expected_box())
            if frame is not self.frame and not boxes.detections:
                boxes = detector.find(self.frame)
            self.detections, self.search = boxes.detections, boxes.search
            if boxes.search == "frame":
                self.memory.looked_round = self.frame.index

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
        if not self.tools.everywhere and self.tools.tags.is_readable_in(side):
            tags = self._timed("tags", lambda: self.tools.tags.in_box(image, edges))
            if tags and self._by_tags(tags, follower, track_id):
                return True
        shows_letter = False
        for share in _BOX_SHARES:
            inner = shrunk(edges, share)
            starts = self._timed("target", partial(self.measurer.starts, image, inner))
            if self._by_print(follower, track_id, partial(follower.at_box, *self._where, starts, *self._when)):
                return True
            shows_letter |= bool(starts)
        if is_cut(self.camera, edges):
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
        level = (self.world_T_body or Pose.identity()) @ self.tools.body_T_camera
        pose = box_pose(self.camera, pad, edges, level.rotation, last)
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
        if follower.tag_was_read or not self.tools.tags.is_legible(camera_T_pad, _LEGIBLE_PX):
            return False
        follower.unread += 1
        return is_new or follower.unread > _MOST_UNREAD

    def _read_anywhere(self) -> None:
        """Read the tags of the whole picture; each group of them is a pad."""
        tags = self._timed("tags", lambda: self.tools.tags.anywhere(self.frame.image))
        if not tags:
            clear = self.clear()
            if clear is not self.frame:
                tags = self._timed("tags", lambda: self.tools.tags.anywhere(clear.image))
        self.search = "frame"
        groups = self.tools.tags.pads_of(tags)
        grouped = {id(tag) for group in groups for tag in group}
        self.tags += [tag for tag in tags if id(tag) not in grouped]
        for group in groups:
            middle = np.concatenate([tag.corners_px for tag in group]).mean(axis=0)
            if self._covered(middle):
                self.tags += group
                continue
            near = [e for e in self.expected if self._holds(e.camera_T_pad, middle)]
            track_id = near[0].track_id if near else None
            self._by_tags(group, self._follower(track_id), track_id)
        if tags and not groups:
            self.said.append("no tag of the pad read")

    def _tags_are_due(self) -> bool:
        return self.memory.lost_for < _LONG or self.frame.index % _TAGS_AGAIN_EVERY == 0

    def _known_at(self, camera_T_pad: Pose) -> bool:
        if not self.pads:
            return False
        place = self.camera.project(camera_T_pad.translation[None])[0]
        return bool(np.isfinite(place).all()) and self._covered(place)

    def _covered(self, place_px: Array) -> bool:
        return any(self._holds(pad.pose.camera_T_pad, place_px) for pad in self.pads)

    def _holds(self, camera_T_pad: Pose, place_px: Array) -> bool:
        edges = self._outline(camera_T_pad)
        return edges is not None and bool((place_px > edges[:2]).all() and (place_px < edges[2:]).all())

    def _outline(self, camera_T_pad: Pose) -> Array | None:
        return outline_px(self.camera, self.measurer.pad, camera_T_pad)

    def _timed(self, stage: str, call: Callable[[], Given]) -> Given:
        began = time.perf_counter()
        try:
            return call()
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - began
