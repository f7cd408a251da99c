"""A number that says how good something is: with its interval, what it is made of, and which way is better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from landtool.evaluate.bootstrap import Estimate

Stage = Literal["detection", "tags", "pose", "still_pose", "track", "dehaze", "time", "speed"]
Better = Literal["higher", "lower", "expected", "neither"]
STAGES: tuple[Stage, ...] = ("detection", "tags", "pose", "still_pose", "track", "dehaze", "time", "speed")


@dataclass(frozen=True)
class Metric:
    """One number of an evaluation. Its unit is the end of its name.

    value: None is undefined: there was nothing to tell it from. count: what it is made of (frames, targets, pairs), of:
    of how many there could have been. low, high: 95 % interval by bootstrap, None where none can be told. expected:
    with better = "expected" the value of a perfect filter, as 1 of NEES over its degrees of freedom. slice: the part of
    the data it is about as "distance_m=2-4", "" for all of it. model: the network's name, "" where none took part.
    """

    stage: Stage
    name: str
    value: float | None
    count: int
    of: int
    better: Better
    low: float | None = None
    high: float | None = None
    expected: float | None = None
    slice: str = ""
    model: str = ""

    @property
    def key(self) -> str:
        """What it is called in a baseline: `stage.name`, of a part of the data `stage.name:slice`."""
        return f"{self.stage}.{self.name}" + (f":{self.slice}" if self.slice else "")

    @property
    def said(self) -> str:
        """The value as people read it: `0.953 (0.930 to 0.970), 120 of 126`, or `undefined, 0 of 0`."""
        made_of = f"{self.count} of {self.of}"
        if self.value is None:
            return f"undefined, {made_of}"
        if self.low is None or self.high is None:
            return f"{self.value:.4g}, {made_of}"
        return f"{self.value:.4g} ({self.low:.4g} to {self.high:.4g}), {made_of}"


def metric(
    stage: Stage,
    name: str,
    estimate: Estimate,
    better: Better,
    *,
    of: int | None = None,
    expected: float | None = None,
    slice: str = "",
) -> Metric:
    """Return an estimate as a metric; of: how many values there could have been, those there are by default."""
    return Metric(
        stage,
        name,
        estimate.value,
        estimate.count,
        estimate.count if of is None else of,
        better,
        estimate.low,
        estimate.high,
        expected,
        slice,
    )
