"""The near stage: find the pad's tags in a frame and measure the pad's pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.pad import PadSpec
from landtool.tags.choose import SolutionChooser
from landtool.tags.outline import outline_misfit
from landtool.tags.pose import Solution, pad_solutions
from landtool.tags.reader import TagReader
from landtool.tags.search import TagSearch
from landtool.types import Frame, PadPose, Search, TagObservation


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
        self._reader, self._pad, self._camera = reader, pad, camera
        self._search = TagSearch(pad)
        self._chooser = SolutionChooser(body_T_camera)
        self._everywhere = everywhere

    def read(self, frame: Frame, world_T_body: Pose | None = None) -> TagReading:
        """Read one frame. world_T_body: the drone's pose at that moment, where it is known."""
        height, width = frame.image.shape[:2]
        region = None if self._everywhere else self._search.region(frame.index, width, height)
        reader = self._reader
        tags = reader.read_region(frame.image, region) if region else reader.read_frame(frame.image)
        self._search.saw(frame.index, tags)
        search: Search = "frame" if region is None else "region"
        pose, reason = self._pose(tags, frame, world_T_body)
        return TagReading(tags, pose, search, reason)

    def _pose(
        self, tags: tuple[TagObservation, ...], frame: Frame, world_T_body: Pose | None
    ) -> tuple[PadPose | None, str]:
        height, width = frame.image.shape[:2]
        if not tags:
            return None, "no tag read"
        if (width, height) != (self._camera.width, self._camera.height):
            return None, f"picture of {width}x{height}, calibration for {self._camera.width}x{self._camera.height}"
        solutions = pad_solutions(tags, self._camera, self._pad)
        if not solutions:
            return None, "no tag of the pad read"
        misfit = partial(outline_misfit, frame.image, self._camera, pad=self._pad)
        chosen = self._chooser.choose(solutions, frame.t_ns, world_T_body, misfit)
        reason = "kept the solution the past supports, its mirror image fits better" if chosen else ""
        return _pad_pose(solutions, chosen), reason


def _pad_pose(solutions: tuple[Solution, ...], chosen: int) -> PadPose:
    best = solutions[chosen]
    alternative, ambiguity = None, 0.0
    if len(solutions) == 2:
        alternative = solutions[1 - chosen].camera_T_pad
        ambiguity = float(np.sqrt(solutions[0].chi2 / max(solutions[1].chi2, 1e-12)))
    return PadPose(best.camera_T_pad, best.covariance, "tag", min(ambiguity, 1.0), best.reproj_px, alternative)
