"""What a run says at its end, gathered while the results go by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

import numpy as np

from landtool.camera import Camera
from landtool.pad import PadSpec
from landtool.types import Frame, FrameResult, LostFrame

# A corner further off than this was not misread by noise
_MISFIT_PX = 3.0
Results = Iterable[tuple[Frame | LostFrame, FrameResult]]


class Summary:
    """Counts and extremes over a run; memory does not grow with its length.

    frames, posed (with a pose), tags (read, all ids), flips_rejected (the better fit was not believed), states
    (frames by the best track's state), distance_m (first, least), longest_gap_s (between poses, after the first).
    misfits: poses whose corners lie far from their places. unmeasured: pictures of another size than the camera's.
    unplaced: poses at whose time the drone's own is not known.
    """

    def __init__(self, camera: Camera, pad: PadSpec) -> None:
        self._pad = pad
        self.assumed = camera.assumed
        self._size = camera.width, camera.height
        self.unmeasured = self.unplaced = self.misfits = 0
        self.frames = self.posed = self.tags = self.flips_rejected = 0
        self.states: Counter[str] = Counter()
        self.first_distance_m: float | None = None
        self.least_distance_m: float | None = None
        self.longest_gap_s = 0.0
        self._last_pose_ns: int | None = None

    def watch(self, results: Results) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
        """Pass results on and take them in."""
        for frame, result in results:
            self._add(result)
            self.unmeasured += isinstance(frame, Frame) and frame.image.shape[1::-1] != self._size
            yield frame, result

    def _add(self, result: FrameResult) -> None:
        self.frames += 1
        self.tags += len(result.tags)
        order = ("confirmed", "coasting", "tentative")
        self.states[min((t.status for t in result.tracks), key=order.index, default="none")] += 1
        if result.pose is None:
            return
        self.posed += 1
        self.unplaced += "own pose is not known" in result.reason
        self.flips_rejected += result.pose.better_fit_rejected
        self.misfits += result.pose.reproj_px > _MISFIT_PX
        distance = float(np.linalg.norm(result.pose.camera_T_pad.translation))
        self.first_distance_m = distance if self.first_distance_m is None else self.first_distance_m
        self.least_distance_m = min(distance, self.least_distance_m or distance)
        if result.t_ns is not None:
            if self._last_pose_ns is not None:
                self.longest_gap_s = max(self.longest_gap_s, (result.t_ns - self._last_pose_ns) * 1e-9)
            self._last_pose_ns = result.t_ns

    def lines(self) -> list[str]:
        """Return the summary as text, a fact a line."""
        said = [f"frames {self.frames}, pad measured in {self.posed}, tags read {self.tags}"]
        if self.first_distance_m is not None and self.least_distance_m is not None:
            size = f"with the pad's D = {self._pad.diameter_m:g} m"
            said.append(f"first seen at {self.first_distance_m:.2f} m, closest {self.least_distance_m:.2f} m, {size}")
            gap = "" if self._last_pose_ns is None else f"longest gap {self.longest_gap_s:.2f} s, "
            said.append(f"{gap}mirror poses rejected {self.flips_rejected}")
        share = ", ".join(f"{state} {count}" for state, count in sorted(self.states.items()))
        said.append(f"track, frames by state: {share or 'none'}")
        if self.assumed:
            said.append(f"camera assumed: {self.assumed}; distances are as good as that")
        return said

    def notes(self) -> list[str]:
        """Return what makes the results less than they seem, one sentence each."""
        said = []
        if self.tags and not self.posed:
            said.append("tags were read, but none gave a pose of the pad; frames.csv says why")
        elif self.frames and not self.posed:
            wanted = ", ".join(f"{tag.family} {tag.id}" for tag in self._pad.tags)
            said.append(f"the pad's tags ({wanted}) were read nowhere; --pad names another, --tags all reads every tag")
        if self.misfits:
            place = f"in {self.misfits} of {self.posed} poses the corners lie over {_MISFIT_PX:g} px from their places"
            said.append(f"{place}; check the pad's layout and the calibration")
        if self.unmeasured:
            width, height = self._size
            said.append(
                f"{self.unmeasured} pictures are not of the camera's {width}x{height}, no pose is measured in them"
            )
        if self.unplaced:
            place = f"the drone's own pose is not known at {self.unplaced} of the {self.posed} poses of the pad"
            said.append(f"{place}; check that --ego covers the recording and is on its clock")
        return said
