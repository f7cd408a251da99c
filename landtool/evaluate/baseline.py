"""The numbers an evaluation is compared with: kept in a file that is read by people, too, as it is under review."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from landtool import __version__
from landtool.errors import InputError, UsageError
from landtool.evaluate.metric import Metric
from landtool.evaluate.record import METRIC_COLUMNS, metric_of, metric_rows
from landtool.io.atomic import atomic_path
from landtool.io.local import local_file
from landtool.io.run_record import plain

FORMAT_VERSION = 1
_AGAIN = "make it again with --update-baseline"


@dataclass(frozen=True)
class Baseline:
    """The metrics of one network. dataset, settings: digests of what they were made with. version: of landtool.

    Raises ValueError for two metrics of one key.
    """

    dataset: str
    settings: str
    metrics: tuple[Metric, ...]
    version: str = __version__

    def __post_init__(self) -> None:
        by_key(self.metrics)

    def notes(self, other: Baseline) -> list[str]:
        """Return what a comparison with `other`, made now, has to say first."""
        notes = []
        if self.version != other.version:
            notes.append(f"the baseline is of landtool {self.version}, this is {other.version}")
        if self.dataset != other.dataset:
            notes.append("the baseline is of other data: a number is worse only where its interval says so, too")
        gone = [f"{clip} is in the baseline and was not scored" for clip in self._clips() if clip not in other._clips()]
        notes += gone
        scored = {metric.stage for metric in other.metrics}
        stages = dict.fromkeys(metric.stage for metric in self.metrics if metric.stage not in scored)
        if stages:
            notes.append(f"the baseline has {', '.join(stages)}, which were not scored: keep one for each --stages")
        if self.settings != other.settings:
            notes.append("the baseline was made with other settings")
        return notes

    def _clips(self) -> list[str]:
        """Return the names of the clips that numbers are about."""
        parts = [metric.slice.partition("clip=") for metric in self.metrics]
        return list(dict.fromkeys(name for before, found, name in parts if found and not before))


def by_key(metrics: Sequence[Metric]) -> dict[str, Metric]:
    """Return metrics by their keys. Raises ValueError for two of one key, as those of several networks have."""
    found = {metric.key: metric for metric in metrics}
    if len(found) != len(metrics):
        raise ValueError("two metrics of one key: give those of one network")
    return found


def settings_digest(settings: Mapping[str, Any]) -> str:
    """Return the SHA-256 of settings as plain values; equal ones have the same, in whatever order their keys are."""
    return hashlib.sha256(json.dumps(plain(settings), sort_keys=True).encode()).hexdigest()


def write_baseline(path: Path, baseline: Baseline) -> None:
    """Write a baseline, a metric a line in the order of their keys, so that a change shows what changed.

    It replaces one that is there. Raises UsageError for a file that is something else, OutputError as `atomic_path`
    does, ValueError for a number that is not finite.
    """
    refuse_other_file(path)
    metrics = sorted(baseline.metrics, key=lambda metric: metric.key)
    rows = [dict(zip(METRIC_COLUMNS, row, strict=True)) for row in metric_rows(metrics)]
    head = {
        "format_version": FORMAT_VERSION,
        "landtool": baseline.version,
        "dataset": baseline.dataset,
        "settings": baseline.settings,
    }
    lines = [f" {json.dumps(name)}: {json.dumps(value)}," for name, value in head.items()]
    table = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in rows)
    with atomic_path(path, overwrite=True) as temporary:
        text = "\n".join(["{", *lines, ' "metrics": [', table, " ]", "}"])
        temporary.write_text(f"{text}\n", encoding="utf-8", newline="\n")


def read_baseline(path: Path) -> Baseline:
    """Read a baseline. Raises UsageError when it cannot be opened, InputError for a broken one and another format."""
    try:
        values = json.loads(local_file(path).read_bytes(), parse_constant=_refuse)
    except UsageError as error:
        hint = error.hint if path.exists() else f"{_meant(error.hint)}make one with --update-baseline"
        raise UsageError(error.reason, file=path, hint=hint) from error
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path, hint="check its permissions") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is no baseline: {error}", file=path, hint=_AGAIN) from error
    try:
        return _baseline(values)
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint or _AGAIN) from error


def refuse_other_file(path: Path) -> None:
    """Raise UsageError for a file that is there and no baseline."""
    if not path.is_file():
        return
    try:
        values = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        values = None
    if not isinstance(values, dict) or not {"format_version", "metrics", "settings"} <= values.keys():
        hint = "choose another name, or remove it"
        raise UsageError("is no baseline, and would be replaced by one", file=path, hint=hint)


def _meant(hint: str) -> str:
    """Return the name that was perhaps meant, to put before what else to do."""
    return f"{hint} Else " if hint.endswith("?") else ""


def _refuse(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _baseline(values: Any) -> Baseline:
    if not isinstance(values, dict) or "format_version" not in values:
        raise InputError("is no baseline")
    if values["format_version"] != FORMAT_VERSION:
        raise InputError(f"was written for format {values['format_version']}, this is {FORMAT_VERSION}")
    texts = [values.get(name) for name in ("dataset", "settings", "landtool")]
    rows = values.get("metrics")
    if not all(isinstance(text, str) for text in texts) or not isinstance(rows, list):
        raise InputError("is no baseline: dataset, settings, landtool or metrics is missing")
    dataset, settings, version = map(str, texts)
    metrics = tuple(metric_of(row) for row in rows)
    for metric in metrics:
        numbers = (metric.value, metric.low, metric.high, metric.expected)
        if not all(number is None or math.isfinite(number) for number in numbers):
            raise InputError(f"{metric.key} is not finite")
    try:
        return Baseline(dataset, settings, metrics, version)
    except ValueError as error:
        raise InputError(f"is no baseline: {error}") from error
