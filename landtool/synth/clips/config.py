"""What a clip is asked to be, and what of it cannot be done."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from typing import Any, get_args

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Pose
from landtool.io.mcap_build import McapSchema
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.synth.clips.guidance import HEIGHT_END_M, Approach, refuse_steep
from landtool.synth.clips.scenarios import SCENARIOS, ScenarioName

BOUNDS = {
    "duration_s": (0.5, 600.0),
    "height_start_m": (1.0, 60.0),
    "fog_beta": (0.0, 1.0),
    "wind_mps": (0.0, 10.0),
    "hfov_deg": (30.0, 120.0),
}
_SIDE_PX = (64, 4096)
_LOWEST_OCCLUSION_M = 4.0  # room for something between the drone and the platform


@dataclass(frozen=True)
class ClipConfig:
    """All that the bytes of a clip depend on.

    duration_s: of the recording. fps: pictures a second; with `vfr` on the mean, at uneven times and with gaps. size:
    width and height, even numbers of pixels. height_start_m: of the drone over the pad in the first picture. fog_beta:
    extinction a metre, 0 is clear air. wind_mps: mean wind; gusts come with it. hfov_deg: of the drawn camera, unused
    when `camera` gives one, of the same size. body_T_camera: how the camera is mounted. mcap_schema: of an MCAP log.

    Raises UsageError for what cannot be made.
    """

    scenario: ScenarioName = "straight"
    duration_s: float = 6.0
    fps: Fraction = Fraction(30)
    size: tuple[int, int] = (640, 480)
    height_start_m: float = 6.0
    fog_beta: float = 0.0
    wind_mps: float = 2.0
    vfr: bool = False
    seed: int = 0
    hfov_deg: float = 70.0
    pad: PadSpec = field(default_factory=PadSpec)
    camera: Camera | None = None
    body_T_camera: Pose = STRAIGHT_DOWN
    mcap_schema: McapSchema = "ros2"

    def __post_init__(self) -> None:
        if self.scenario not in SCENARIOS:
            raise UsageError(f"unknown scenario '{self.scenario}'", hint=f"known: {', '.join(SCENARIOS)}")
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise UsageError(f"{name} = {value:g} is impossible", hint=f"give {low:g} to {high:g}")
        if not 1 <= self.fps <= 240 or self.fps.numerator > 1_000_000:
            raise UsageError(f"{float(self.fps):g} pictures a second are impossible", hint="give 1 to 240")
        if self.seed < 0:
            raise UsageError(f"seed = {self.seed} is negative", hint="give 0 or more")
        if self.mcap_schema not in get_args(McapSchema):
            raise UsageError(f"unknown schema '{self.mcap_schema}'", hint=f"known: {', '.join(get_args(McapSchema))}")
        if self.pad.ring is None:
            raise UsageError("the pad has no ring to draw a box around", hint="give a pad with [ring]")
        self._refuse_size()
        if self.scenario == "occlusion" and self.height_start_m < _LOWEST_OCCLUSION_M:
            raise UsageError(
                f"from {self.height_start_m:g} m there is no room for an occlusion",
                hint=f"start at {_LOWEST_OCCLUSION_M:g} m or higher",
            )
        refuse_steep(self.approach)

    @property
    def approach(self) -> Approach:
        """What the drone is to do."""
        return Approach(self.duration_s, self.height_start_m, self.scenario == "hover", self.wind_mps)

    def as_values(self) -> Mapping[str, Any]:
        """Return everything as plain values, for the manifest."""
        mount = {
            "translation_m": self.body_T_camera.translation.tolist(),
            "quaternion_wxyz": self.body_T_camera.quaternion_wxyz.tolist(),
        }
        names = ("scenario", "duration_s", "height_start_m", "fog_beta", "wind_mps", "vfr", "seed", "hfov_deg")
        return {
            **{name: getattr(self, name) for name in names},
            "fps": str(self.fps),
            "size": list(self.size),
            "height_end_m": HEIGHT_END_M,
            "mcap_schema": self.mcap_schema,
            "body_T_camera": mount,
            "camera": None if self.camera is None else asdict(self.camera),
            "pad": asdict(self.pad),
        }

    def _refuse_size(self) -> None:
        low, high = _SIDE_PX
        width, height = self.size
        if not all(low <= side <= high and side % 2 == 0 for side in self.size):
            hint = f"give even numbers of {low} to {high} pixels a side"
            raise UsageError(f"a clip of {width}x{height} cannot be made", hint=hint)
        if self.camera and (self.camera.width, self.camera.height) != self.size:
            of = f"{self.camera.width}x{self.camera.height}"
            raise UsageError(f"the camera is of {of} pictures, the clip of {width}x{height}", hint="give its size")
