"""What `landtool track` still needs for an input, and from how far a pad's tags can be read."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from landtool.camera import Camera
from landtool.families import tag_family
from landtool.pad import PadSpec, PadTag

READABLE_PX = 13.0  # side of a tag36h11's border that is still read (docs/conventions.md); the other families need less


@dataclass(frozen=True)
class Need:
    """An option to add, as typed, and why."""

    option: str
    why: str


@dataclass(frozen=True)
class TrackAdvice:
    """How to track an input. command: ready to run once its capitals are filled in; empty when nothing would help.

    needs: what the command cannot do without. choices: what it could have besides. obstacle: why it cannot be tracked.
    """

    command: str
    needs: tuple[Need, ...] = ()
    choices: tuple[Need, ...] = ()
    obstacle: str = ""


def track_command(recording: Path | str, given: Sequence[str], needs: Sequence[Need]) -> str:
    """Return the command line. recording: a path, or a placeholder as text. given: options already chosen."""
    words = [recording if isinstance(recording, str) else shlex.quote(str(recording)), *given]
    return " ".join(["landtool track", *words, *(need.option for need in needs)])


@dataclass(frozen=True)
class TagRange:
    """Distances along the optical axis between which a tag facing the camera can be read, metres.

    nearest_m: the tag, with its white border, fills the picture's shorter side. farthest_m: its side is `READABLE_PX`.
    """

    family: str
    tag_id: int
    nearest_m: float
    farthest_m: float


def tag_range(pad: PadSpec, tag: PadTag, camera: Camera) -> TagRange:
    """Return where a camera can read a tag of a pad, in the middle of the picture and without tilt."""
    family, size_m = tag_family(tag.family), pad.tag_size_m(tag)
    # pinhole: side in px = f size / distance
    printed_m = size_m * family.total_modules / family.border_modules
    nearest_m = max(camera.fx * printed_m / camera.width, camera.fy * printed_m / camera.height)
    return TagRange(tag.family, tag.id, nearest_m, min(camera.fx, camera.fy) * size_m / READABLE_PX)
