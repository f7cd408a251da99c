"""What a run says at its end, gathered while the results go by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

import numpy as np

from landtool.camera import Camera
from landtool.io.run_record import StageTime
from landtool.pad import PadSpec
from landtool.types import Frame, FrameResult, LostFrame

# A corner further off than this was not misread by noise
_MISFIT_PX = 3.0
Results = Iterable[tuple[Frame | LostFrame, FrameResult]]


class HazeCount:
    """How many frames were dehazed, and the haze before them on the mean."""

    def __init__(self) -> None:
        self._seen = self._dehazed = 0
        self._sum = 0.0

    def add(self, result: FrameResult) -> None:
        """Take one frame in."""
        if result.haze is not None:
            self._seen += 1
            self._sum += result.haze
            self._dehazed += result.dehazed

    def lines(self) -> list[str]:
        """Return what is to be said of it: nothing where nothing was dehazed."""
        if not self._dehazed:
            return []
        return [f"haze {self._sum / self._seen:.2f} on the mean, {self._dehazed} of {self._seen} frames dehazed"]


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
        self._haze = HazeCount()

    def watch(self, results: Results) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
        """Pass results on and take them in."""
        for frame, result in results:
            self._add(result)
            self.unmeasured += isinstance(frame, Frame) and frame.image.shape[1::-1] != self._size
            yield frame, result

    def _add(self, result: FrameResult) -> None:
        self.frames += 1
        self._haze.add(result)
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

    @property
    def lossy(self) -> bool:
        """Whether pictures were not measured."""
        return self.unmeasured > 0

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
        said += self._haze.lines()
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


class DetectionSummary:
    """Counts over a run of `landtool detect`; memory does not grow with its length.

    network: how it is named. conf: the least score it gives. frames, boxed (with a box), boxes (by label), tags, tagged
    (frames with a tag). unsearched: pictures too small for it.
    """

    def __init__(self, network: str, conf: float, *, reads_tags: bool = True) -> None:
        self._network, self._conf, self._reads_tags = network, conf, reads_tags
        self.frames = self.boxed = self.tags = self.tagged = self.unsearched = 0
        self.boxes: Counter[str] = Counter()
        self.searches: Counter[str] = Counter()
        self._scores: list[float] = []  # of the best box of a frame: least, sum, most
        self._times: dict[str, StageTime] = {}
        self._haze = HazeCount()

    def watch(self, results: Results) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
        """Pass results on and take them in."""
        for frame, result in results:
            self._add(result)
            self.unsearched += isinstance(frame, Frame) and result.search is None
            yield frame, result

    def _add(self, result: FrameResult) -> None:
        self.frames += 1
        self._haze.add(result)
        self.tags += len(result.tags)
        self.tagged += bool(result.tags)
        self.searches.update([result.search] if result.search else [])
        for stage, seconds in result.stage_seconds.items():
            self._times[stage] = self._times.get(stage, StageTime()).add(seconds)
        if not result.detections:
            return
        self.boxed += 1
        self.boxes.update(box.label for box in result.detections)
        best = max(box.score for box in result.detections)
        least, total, most = self._scores or (best, 0.0, best)
        self._scores = [min(least, best), total + best, max(most, best)]

    @property
    def lossy(self) -> bool:
        """Whether pictures were not searched."""
        return self.unsearched > 0

    def lines(self) -> list[str]:
        """Return the summary as text, a fact a line. It says what the network gave, not whether that is right."""
        share = f" ({self.boxed / self.frames:.1%})" if self.frames else ""
        said = [f"network {self._network}", f"frames {self.frames}, with a box {self.boxed}{share}"]
        if self._scores:
            least, total, most = self._scores
            kinds = ", ".join(f"{label} {count}" for label, count in self.boxes.most_common(8))
            more = f" and {len(self.boxes) - 8} more kinds" if len(self.boxes) > 8 else ""
            said.append(f"boxes: {kinds}{more}; best score of a frame {least:.2f} to {most:.2f}")
            said[-1] += f", mean {total / self.boxed:.2f}"
        if self.searches["region"]:
            said.append(f"searched around the expected place in {self.searches['region']} frames")
        if self._reads_tags:
            said.append(f"tags read {self.tags}, in {self.tagged} frames")
        said += self._haze.lines()
        if self._times:
            said.append("ms a frame: " + ", ".join(f"{stage} {t.mean_ms:.1f}" for stage, t in self._times.items()))
        return said

    def notes(self) -> list[str]:
        """Return what makes the results less than they seem, one sentence each."""
        said = []
        if self.frames and not self.boxed:
            said.append(f"no box of a score of {self._conf:g} or more in any frame; a lower --conf shows weaker ones")
        if self.unsearched:
            said.append(f"{self.unsearched} pictures are too small to be searched")
        return said
