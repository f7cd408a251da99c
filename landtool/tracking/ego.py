"""The drone's own motion, so that the platform can be tracked in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landtool.errors import UsageError
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.poses import EgoPoses


@dataclass(frozen=True)
class EgoTrajectory:
    """`world_T_body` at any time between measured poses.

    max_gap_s: no pose is made up between two stamps further apart. With an acceleration a, a straight line over a gap
    T is wrong by a T^2 / 8 at most: 3 cm for 1 m/s^2 and half a second. Raises UsageError when it is not positive.
    """

    poses: EgoPoses
    max_gap_s: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.max_gap_s < np.inf:
            raise UsageError(f"max_gap_s = {self.max_gap_s:g} is not a positive time")

    def at(self, t_ns: int) -> Pose | None:
        """Return `world_T_body` at a time; None before the first pose, after the last, and inside a gap."""
        place = self._place(t_ns)
        if place is None:
            return None
        before, part = place
        if part == 0.0:
            return self._pose(before)
        return _between(self._pose(before), self._pose(before + 1), part)

    def noise_share(self, t_ns: int) -> float:
        """Return the variance of the pose at a time over that of a measured one; 1 where no pose is known."""
        place = self._place(t_ns)
        # of (1 - u) a + u b, the noise of a and b independent
        return 1.0 if place is None else (1.0 - place[1]) ** 2 + place[1] ** 2

    @property
    def span_ns(self) -> tuple[int, int]:
        """The times of the first pose and of the last."""
        return int(self.poses.t_ns[0]), int(self.poses.t_ns[-1])

    def _place(self, t_ns: int) -> tuple[int, float] | None:
        """Return the last pose no later than a time, and the part of the way to the next; None where none is known."""
        stamps = self.poses.t_ns
        after = int(np.searchsorted(stamps, t_ns))
        if after < len(stamps) and stamps[after] == t_ns:
            return after, 0.0
        if after in (0, len(stamps)):
            return None
        start_ns, end_ns = int(stamps[after - 1]), int(stamps[after])
        if end_ns - start_ns > self.max_gap_s * 1e9:
            return None
        return after - 1, (t_ns - start_ns) / (end_ns - start_ns)

    def _pose(self, index: int) -> Pose:
        return Pose.from_quaternion(self.poses.positions_m[index], self.poses.quaternions_wxyz[index])


def _between(world_T_a: Pose, world_T_b: Pose, part: float) -> Pose:
    """Return the pose a `part` of the way from a to b: places on a line, turning about one axis at one speed."""
    # slerp: R(u) = Ra exp(u log(Ra^T Rb))
    turn = Pose(world_T_a.rotation.T @ world_T_b.rotation, np.zeros(3)).rotvec
    rotation = world_T_a.rotation @ rotation_from_rotvec(part * turn)
    return Pose(rotation, (1.0 - part) * world_T_a.translation + part * world_T_b.translation)
