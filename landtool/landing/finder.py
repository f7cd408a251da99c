"""Finds and measures every pad in a frame, and remembers whose is whose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from landtool.detect.stage import DetectStage
from landtool.geometry import Pose
from landtool.landing.found import Found
from landtool.landing.look import Look
from landtool.landing.measure import PadMeasurer
from landtool.landing.memory import Memory, Tools
from landtool.landing.tags import TagLook
from landtool.target.tone_gauge import ToneGauge
from landtool.tracking.platform import ExpectedPad
from landtool.types import Frame, Image, Stage


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
        self._tools = Tools(measurer, tags, detector, body_T_camera, everywhere)
        self._memory, self._gauge = Memory(), gauge

    def find(
        self,
        frame: Frame,
        clear: Callable[[], Frame],
        stage: Stage,
        expected: Sequence[ExpectedPad],
        world_T_body: Pose | None,
    ) -> Found:
        """Look at one frame. clear: gives it without its haze. expected: where the tracks' pads should be."""
        found = Look(self._tools, self._memory, frame, clear, stage, expected, world_T_body).run()
        self._memory.lost_for = 0 if found.pads else self._memory.lost_for + 1
        if self._gauge is not None and found.pads and found.pads[0].pose.method != "box":
            self._gauge_tone(self._gauge, frame.image, found.pads[0].pose.camera_T_pad)
        return found

    def _gauge_tone(self, gauge: ToneGauge, image: Image, camera_T_pad: Pose) -> None:
        gauge.add(image, camera_T_pad)
        told = gauge.estimate()
        tools = self._tools
        if told is not None and told.is_settled and told.tone != tools.measurer.tone:
            tools.measurer = replace(tools.measurer, tone=told.tone)
            tools.tags.use_tone(told.tone)

    def keep(self, found: Found, taken: Sequence[int | None], living: Sequence[int]) -> None:
        """Take in which track each found pad went to, None for none, and which tracks live."""
        now = {track_id: pad.follower for pad, track_id in zip(found.pads, taken, strict=True) if track_id is not None}
        known = {**self._memory.followers, **now}
        self._memory.followers = {track_id: follower for track_id, follower in known.items() if track_id in living}

    @property
    def measurer(self) -> PadMeasurer:
        """What measures the pads, by the tone curve as it is known now."""
        return self._tools.measurer
