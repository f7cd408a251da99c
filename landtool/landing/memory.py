"""What looks for pads, and what is kept of them from frame to frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from landtool.detect.stage import DetectStage
from landtool.geometry import Array, Pose
from landtool.landing.follower import PadFollower
from landtool.landing.measure import PadMeasurer
from landtool.landing.tags import TagLook

LOOK_ROUND_EVERY = 60  # frames, near: for a pad nobody expects
_REFUSED_FOR, _SAME_BOX = 6, 0.1  # frames, and how far its edges may have moved, of its longer side
_MOST_REFUSED = 6


@dataclass
class Tools:
    """What looks.

    detector: None where there is none. body_T_camera: the camera's mount. everywhere: the tags of every whole picture
    are read.
    """

    measurer: PadMeasurer
    tags: TagLook
    detector: DetectStage | None
    body_T_camera: Pose
    everywhere: bool = False


@dataclass
class Memory:
    """What is kept from frame to frame.

    followers: of the living tracks' pads. looked_round: the frame in which the network last saw a whole picture.
    refused: boxes that showed no pad, with their frames. lost_for: frames without a pad.
    """

    followers: dict[int, PadFollower] = field(default_factory=dict)
    looked_round: int = -LOOK_ROUND_EVERY
    refused: list[tuple[int, Array]] = field(default_factory=list)
    lost_for: int = 0

    def follower(self, track_id: int | None) -> PadFollower | None:
        """Return what is known of a track's pad."""
        return None if track_id is None else self.followers.get(track_id)

    def refuse(self, index: int, edges: Array) -> None:
        """Remember for a while a box that showed no pad: a network that is wrong about a thing stays so."""
        self.refused = [(i, box) for i, box in self.refused if index - i < _REFUSED_FOR][-_MOST_REFUSED:]
        self.refused.append((index, edges))

    def was_refused(self, index: int, edges: Array) -> bool:
        """Return whether a box is one of those."""
        wide = float((edges[2:] - edges[:2]).max())
        return any(
            0 < index - i < _REFUSED_FOR and float(np.abs(box - edges).max()) < _SAME_BOX * wide
            for i, box in self.refused
        )
