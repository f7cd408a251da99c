"""When the pad was not measured, for how long and where."""

from __future__ import annotations

from dataclasses import dataclass, replace

NOTABLE_S = 0.2  # a gap so long is felt by a controller that steers by the track


@dataclass(frozen=True)
class Gap:
    """Between two measurements, or after the last one.

    seconds: None without a clock. frames: between them. distance_m: of the pad before it. start_s: when it began.
    bridged: a proven track foretold the place in all of its frames.
    """

    seconds: float | None
    frames: int
    distance_m: float
    start_s: float | None
    bridged: bool

    @property
    def notable(self) -> bool:
        """Whether pictures went by without the pad for so long that it matters; without a clock nobody knows."""
        # a nanosecond of rounding makes none
        return self.frames > 0 and self.seconds is not None and self.seconds > NOTABLE_S + 1e-9

    @property
    def length(self) -> tuple[bool, float, int]:
        """What gaps are compared by: where no picture went by it was the recording that had a gap."""
        return self.frames > 0, self.seconds or 0.0, self.frames

    @property
    def lost(self) -> bool:
        """Whether nothing was known of the platform for a time that matters."""
        return self.notable and not self.bridged


class GapLog:
    """Finds the gaps of one recording.

    longest: the longest gap that ended, None before a second measurement. lost: the longest in which nothing was known.
    notable: how many mattered. open: since the last measurement, None before the first.
    """

    def __init__(self) -> None:
        self.longest: Gap | None = None
        self.lost: Gap | None = None
        self.notable = 0
        self.open: Gap | None = None

    def add(self, t_s: float | None, distance_m: float | None, *, tracked: bool) -> None:
        """Take one frame in. distance_m: None where the pad was not measured. tracked: a proven track lives."""
        if self.open is not None:
            self.open = self._longer(self.open, t_s, measured=distance_m is not None, tracked=tracked)
        if distance_m is None:
            return
        if self.open is not None:
            self.notable += self.open.notable
            if self.longest is None or self.open.length > self.longest.length:
                self.longest = self.open
            if self.open.lost and (self.lost is None or self.open.length > self.lost.length):
                self.lost = self.open
        self.open = Gap(None if t_s is None else 0.0, 0, distance_m, t_s, bridged=True)

    def _longer(self, gap: Gap, t_s: float | None, *, measured: bool, tracked: bool) -> Gap:
        # a clock that steps back makes no gap
        seconds = gap.seconds if t_s is None or gap.start_s is None else max(0.0, t_s - gap.start_s)
        if measured:
            return replace(gap, seconds=seconds)
        return replace(gap, seconds=seconds, frames=gap.frames + 1, bridged=gap.bridged and tracked)
