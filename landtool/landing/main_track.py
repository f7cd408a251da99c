"""Which of several pads is the one that is landed on: the first that was confirmed, as long as its track lives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from landtool.geometry import Array
from landtool.types import PadPose, PoseMethod, Track

_RANK: dict[PoseMethod, int] = {"tag": 0, "target": 1, "box": 2}


class MainTrack:
    """Remembers the track of the pad that is landed on."""

    def __init__(self) -> None:
        self.track_id: int | None = None
        self._last: Array | None = None

    def of(
        self,
        poses: Sequence[PadPose],
        looked_for: Sequence[int | None],
        taken: Sequence[int | None],
        tracks: Sequence[Track],
    ) -> tuple[PadPose | None, tuple[PadPose, ...]]:
        """Return the main pad's pose, None where it was not measured, and the poses of the others.

        looked_for: of every pose the track whose expectation led to it. taken: the track it went to. tracks: those that
        live, oldest first. Until one is confirmed, and where there are no tracks, the pose of the best method is the
        main one.
        """
        proven = [track.track_id for track in tracks if track.status != "tentative"]
        if self.track_id not in proven:
            self.track_id = proven[0] if proven else None
        if self.track_id is not None and self.track_id in taken:
            main = list(taken).index(self.track_id)
        elif self.track_id is not None and self.track_id in looked_for:  # refused by the filter, seen all the same
            main = list(looked_for).index(self.track_id)
        elif self.track_id is not None and poses and self._last is not None and not any(t is not None for t in taken):
            # no track can take them, as where the drone's own pose is not known: the one next to where it was
            last = self._last
            main = min(range(len(poses)), key=lambda i: float(np.linalg.norm(poses[i].camera_T_pad.translation - last)))
        elif self.track_id is not None:
            return None, tuple(poses)
        elif poses:
            main = min(range(len(poses)), key=lambda i: _RANK[poses[i].method])
        else:
            return None, ()
        self._last = poses[main].camera_T_pad.translation
        return poses[main], tuple(pose for i, pose in enumerate(poses) if i != main)
