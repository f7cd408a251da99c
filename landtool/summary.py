"""What a run says at its end, gathered while the results go by."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from typing import Any

from landtool.camera import Camera
from landtool.io.run_record import StageTime
from landtool.pad import PadSpec
from landtool.report.facts import facts
from landtool.report.verdict import VerdictLog
from landtool.report.words import verdict_lines
from landtool.target.tone_gauge import ToneEstimate
from landtool.types import Frame, FrameResult, LostFrame

# A corner further off than this was not misread by noise
_MISFIT_PX = 3.0
# A deck in a swell, and the drone's own drift, move a pad by less
_MOST_RISE_M = 1.5
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


class _Heights:
    """What the heights of pad and drone tell of inputs that contradict each other."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf
        self._below = 0

    def add(self, result: FrameResult) -> None:
        """Take in one frame with a pose."""
        if result.pose is None or result.pose.method == "box":
            return
        self._below += result.altitude_m is not None and result.altitude_m < 0.0
        if result.world_T_pad is not None:
            height_m = float(result.world_T_pad.translation[2])
            self._low, self._high = min(self._low, height_m), max(self._high, height_m)

    def notes(self) -> list[str]:
        """Return what is suspicious, one sentence each."""
        said = []
        if self._below:
            said.append(f"frames in which the drone is below the pad it looks down on: {self._below}; check --mount")
        if self._high - self._low > _MOST_RISE_M:
            moved = f"the pad's height in the world changes by {self._high - self._low:.1f} m during the run"
            said.append(f"{moved}; unless it is lifted, check --diameter, --mount, and the clock and place of --ego")
        return said


class Summary:
    """The verdict on a landing, and what makes it less than it seems; memory does not grow with the run's length.

    switch_altitude_m: where far becomes near, None where the stages do not go by altitude. nis_dof: numbers a
    measurement of the filter has. tone: what the pad's edges tell of the pictures' curve. frames, posed (with a pose),
    tags (read, all ids). misfits: poses whose corners lie far from their places. unmeasured: pictures of another size
    than the camera's. unplaced: poses at whose time the drone's own is not known.
    """

    def __init__(
        self,
        camera: Camera,
        pad: PadSpec,
        *,
        switch_altitude_m: float | None = None,
        nis_dof: int = 2,
        tone: Callable[[], ToneEstimate | None] = lambda: None,
    ) -> None:
        self._pad, self._tone = pad, tone
        self._switch_altitude_m = switch_altitude_m
        self.assumed = camera.assumed
        self._size = camera.width, camera.height
        self.unmeasured = self.unplaced = self.misfits = 0
        self.frames = self.posed = self.tags = 0
        # a ring of D pixels, D f / z, spans half the picture's shorter side
        self._log = VerdictLog(2.0 * camera.fx * pad.diameter_m / min(self._size), nis_dof)
        self._haze, self._heights = HazeCount(), _Heights()

    def watch(self, results: Results) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
        """Pass results on and take them in."""
        for frame, result in results:
            self._add(result)
            self.unmeasured += isinstance(frame, Frame) and frame.image.shape[1::-1] != self._size
            yield frame, result

    def _add(self, result: FrameResult) -> None:
        self.frames += 1
        self._haze.add(result)
        self._log.add(result)
        self.tags += len(result.tags)
        if result.pose is None:
            return
        self.posed += 1
        self.unplaced += "own pose is not known" in result.reason
        self._heights.add(result)
        self.misfits += result.pose.method == "tag" and result.pose.reproj_px > _MISFIT_PX

    @property
    def lossy(self) -> bool:
        """Whether pictures were not measured."""
        return self.unmeasured > 0

    def lines(self) -> list[str]:
        """Return the verdict as text, a fact a line."""
        said = verdict_lines(
            self._log.verdict(), diameter_m=self._pad.diameter_m, switch_altitude_m=self._switch_altitude_m
        )
        said += self._haze.lines()
        told = self._tone()
        if told is not None:
            said.append(_of_tone(told))
        if self.assumed:
            said.append(f"camera assumed: {self.assumed}; distances are as good as that")
        return said

    def facts(self, wall_s: float) -> dict[str, Any]:
        """Return the verdict as plain values; wall_s: what the run took."""
        judged = facts(self._log.verdict(), wall_s=wall_s, switch_altitude_m=self._switch_altitude_m)
        told = self._tone()
        tone = None if told is None else asdict(told)
        return judged | {"tone": tone, "lines": self.lines()}

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
        said += self._heights.notes()
        if self.unmeasured:
            width, height = self._size
            said.append(
                f"pictures not of the camera's {width}x{height}, no pose is measured in them: {self.unmeasured}"
            )
        if self.unplaced:
            place = f"the drone's own pose is not known at {self.unplaced} of the {self.posed} poses of the pad"
            said.append(f"{place}; check that --ego covers the recording and is on its clock")
        return said


def _of_tone(told: ToneEstimate) -> str:
    measured = f"gamma {told.gamma:.2f} +- {told.sigma_gamma:.2f}, blur {told.blur_px:.1f} px, of {told.frames} frames"
    advice = "not sure enough to be used"
    if told.is_settled:
        agrees = "which sRGB's curve explains" if told.tone == "srgb" else f"--tone {told.tone} uses it from the start"
        advice = "which is light itself; --tone none uses it from the start" if told.tone == "none" else agrees
    return f"tone curve by the pad's edges: {measured}; {advice}"


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

    def facts(self, wall_s: float) -> None:
        """Return nothing: boxes make no landing to judge."""

    def notes(self) -> list[str]:
        """Return what makes the results less than they seem, one sentence each."""
        said = []
        if self.frames and not self.boxed:
            said.append(f"no box of a score of {self._conf:g} or more in any frame; a lower --conf shows weaker ones")
        if self.unsearched:
            said.append(f"pictures too small to be searched: {self.unsearched}")
        return said
