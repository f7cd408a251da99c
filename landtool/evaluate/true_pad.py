"""The pad as it truly is in a picture: of a clip's frame or of a still."""

from __future__ import annotations

from dataclasses import dataclass

from landtool.camera import Camera
from landtool.evaluate.facts import Facts
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec

WIDE_PX, VISIBLE = 24.0, 0.5  # from which on the whole print is to be measured


@dataclass(frozen=True, eq=False)
class TruePad:
    """What is true of the pad in one picture, None for what is unknown.

    visible_fraction: share of it in the picture and not hidden. hidden: share of the part in the picture that something
    hides. tag_corners_px: (4, 2) of the pad's first tag, where the picture shows them.
    """

    camera: Camera
    camera_T_pad: Pose
    facts: Facts
    visible_fraction: float | None = None
    hidden: float | None = None
    tag_corners_px: Array | None = None

    @property
    def centre_shown(self) -> bool:
        """Whether the pad's centre is inside the picture's edges."""
        u, v = self.camera.project(self.camera_T_pad.translation)[0]
        return bool(-0.5 <= u <= self.camera.width - 0.5 and -0.5 <= v <= self.camera.height - 0.5)

    @property
    def visible(self) -> bool:
        """Whether any of it is seen; where nobody says, whether its centre is in the picture."""
        return self.centre_shown if self.visible_fraction is None else self.visible_fraction > 0.0

    def size_px(self, pad: PadSpec) -> float:
        """Return the diameter it would have if it faced the camera where it is; not cut by the picture's edges."""
        distance_m = float((self.camera_T_pad.translation**2).sum() ** 0.5)
        return self.camera.fx * pad.diameter_m / distance_m

    def measurable(self, pad: PadSpec) -> bool:
        """Whether a pose of six degrees of freedom is to be expected of the picture: wide enough, half of it seen."""
        shown = self.centre_shown if self.visible_fraction is None else self.visible_fraction > VISIBLE
        return shown and self.size_px(pad) >= WIDE_PX
