"""One track between two steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

from landtool.tracking.config import TrackerConfig
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.mixture import Belief
from landtool.tracking.vertical import Vertical
from landtool.types import TrackState


@dataclass(frozen=True, eq=False)
class Target:
    """What is known of one platform. hits: of the last `confirm_window` frames, whether each measured it.

    born_ns, hit_ns: when it was measured first and last. last: that last measurement, nis: how far it was off.
    """

    track_id: int
    belief: Belief
    height: Vertical
    born_ns: int
    hit_ns: int
    last: PlanarMeasurement
    hits: tuple[bool, ...] = (True,)
    hit_count: int = 1
    confirmed: bool = False
    nis: float | None = None

    @property
    def status(self) -> TrackState:
        """Whether it is believed, and measured now."""
        if not self.confirmed:
            return "tentative"
        return "confirmed" if self.hits[-1] else "coasting"

    def missed(self, window: int) -> Target:
        """Return it after a frame that did not measure it."""
        return replace(self, hits=(*self.hits, False)[-window:], nis=None)

    def may_live(self, config: TrackerConfig) -> bool:
        """Whether it is confirmed or can still be."""
        misses = len(self.hits) - sum(self.hits)
        return self.confirmed or misses <= config.confirm_window - config.confirm_hits

    def succeeds(self, old: Target, config: TrackerConfig) -> bool:
        """Whether it is proven, and was begun after an older one was measured last."""
        proven = self.status == "confirmed" and self.hit_count >= config.replace_hits
        return proven and old.status == "coasting" and self.born_ns > old.hit_ns
