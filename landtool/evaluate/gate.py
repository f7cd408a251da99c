"""Whether an evaluation is worse than the numbers that were kept: each beyond its tolerance, with chance in mind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from landtool.evaluate.baseline import Baseline, by_key
from landtool.evaluate.metric import Metric
from landtool.evaluate.tolerance import Allowance, Tolerance

Verdict = Literal["worse", "better", "same", "gone", "new", "noise"]
FAILS: tuple[Verdict, ...] = ("worse", "gone")
# A limit that is met exactly is kept, whatever the last digit of a binary fraction says
_LAST_DIGITS = 1e-9


@dataclass(frozen=True)
class GateRow:
    """One number beside the one that was kept. low, high: the present 95 % interval.

    tolerance: how much worse it may be. by: how much worse it is, below 0 better; None where one of the two is missing.
    """

    key: str
    baseline: float | None
    value: float | None
    low: float | None
    high: float | None
    tolerance: float | None
    by: float | None
    verdict: Verdict


@dataclass(frozen=True)
class GateResult:
    """All numbers that were compared, in the order of the evaluation, those that are gone last.

    notes: what is odd about the comparison.
    """

    rows: tuple[GateRow, ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether something was compared, nothing got worse and nothing is gone."""
        return self.compared > 0 and not self.of(*FAILS)

    @property
    def compared(self) -> int:
        """How many numbers the baseline has; what was undefined and is so still is none."""
        return sum(row.baseline is not None for row in self.rows)

    def of(self, *verdicts: Verdict) -> tuple[GateRow, ...]:
        """Return the rows of some verdicts."""
        return tuple(row for row in self.rows if row.verdict in verdicts)

    def as_values(self, baseline: str) -> dict[str, Any]:
        """Return it as metrics.json has it; baseline: the name of its file."""
        names = ("key", "baseline", "value", "low", "high", "tolerance", "by", "verdict")
        rows = [{name: getattr(row, name) for name in names} for row in self.rows]
        return {"passed": self.passed, "baseline": baseline, "rows": rows}


def gate(baseline: Baseline, metrics: Sequence[Metric], tolerance: Tolerance, *, same_data: bool) -> GateResult:
    """Compare the metrics of one network with those that were kept.

    same_data: the very same pictures are not another draw of them, so a number beyond its tolerance is worse, whatever
    its interval. On other data it is worse only if the old value also lies outside of the present interval; if it lies
    inside, the verdict is "noise" and passes. Without an interval the tolerance decides alone.

    Raises ValueError for two metrics of one key.
    """
    now, before = by_key(metrics), by_key(baseline.metrics)
    rows = []
    for key in [*now, *(key for key in before if key not in now)]:
        allowance = tolerance.of(key)
        if allowance is not None:
            rows.append(_row(key, before.get(key), now.get(key), allowance, same_data))
    return GateResult(tuple(rows), tuple(tolerance.notes([*now, *before])))


def _row(key: str, before: Metric | None, now: Metric | None, allowance: Allowance, same_data: bool) -> GateRow:
    old = None if before is None else before.value
    value = None if now is None else now.value
    low, high = (None, None) if now is None else (now.low, now.high)
    if now is None or value is None:
        return GateRow(key, old, None, low, high, None, None, "same" if old is None else "gone")
    if old is None:
        return GateRow(key, None, value, low, high, None, None, "new")
    allowed, by = allowance.of(old), _worse_by(now, old, value)
    # an old value in the interval of the new one may be the same thing seen in other pictures
    is_chance = not same_data and low is not None and high is not None and low <= old <= high
    beyond = abs(by) > allowed + _LAST_DIGITS * max(abs(old), abs(value))
    verdict: Verdict = "same"
    if beyond and by > 0.0:
        verdict = "noise" if is_chance else "worse"
    elif beyond and not is_chance:
        verdict = "better"
    return GateRow(key, old, value, low, high, allowed, by, verdict)


def _worse_by(metric: Metric, old: float, value: float) -> float:
    """Return how much worse a value is than the old one, in its own unit."""
    if metric.better == "higher":
        return old - value
    if metric.better == "lower":
        return value - old
    if metric.better == "expected" and metric.expected is not None:
        return _off(value, metric.expected, old) - _off(old, metric.expected, value)
    return 0.0


def _off(value: float, expected: float, other: float) -> float:
    """Return how far a value is from what it should be, in its own unit; `other`: what it is compared with.

    By the factor between them, for half of a covariance is as wrong as twice of it, which a difference does not say:
    e |ln(v / e)|, near e the same as |v - e|. Where there is no factor, as about 0, it is the difference.
    """
    if min(value, expected, other) > 0.0:
        return expected * abs(math.log(value / expected))
    return abs(value - expected)


def gate_lines(result: GateResult) -> list[str]:
    """Return what became of a comparison as people read it: a table of what got worse, the rest in a line each."""
    bad, compared = result.of(*FAILS), result.compared
    if not compared:
        lines = ["gate: failed, nothing was compared: the baseline has none of the numbers"]
    elif bad:
        lines = [f"gate: failed, {len(bad)} of {_numbers(compared)} got worse or are gone", *_table(bad)]
    else:
        lines = [f"gate: passed, none of {_numbers(compared)} got worse"]
    noise = result.of("noise")
    if noise:
        lines += ["  worse, but by no more than other pictures explain:", *_table(noise)]
    better = result.of("better")
    if better:
        names = ", ".join(row.key for row in better[:3]) + (" and others" if len(better) > 3 else "")
        lines.append(f"  {_numbers(len(better))} got better ({names}): keep that with --update-baseline")
    new = result.of("new")
    if new:
        lines.append(f"  {_numbers(len(new))} not in the baseline yet: keep them with --update-baseline")
    return lines


def row_text(row: GateRow) -> str:
    """Return a row as a sentence, as `was 0.953, is 0.812 (0.79 to 0.84), worse by 0.141, allowed are 0.02`."""
    if row.value is None:
        return f"was {_said(row.baseline)}, is undefined" if row.baseline is not None else "undefined"
    is_now = f"is {_said(row.value)}" + (f" ({_interval(row)})" if row.low is not None else "")
    if row.baseline is None or row.by is None:
        return f"{is_now}, new"
    if row.by == 0.0:
        return f"{is_now}, was {_said(row.baseline)}"
    way = "worse" if row.by > 0.0 else "better"
    return f"was {_said(row.baseline)}, {is_now}, {way} by {_said(abs(row.by))}, allowed are {_said(row.tolerance)}"


def _table(rows: Sequence[GateRow]) -> list[str]:
    head = ("number", "baseline", "now", "interval", "allowed", "worse by")
    cells = [
        (
            row.key, _said(row.baseline), "undefined" if row.value is None else _said(row.value),
            _interval(row), _said(row.tolerance), "gone" if row.verdict == "gone" else _said(row.by),
        )
        for row in rows
    ]  # fmt: skip
    wide = [max(len(line[i]) for line in (head, *cells)) for i in range(len(head))]
    lines = [
        "    " + "  ".join(cell.ljust(width) for cell, width in zip(line, wide, strict=True)) for line in (head, *cells)
    ]
    return [line.rstrip() for line in lines]


def _interval(row: GateRow) -> str:
    return "" if row.low is None or row.high is None else f"{_said(row.low)} to {_said(row.high)}"


def _numbers(count: int) -> str:
    return "1 number" if count == 1 else f"{count} numbers"


def _said(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
