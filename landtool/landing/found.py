"""What a frame shows of pads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from landtool.landing.follower import PadFollower
from landtool.types import Detection, PadPose, Search, TagObservation


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
