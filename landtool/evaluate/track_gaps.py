"""How soon a clip's track is confirmed, and when there is none after that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from landtool.evaluate.track_errors import TrackError

NOTABLE_S = 0.2  # a gap so long is felt by a controller that steers by the track


@dataclass(frozen=True)
class ClipTrack:
    """What one clip's track did over time; None is not known for want of a clock.

    confirm_s: from the first frame that shows any of the pad to the first confirmed track, None without one too.
    gaps_s: how long each run of frames without one was, from the last frame before it to the first after it, or to the
    last that shows the pad; where there never was one, all of the time that shows the pad.
    switches: how often the pad's track has another number than before.
    """

    clip: str
    confirm_s: float | None
    gaps_s: tuple[float, ...] | None
    switches: int

    @property
    def longest_gap_s(self) -> float | None:
        """The longest gap, 0 where there was none."""
        return None if self.gaps_s is None else max(self.gaps_s, default=0.0)

    @property
    def notable_gaps(self) -> int | None:
        """How many gaps a controller would feel."""
        # a nanosecond of rounding makes none
        return None if self.gaps_s is None else sum(gap > NOTABLE_S + 1e-9 for gap in self.gaps_s)


def clip_tracks(errors: Sequence[TrackError]) -> list[ClipTrack]:
    """Return what each clip's track did; errors: of all clips, a row a frame in order."""
    return [_clip_track(clip, [e for e in errors if e.clip == clip]) for clip in dict.fromkeys(e.clip for e in errors)]


def _clip_track(clip: str, errors: Sequence[TrackError]) -> ClipTrack:
    numbers = [e.track.track_id for e in errors if e.track is not None and e.state == "confirmed"]
    switches = sum(a != b for a, b in pairwise(numbers))
    seen = [i for i, e in enumerate(errors) if e.seen]
    held = [i for i, e in enumerate(errors) if e.state == "confirmed"]
    if not seen or any(e.t_s is None for e in errors):
        return ClipTrack(clip, None, None, switches)
    t_s = [e.t_s or 0.0 for e in errors]
    if not held:
        return ClipTrack(clip, None, (t_s[seen[-1]] - t_s[seen[0]],), switches)
    gaps = [t_s[b] - t_s[a] for a, b in pairwise(held) if b > a + 1]
    if seen[-1] > held[-1]:
        gaps.append(t_s[seen[-1]] - t_s[held[-1]])
    return ClipTrack(clip, max(t_s[held[0]] - t_s[seen[0]], 0.0), tuple(gaps), switches)
