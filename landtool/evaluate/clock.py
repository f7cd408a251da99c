"""The clock of a run against that of the truth: rate, offset and jitter of frames of the same numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landtool.evaluate.bootstrap import UNDEFINED, Estimate
from landtool.evaluate.clip_truth import ClipTruth
from landtool.evaluate.metric import Metric, metric
from landtool.types import FrameResult

_FEWEST = 3  # frames, for a rate and what is left of it


@dataclass(frozen=True)
class ClockCheck:
    """How the times of one clip agree with its truth's; None where one of them has no clock, or no numbers to match.

    rate_ppm: how much more time the run says has passed than the truth. offset_s: run minus truth at the truth's first
    frame. jitter_ms: RMS of what rate and offset leave. frames_without_truth, truth_without_frames: by their numbers.
    frames: of the run. matched: frames with both times.
    """

    clip: str
    frames: int
    matched: int
    frames_without_truth: int
    truth_without_frames: int
    rate_ppm: float | None = None
    offset_s: float | None = None
    jitter_ms: float | None = None


def check_clock(clip: str, results: Sequence[FrameResult], truth: ClipTruth) -> ClockCheck:
    """Compare the times of a run's frames with the truth's; another number of frames than the truth's is counted."""
    rows = [truth.row(result.index, result.t_ns) for result in results]
    met = {row for row in rows if row is not None}
    counts = len(results), sum(row is None for row in rows), len(truth.frames) - len(met)
    times = [
        (result.t_ns, truth.frames[row].t_ns) for result, row in zip(results, rows, strict=True) if row is not None
    ]
    both = [(ours, true) for ours, true in times if ours is not None and true is not None]
    known = ClockCheck(clip, counts[0], len(both), counts[1], counts[2])
    if not truth.numbered or len(both) < _FEWEST:  # without numbers frames were matched by their very times
        return known
    ours, true = np.array(both, np.int64).T
    start = truth.start_ns or 0
    rate_ppm, offset_s, jitter_ms = _fitted(ours - start, true - start)
    return ClockCheck(*(clip, counts[0], len(both), counts[1], counts[2]), rate_ppm, offset_s, jitter_ms)


def _fitted(ours_ns: NDArray[np.int64], true_ns: NDArray[np.int64]) -> tuple[float, float, float]:
    """Return rate, offset and jitter of times (N,) since the truth's first frame."""
    order = np.argsort(true_ns, kind="stable")
    ours, true = ours_ns[order] * 1e-9, true_ns[order] * 1e-9
    # Theil's slope over pairs half the recording apart, as near ones say the least: a few wrong times move it little
    # (H. Theil, "A rank-invariant method of linear and polynomial regression analysis", 1950)
    half = len(true) // 2
    slope = float(np.median((ours[half:] - ours[: len(ours) - half]) / (true[half:] - true[: len(true) - half])))
    offset = float(np.median(ours - slope * true))
    left = ours - slope * true - offset
    return 1e6 * (slope - 1.0), offset, 1e3 * float(np.sqrt(np.mean(left**2)))


def clock_metrics(checks: Sequence[ClockCheck]) -> list[Metric]:
    """Return the metrics of time: of all clips the worst, of each clip as a part its own; the size, never a sign.

    rate_ppm, offset_s and jitter_ms as in ClockCheck; frames_without_truth and truth_without_frames are sums.
    """
    metrics = list(_metrics(checks, ""))
    for check in checks:
        metrics += [m for m in _metrics([check], f"clip={'_'.join(check.clip.split())}") if m.value is not None]
    return metrics


def _metrics(checks: Sequence[ClockCheck], part: str) -> Iterator[Metric]:
    frames, matched = sum(c.frames for c in checks), sum(c.matched for c in checks)
    for name, of in _FITTED.items():
        values = [abs(value) for check in checks if (value := of(check)) is not None]
        estimate = Estimate(max(values), None, None, matched) if values else UNDEFINED
        yield metric("time", name, estimate, "lower", of=frames, slice=part)
    for name, counted in _COUNTED.items():
        estimate = Estimate(float(sum(map(counted, checks))), None, None, frames) if checks else UNDEFINED
        yield metric("time", name, estimate, "lower", slice=part)


_FITTED: dict[str, Callable[[ClockCheck], float | None]] = {
    "rate_ppm": lambda check: check.rate_ppm,
    "offset_s": lambda check: check.offset_s,
    "jitter_ms": lambda check: check.jitter_ms,
}
_COUNTED: dict[str, Callable[[ClockCheck], int]] = {
    "frames_without_truth": lambda check: check.frames_without_truth,
    "truth_without_frames": lambda check: check.truth_without_frames,
}
