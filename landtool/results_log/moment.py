"""One frame's result with what is needed to place it in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose
from landtool.types import FrameResult, Reference, Track


@dataclass(frozen=True, eq=False)
class Moment:
    """A result, at a time that is known. heights_m: of the pad in the reference frames, where it was ever measured.

    camera_T_reference: of the tracks' reference frame, None where it is not known.
    """

    t_ns: int
    result: FrameResult
    track: Track | None
    camera_T_reference: Pose | None
    heights_m: dict[Reference, float]

    def places_m(self, track: Track) -> Array:
        """Return where a track's platform is and will be (1 + N, 3), reference frame; empty without its height."""
        height = self.heights_m.get(track.reference)
        if height is None:
            return np.zeros((0, 3))
        flat = [track.state[:2], *(xy_m for _, xy_m in ahead(track))]
        return np.array([[x, y, height] for x, y in flat])


def ahead(track: Track) -> list[tuple[float, Array]]:
    """Return the horizons of a track in s with the places (2,) predicted for them."""
    if track.predictions:
        return [(p.horizon_s, p.xy_m) for p in track.predictions]
    return [(track.horizon_s, track.predicted_xy_m)]
