"""How a recording's times follow each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

GAP_FACTOR = 2.0  # an interval of so many medians or more is a gap: at least one frame is missing there
# Containers round times to a millisecond at worst, so intervals that differ by so much may be of one rate
_ROUNDING_NS = 1_000_000
_STEADY_PART = 0.05  # of the median
_STEADY_SHARE = 0.01  # of the intervals that may differ by more


@dataclass(frozen=True)
class Gap:
    """An interval without a frame. after_frame: 0-based, the last one before it; t_ns: that frame's time."""

    after_frame: int
    t_ns: int
    length_ns: int


@dataclass(frozen=True)
class Clock:
    """The times of a recording.

    source: what gave them. times: how many. first_ns, last_ns: the smallest and the largest. Intervals are those that
    go forward; None where there is none. mean_hz: over the whole span. rate_is_variable: more than 1 % of the
    intervals, gaps left out, differ from the median by more than 5 % and more than the 1 ms a container may round.
    repeated, backward: times equal to or before the one before; backward is None where frames are stored in another
    order than they are shown in, so that only decoding tells.
    """

    source: str
    times: int
    first_ns: int
    last_ns: int
    mean_hz: float | None
    median_interval_ns: int | None
    shortest_interval_ns: int | None
    longest_interval_ns: int | None
    rate_is_variable: bool
    gaps: tuple[Gap, ...]
    repeated: int
    backward: int | None

    @property
    def span_ns(self) -> int:
        """From the first to the last time."""
        return self.last_ns - self.first_ns


def measure_clock(times_ns: Sequence[int], source: str, *, in_order: bool = True) -> Clock | None:
    """Measure times in the order of the frames; None without any. in_order: False when the times had to be sorted."""
    if not len(times_ns):
        return None
    times = np.asarray(times_ns, dtype=np.int64)
    steps = np.diff(times)
    forward = steps[steps > 0]
    median = round(float(np.median(forward))) if len(forward) else None
    first, last = int(times.min()), int(times.max())
    gaps = np.flatnonzero(steps >= _gap_ns(median)) if median else ()
    return Clock(
        source=source,
        times=len(times),
        first_ns=first,
        last_ns=last,
        mean_hz=(len(times) - 1) * 1e9 / (last - first) if last > first else None,
        median_interval_ns=median,
        shortest_interval_ns=int(forward.min()) if median else None,
        longest_interval_ns=int(forward.max()) if median else None,
        rate_is_variable=bool(median) and _is_variable(forward, median or 0),
        gaps=tuple(Gap(int(at), int(times[at]), int(steps[at])) for at in gaps),
        repeated=int((steps == 0).sum()),
        backward=int((steps < 0).sum()) if in_order else None,
    )


def _gap_ns(median_ns: int) -> float:
    """Return the shortest gap; one lost frame makes twice the median, give or take what times are rounded by."""
    return GAP_FACTOR * median_ns - min(_ROUNDING_NS, median_ns / 4)


def _is_variable(forward: np.ndarray[tuple[int], np.dtype[np.int64]], median_ns: int) -> bool:
    usual = forward[forward < _gap_ns(median_ns)]
    off = np.abs(usual - median_ns) > max(_ROUNDING_NS, _STEADY_PART * median_ns)
    return bool(off.mean() > _STEADY_SHARE)
