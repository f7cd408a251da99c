"""A scene: all that is in front of the camera, in a level world with z up and the ground at z = 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.synth.fog import Fog
from landtool.synth.grounds import GroundTexture
from landtool.synth.mesh import Albedo, Mesh, Thing
from landtool.synth.sheet import Sheet


@dataclass(frozen=True)
class Sun:
    """The light of day.

    direction: to the sun, unit, world. sun, sky: linear light, blue first, that a white surface facing it gets from
    the sun, and from the whole sky. softness: penumbra as a share of the caster's height above what it shades; a
    clear day has 0.01, a veiled one 0.1. Under an overcast sky `sun` is all zero.
    """

    direction: tuple[float, float, float]
    sun: Albedo
    sky: Albedo
    softness: float = 0.01


@dataclass(frozen=True, eq=False)
class Mark:
    """Paint, a crack or a stain on the ground: the union of polygons (N, 2), world x and y in metres.

    opacity: how much it covers. wear: share of it that is worn off, in patches. soft_m: width of its edge.
    """

    polygons_m: tuple[Array, ...]
    albedo: Albedo
    opacity: float = 1.0
    wear: float = 0.0
    soft_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Region:
    """Another ground inside a polygon (N, 2), world x and y in metres, as the lawn beside a road."""

    polygon_m: Array
    ground: GroundTexture
    soft_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Decal:
    """A picture on a plane: a sign, lettering, another target.

    picture: (n, n, 4) uint8, sRGB albedo, blue first, and coverage. world_T_plane: its columns run along the plane's
    -y, its rows along -x, as those of the pad. side_m: of the square picture.
    """

    picture: NDArray[np.uint8]
    world_T_plane: Pose
    side_m: float

    @property
    def corners_m(self) -> Array:
        """The square's corners (4, 3) in the world, counter-clockwise from above."""
        h = self.side_m / 2.0
        return self.world_T_plane.apply(np.array([[h, h, 0.0], [-h, h, 0.0], [-h, -h, 0.0], [h, -h, 0.0]]))


# bodies of a carrier that end lower than this above the pad are under it
_PAD_LEVEL_M = 1e-6


def is_under(mesh: Mesh) -> bool:
    """Whether a body of a carrier, in the pad's frame, nowhere rises over the pad's plane."""
    return bool(mesh.points_m[:, 2].max() <= _PAD_LEVEL_M)


@dataclass(frozen=True, eq=False)
class Target:
    """The pad in the scene. carrier: what it lies on, in the pad's frame. above: what lies on the pad, same frame.

    velocity_mps: (3,) of the pad and its carrier in the world.
    """

    pad: PadSpec
    sheet: Sheet
    world_T_pad: Pose
    carrier: Thing = ()
    above: Thing = ()
    velocity_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def on_sheet(self, points_m: Array) -> Array:
        """Return points (N, 3) of the flat pad where the bent sheet has them, in the world."""
        bent = points_m.copy()
        bent[:, 2] += self.sheet.height_m(points_m[:, 0], points_m[:, 1])
        return self.world_T_pad.apply(bent)


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything. things: stand on the ground; shades: throw a shadow but are not in the picture, like the drone.

    phase_m: what is added to a world x and y before they are looked up in a ground, so that no ground is always seen
    at the same place. relief: contrast of the ground's texture, 1 as it was made.
    """

    ground: GroundTexture
    sun: Sun
    target: Target | None = None
    regions: tuple[Region, ...] = ()
    marks: tuple[Mark, ...] = ()
    decals: tuple[Decal, ...] = ()
    things: tuple[Thing, ...] = ()
    shades: tuple[Thing, ...] = ()
    fog: Fog | None = None
    phase_m: tuple[float, float] = (0.0, 0.0)
    relief: float = 1.0
