"""The near stage: find the pad's tags in a frame and measure the pad's pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.pad import PadSpec
from landtool.tags.choose import SolutionChooser
from landtool.tags.finder import TagFinder
from landtool.tags.pose import Corners, Solution, pad_corners, pad_solutions
from landtool.tags.reader import TagReader
from landtool.target.refine import refine_on_edges
from landtool.types import Frame, Image, PadPose, Search, TagObservation

# Below this the tags alone give the orientation well enough, and the edges cost more time than they are worth
_CLEAR_RAD = np.radians(0.15)


@dataclass(frozen=True, eq=False)
class TagReading:
    """What the tags of one frame say. pose: of the pad, None when it was not measured; `reason` says why."""

    tags: tuple[TagObservation, ...]
    pose: PadPose | None
    search: Search
    reason: str


class TagStage:
    """Reads tags frame by frame, looking where the pad is expected.

    everywhere: search every whole picture, as needed when all tags of a family are wanted and not only the pad's.
    """

    def __init__(
        self, reader: TagReader, pad: PadSpec, camera: Camera, body_T_camera: Pose, *, everywhere: bool = False
    ) -> None:
        self._pad, self._camera = pad, camera
        self._finder = TagFinder(reader, pad, everywhere=everywhere)
        self._chooser = SolutionChooser(body_T_camera)

    def read(self, frame: Frame, world_T_body: Pose | None = None) -> TagReading:
        """Read one frame. world_T_body: the drone's pose at that moment, where it is known."""
        found = self._finder.find(frame)
        pose, reason = self._pose(found.ours, frame, world_T_body)
        if found.tags and not found.ours:
            reason = "no tag of the pad read"
        return TagReading(found.tags, pose, found.search, reason)

    def _pose(
        self, tags: tuple[TagObservation, ...], frame: Frame, world_T_body: Pose | None
    ) -> tuple[PadPose | None, str]:
        height, width = frame.image.shape[:2]
        if not tags:
            return None, "no tag read"
        if (width, height) != (self._camera.width, self._camera.height):
            return None, f"picture of {width}x{height}, calibration for {self._camera.width}x{self._camera.height}"
        corners = pad_corners(tags, self._camera, self._pad)
        if corners is None:
            return None, "the tag lies outside what the lens model covers"
        solutions = self._refined(frame.image, corners, pad_solutions(corners))
        if not solutions:
            return None, "no pose explains the tag's corners"
        chosen = self._chooser.choose(solutions, frame.t_ns, world_T_body)
        reason = "kept the solution the past supports, its mirror image fits better" if chosen else ""
        return _pad_pose(solutions, chosen), reason

    def _refined(self, image: Image, corners: Corners, solutions: Sequence[Solution]) -> tuple[Solution, ...]:
        """Let the large edges decide where the tags leave the orientation open; without them both remain."""
        if not any(_is_open(solution) for solution in solutions):
            return tuple(solutions)
        # from either of the two the edges lead to the one true pose, so the second is tried only if the first fails
        for solution in solutions:
            refined = refine_on_edges(image, corners, solution, self._pad, self._finder.reader.config.tone)
            if refined is not None:
                return (refined,)
        return tuple(solutions)


def _is_open(solution: Solution) -> bool:
    return bool(np.trace(solution.covariance[3:, 3:]) / 3.0 > _CLEAR_RAD**2)


def _pad_pose(solutions: tuple[Solution, ...], chosen: int) -> PadPose:
    best = solutions[chosen]
    alternative, ambiguity = None, 0.0
    if len(solutions) == 2:
        alternative = solutions[1 - chosen].camera_T_pad
        ambiguity = float(np.sqrt(solutions[0].chi2 / max(solutions[1].chi2, 1e-12)))
    ambiguity = min(ambiguity, 1.0)
    return PadPose(
        best.camera_T_pad,
        best.covariance,
        "tag",
        ambiguity,
        best.reproj_px,
        alternative,
        better_fit_rejected=chosen > 0,
    )
