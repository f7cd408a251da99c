"""What the plain grounds look like: colours in linear light, blue first, and how the noise mixes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

GroundKind = Literal["asphalt", "concrete", "grass"]
Light = tuple[float, float, float]


@dataclass(frozen=True)
class GroundLook:
    """One kind of ground.

    dark, bright: the two ends the noise mixes. first_cells: values a side of the coarsest octave on a tile of 8.2 m;
    persistence: strength of an octave over the one before; contrast: share of the way between the ends at one
    standard deviation. patchiness: the same for the slow change over tens of metres. slab_m: side of paving slabs.
    """

    dark: Light
    bright: Light
    first_cells: int
    persistence: float
    contrast: float
    patchiness: float
    slab_m: float = 0.0


LOOKS: dict[GroundKind, GroundLook] = {
    "asphalt": GroundLook((0.030, 0.029, 0.028), (0.150, 0.145, 0.140), 8, 0.95, 0.20, 0.05),
    "concrete": GroundLook((0.240, 0.260, 0.270), (0.420, 0.460, 0.480), 4, 0.75, 0.18, 0.05, slab_m=2.048),
    "grass": GroundLook((0.008, 0.040, 0.018), (0.060, 0.210, 0.120), 4, 0.85, 0.22, 0.08),
}
