"""Metrics made up for tests."""

from __future__ import annotations

from landtool.evaluate.metric import Better, Metric


def made(
    key: str,
    value: float | None,
    better: Better = "lower",
    low: float | None = None,
    high: float | None = None,
    expected: float | None = None,
) -> Metric:
    """Return a metric of a key as `stage.name:slice`."""
    whole, _, part = key.partition(":")
    stage, _, name = whole.partition(".")
    count = 0 if value is None else 10
    return Metric(stage, name, value, count, count, better, low, high, expected, part)  # type: ignore[arg-type]
