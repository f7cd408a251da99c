"""The gate on the page: what is not the same stands open, the worst first, and the rest is folded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from landtool.report.html.page import Gate, Table, rounded

_HEAD = ("number", "baseline", "now", "interval", "allowed", "worse by", "verdict")
_ORDER = ("worse", "gone", "noise", "better", "new", "same")
_LEVELS = {"worse": "bad", "gone": "bad", "better": "good"}


def gate_table(gate: Mapping[str, Any] | None) -> Gate | None:
    """Return what a gate compared, as metrics.json has it; None where there was none."""
    if gate is None:
        return None
    rows = sorted(gate.get("rows", []), key=lambda row: (_rank(row), -_over(row)))
    same = [row for row in rows if row["verdict"] == "same"]
    changed = [row for row in rows if row["verdict"] != "same"]
    said = "" if changed else f"Nothing left its tolerance: {len(rows)} compared." if rows else "Nothing was compared."
    return Gate(said, _table("Gate: what is not the same", changed), _table(f"The same: {len(same)}", same))


def _rank(row: Mapping[str, Any]) -> int:
    # a verdict that is not known here is not to be overlooked
    return _ORDER.index(row["verdict"]) if row["verdict"] in _ORDER else -1


def _over(row: Mapping[str, Any]) -> float:
    """Return how many times its tolerance a number got worse, to compare numbers of all units by."""
    by, allowed = row.get("by"), row["tolerance"]
    return 0.0 if by is None or not allowed else float(by) / float(allowed)


def _table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table | None:
    if not rows:
        return None
    levels = tuple(_LEVELS.get(str(row["verdict"]), "") for row in rows)
    return Table(title, _HEAD, tuple(_cells(row) for row in rows), levels)


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    low, high, by = row["low"], row["high"], row.get("by")
    interval = "" if low is None or high is None else f"{rounded(low)} to {rounded(high)}"
    values = (_value(row["baseline"]), _value(row["value"]), interval, rounded(row["tolerance"]))
    return (str(row["key"]), *values, rounded(by), str(row["verdict"]))


def _value(value: float | None) -> str:
    return "undefined" if value is None else rounded(value)
