"""Rows of one kind as arrays, and metrics over all of them and over the parts of the data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landtool.evaluate.facts import parts
from landtool.evaluate.metric import Metric
from landtool.geometry import Array

Chosen = NDArray[np.bool_]
# metrics of the chosen rows (N,), for a slice of that name
Judge = Callable[[Chosen, str], Iterable[Metric]]


def column(rows: Sequence[Any], name: str) -> Array:
    """Return an attribute of every row as (N,) float64; NaN where it is None."""
    return np.array([np.nan if (value := getattr(row, name)) is None else value for row in rows], np.float64)


def flags(rows: Sequence[Any], name: str) -> Chosen:
    """Return an attribute of every row as (N,) bool; what is unknown is not so."""
    return np.array([getattr(row, name) is True for row in rows], np.bool_)


def over_parts(judge: Judge, rows: Sequence[Any], facts: Sequence[str], names: Sequence[str] = ()) -> list[Metric]:
    """Return the metrics of all rows, which always exist, and those that something is known of in each part.

    facts: attributes that `parts` has bounds for. names: attributes whose every value is a part, as `stage=far`.
    """
    metrics = list(judge(np.ones(len(rows), np.bool_), ""))
    for fact in facts:
        for name, inside in parts(fact, [getattr(row, fact) for row in rows]):
            metrics += _known(judge(inside, name))
    for attribute in names:
        values = [getattr(row, attribute) for row in rows]
        for value in dict.fromkeys(value for value in values if value is not None):
            name = f"{attribute}={'_'.join(str(value).split())}"
            metrics += _known(judge(np.array([v == value for v in values], np.bool_), name))
    return metrics


def _known(metrics: Iterable[Metric]) -> list[Metric]:
    return [metric for metric in metrics if metric.value is not None]
