"""The paper's hard switch, for comparison: boxes alone while the drone is high, the tag alone below the threshold."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from landtool.detect.stage import DetectStage
from landtool.geometry import Pose
from landtool.landing.box import box_edges, box_pose
from landtool.landing.follower import PadFollower
from landtool.landing.found import Found, FoundPad
from landtool.landing.measure import PadMeasurer
from landtool.landing.tags import TagLook
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tracking.platform import ExpectedPad
from landtool.types import Frame, Stage


class PaperFinder:
    """Looks as the paper does; the same calls as `PadFinder`. The network and the tags are looked for everywhere."""

    def __init__(self, measurer: PadMeasurer, tags: TagLook, detector: DetectStage | None, body_T_camera: Pose) -> None:
        self._measurer, self._tags, self._detector = measurer, tags, detector
        self._body_T_camera = body_T_camera

    def find(
        self,
        frame: Frame,
        clear: Callable[[], Frame],
        stage: Stage,
        expected: Sequence[ExpectedPad],  # noqa: ARG002 - every frame stands alone
        world_T_body: Pose | None,
    ) -> Found:
        """Look at one frame: for the box in the far stage, for the tag in the near one."""
        if stage == "near":
            return self._by_tag(frame, world_T_body)
        return self._by_box(clear(), world_T_body)

    def keep(self, found: Found, taken: Sequence[int | None], living: Sequence[int]) -> None:
        """Nothing is remembered."""

    def _by_tag(self, frame: Frame, world_T_body: Pose | None) -> Found:
        began = time.perf_counter()
        tags = self._tags.anywhere(frame.image)
        groups = self._tags.pads_of(tags)
        corners = pad_corners(groups[0], self._measurer.camera, self._measurer.pad) if groups else None
        solutions = () if corners is None else pad_solutions(corners)
        pads: tuple[FoundPad, ...] = ()
        if solutions:
            follower = PadFollower(self._body_T_camera)
            pose, said = follower.by_tag(solutions[:1], frame.t_ns, world_T_body)
            pads = (FoundPad(pose, follower, None, said),)
        spent = {"tags": time.perf_counter() - began}
        return Found((), tags, pads, "frame", "" if pads else "no tag read", spent)

    def _by_box(self, clear: Frame, world_T_body: Pose | None) -> Found:
        if self._detector is None:
            return Found(search="frame", reason="far stage, and no network to look with")
        began = time.perf_counter()
        boxes = self._detector.find(clear)
        pads: tuple[FoundPad, ...] = ()
        measurer, level = self._measurer, (world_T_body or Pose.identity()) @ self._body_T_camera
        if boxes.pads:
            edges = box_edges(boxes.pads[0])
            pose = box_pose(measurer.camera, measurer.pad, edges, level.rotation)
            pads = () if pose is None else (FoundPad(pose, PadFollower(self._body_T_camera), None),)
        spent = {"detect": time.perf_counter() - began}
        return Found(boxes.detections, (), pads, "frame", "" if pads else "no box", spent)
