"""Far and near: which of the two stages a frame belongs to, by the drone's height over the pad.

Far away the network finds the pad and the whole print is registered; near enough for the tag to be read, the tag leads.
The switch has hysteresis, so that a drone that hovers at the threshold stays in one stage.
"""

from __future__ import annotations

import math

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Pose
from landtool.pad import PadSpec
from landtool.types import Stage

READABLE_PX = 14.0  # of a tag's side: from here on nearly every one is read
_HYSTERESIS = 0.1  # of the switch altitude, on both sides


def readable_altitude_m(camera: Camera, pad: PadSpec) -> float | None:
    """Return the height from which down a level pad's largest tag is readable straight below; None without a tag."""
    if not pad.tags:
        return None
    side_m = max(pad.tag_size_m(tag) for tag in pad.tags)
    return math.sqrt(camera.fx * camera.fy) * side_m / READABLE_PX


def altitude_m(body_T_camera: Pose, camera_T_pad: Pose, world_T_body: Pose | None) -> float:
    """Return how high the drone is above a pad: along the world's z, and while that is unknown along its own."""
    # the vector from the pad to the body, in the body frame, turned upright where the attitude is known
    away = -body_T_camera.apply(camera_T_pad.translation)
    return float(away[2] if world_T_body is None else (world_T_body.rotation @ away)[2])


class StageSwitch:
    """Tells the stage frame by frame. altitude_m: of the switch; None: always far. Raises UsageError if not positive.

    note: why the stage changed with the last frame, or "".
    """

    def __init__(self, altitude_m: float | None) -> None:
        if altitude_m is not None and not 0.0 < altitude_m < math.inf:
            raise UsageError(f"a switch altitude of {altitude_m:g} m is impossible", hint="give a height above zero")
        self.altitude_m = altitude_m
        self.stage: Stage = "far"
        self.note = ""
        self._began = False

    def at(self, altitude_m: float | None) -> Stage:
        """Return the stage at a height over the pad; where it is unknown the last one goes on."""
        self.note = ""
        if altitude_m is None or self.altitude_m is None:
            return self.stage
        # in between the last stage goes on; the first frame has none
        margin = _HYSTERESIS * self.altitude_m if self._began else 0.0
        new: Stage = self.stage
        if altitude_m < self.altitude_m - margin:
            new = "near"
        elif altitude_m > self.altitude_m + margin:
            new = "far"
        if self._began and new != self.stage:
            side = "below" if new == "near" else "above"
            self.note = f"{new} stage: {altitude_m:.1f} m high, {side} the switch at {self.altitude_m:.1f} m"
        self.stage, self._began = new, True
        return new
