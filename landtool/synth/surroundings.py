"""What is around the pad, drawn at random: the ground, what is painted on it, other bodies, and signs like the pad."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.pad import PadSpec
from landtool.synth import markings
from landtool.synth.domain import Domain, chance
from landtool.synth.grounds import GROUND_SEED, KINDS, VARIANTS, GroundTexture, ground, photo_ground
from landtool.synth.mesh import Thing, box, place
from landtool.synth.scene import Decal, Mark, Region
from landtool.synth.signs import FLAT, PAINTED, random_sign
from landtool.synth.things import CARRIERS, PROPS
from landtool.synth.view import View

PHOTOGRAPH = "photograph"
_PHOTOS_KEPT = 6
_PHOTO_SCALE = (math.log(0.6), math.log(12.0))
# grounds on which a driver's markings lie, and how often each layout is drawn there
_LAYOUTS = {
    "asphalt": ((markings.road, 0.4), (markings.parking_lot, 0.5), (markings.crossing, 0.4)),
    "concrete": ((markings.apron, 0.6), (markings.parking_lot, 0.3)),
    "cobbles": ((markings.manhole, 0.3), (markings.parking_lot, 0.2)),
    "tiles": ((markings.manhole, 0.3),),
    "brick": ((markings.parking_lot, 0.2),),
}
_OFTEN = {"asphalt": 2.0, "concrete": 1.6, "gravel": 1.3, "grass": 1.3, "water": 0.5, "snow": 0.5, "sand": 0.7}
_TINT = 0.12


@dataclass(frozen=True, eq=False)
class Surroundings:
    """kind: name of the ground. The rest as in `Scene`; signs: names of those in the scene."""

    kind: str
    ground: GroundTexture
    marks: tuple[Mark, ...] = ()
    regions: tuple[Region, ...] = ()
    things: tuple[Thing, ...] = ()
    decals: tuple[Decal, ...] = ()
    signs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Lot:
    """Where things may be put. view: the camera. keep_m: radius about the origin that stays free. scale: of all."""

    view: View
    keep_m: float
    scale: float


def random_ground(
    domain: Domain, photos: Sequence[Path], scale: float, rng: np.random.Generator
) -> tuple[str, GroundTexture]:
    """Return a ground and its name, a drawn kind or a photograph; everything on it is `scale` times as large."""
    if photos and chance(rng, domain.photographs):
        texture = _photo(photos[int(rng.integers(len(photos)))])
        # from a handful of gravel to a field seen from a drone: nobody knows how wide a photograph is
        tile_m = texture.tile_m * float(np.exp(rng.uniform(*_PHOTO_SCALE)))
        kind = PHOTOGRAPH
    else:
        kind = KINDS[int(rng.choice(len(KINDS), p=_shares()))]
        texture = ground(kind, int(rng.integers(VARIANTS)))
        tile_m = texture.tile_m * float(rng.uniform(0.8, 1.3))
    blue, green, red = (float(t) for t in np.exp(rng.normal(0.0, _TINT) + rng.normal(0.0, 0.03, 3)))
    grain = texture.grain_tile_m * scale
    return kind, replace(texture, tile_m=tile_m * scale, grain_tile_m=grain, tint=(blue, green, red))


def furnish(
    domain: Domain,
    pad: PadSpec,
    lot: Lot,
    floor: tuple[str, GroundTexture],
    sign_count: int,
    rng: np.random.Generator,
) -> Surroundings:
    """Return the surroundings of one picture on the given ground."""
    kind, texture = floor
    marks, regions, things = _layout(kind, lot.scale, rng)
    count = int(min(rng.poisson(domain.things), 14))
    bodies = [_prop(lot, rng) for _ in range(count)]
    signs = [_sign(pad, lot, rng) for _ in range(sign_count)]
    stands = [thing for _, _, thing in signs if thing]
    return Surroundings(
        kind,
        texture,
        marks,
        regions,
        tuple(t for t in (*things, *bodies, *stands) if t),
        tuple(decal for _, decal, _ in signs),
        tuple(name for name, _, _ in signs),
    )


def _layout(
    kind: str, scale: float, rng: np.random.Generator
) -> tuple[tuple[Mark, ...], tuple[Region, ...], tuple[Thing, ...]]:
    """Return markings, other grounds and kerbs of a street or yard, turned and moved as a whole."""
    marks: list[Mark] = []
    regions: list[Region] = []
    things: list[Thing] = []
    layouts = [make for make, share in _LAYOUTS.get(kind, ()) if rng.random() < share][:1]
    if kind not in ("water", "snow", "grass", PHOTOGRAPH):
        layouts += [make for make in (markings.stains, markings.cracks) if rng.random() < 0.5]
    turn, shift = float(rng.uniform(-math.pi, math.pi)), rng.uniform(-4.0, 4.0, 2)
    world_T_layout = Pose.from_rotvec([*shift, 0.0], [0.0, 0.0, turn])
    for make in layouts:
        layout = make(rng)
        marks += [
            replace(
                m, polygons_m=tuple(_moved(p, world_T_layout, scale) for p in m.polygons_m), soft_m=m.soft_m * scale
            )
            for m in layout.marks
        ]
        for polygon, name in layout.regions:
            other = ground(name, int(rng.integers(VARIANTS)))
            other = replace(other, tile_m=other.tile_m * scale, grain_tile_m=other.grain_tile_m * scale)
            regions.append(Region(_moved(polygon, world_T_layout, scale), other, 0.06 * scale))
        things += [place(tuple(mesh.stretched(scale) for mesh in thing), world_T_layout) for thing in layout.things]
    return tuple(marks), tuple(regions), tuple(things)


def _moved(polygon: Array, world_T_layout: Pose, scale: float) -> Array:
    flat = np.column_stack([polygon * scale, np.zeros(len(polygon))])
    return world_T_layout.apply(flat)[:, :2]


def _prop(lot: Lot, rng: np.random.Generator) -> Thing:
    """Return a body somewhere in the picture, or nothing when there is no room."""
    names = tuple(PROPS)
    make = PROPS[names[int(rng.integers(len(names)))]]
    spot = _spot(lot, lot.keep_m, rng)
    if spot is None:  # most of the time that a body takes is its making
        return ()
    thing = tuple(mesh.stretched(lot.scale) for mesh in make(rng))
    reach = max(float(np.abs(mesh.points_m[:, :2]).max()) for mesh in thing)
    return place(thing, spot) if np.hypot(*spot.translation[:2]) > reach + lot.keep_m else ()


def _spot(lot: Lot, keep_m: float, rng: np.random.Generator) -> Pose | None:
    """Return a place on the ground that the camera sees, at least keep_m from the origin, turned at random."""
    camera, eye = lot.view.camera, lot.view.world_T_camera
    turn = float(rng.uniform(-math.pi, math.pi))
    pixels = rng.uniform(-0.1, 1.1, (6, 2)) * (camera.width, camera.height)
    rays = np.column_stack([camera.normalize(pixels), np.ones(len(pixels))]) @ eye.rotation.T
    for ray in rays:
        if ray[2] < -0.2 * np.linalg.norm(ray):
            spot = eye.translation + ray * (eye.translation[2] / -ray[2])
            if np.hypot(spot[0], spot[1]) > keep_m:
                return Pose.from_rotvec([spot[0], spot[1], 0.0], [0.0, 0.0, turn])
    return None


def _sign(pad: PadSpec, lot: Lot, rng: np.random.Generator) -> tuple[str, Decal, Thing]:
    """Return a sign like the pad, on the ground, on a board, a box or a vehicle, with what it lies on."""
    name, picture = random_sign(rng, pad)
    # what is painted on a road is larger than what is carried about
    low, high = (1.2, 4.0) if name in PAINTED else (0.35, 1.5)
    side = pad.extent_m * float(np.exp(rng.uniform(math.log(low), math.log(high))))
    pose = _spot(lot, lot.keep_m + 0.8 * side, rng)
    if pose is None:
        # with a large pad in sight the sign lies outside of the picture, where it does no harm
        pose = Pose.from_rotvec([lot.keep_m + 30.0 * side, 0.0, 0.0], [0.0, 0.0, 0.0])
    kind = 0.0 if name in FLAT or name in PAINTED else float(rng.random())
    if kind < 0.4:
        return name, Decal(picture, pose @ _lifted(0.004), side), ()
    if kind < 0.7:
        stand, top_m = _board(side, rng)
    else:
        carriers = tuple(CARRIERS)
        carrier = CARRIERS[carriers[int(rng.integers(len(carriers)))]](rng, side)
        stand, top_m = place(carrier.thing, _lifted(carrier.pad_height_m)), carrier.pad_height_m
    return name, Decal(picture, pose @ _lifted(top_m + 0.004), side), place(stand, pose)


def _board(side_m: float, rng: np.random.Generator) -> tuple[Thing, float]:
    """Return a plate or block that a sign is mounted on, and its height."""
    high, white = float(rng.uniform(0.02, 0.5)) * side_m, float(rng.uniform(0.35, 0.8))
    size = (1.04 * side_m, 1.04 * side_m, high)
    return (box(size, (0.0, 0.0, high / 2.0), (white, white, white)),), high


def _lifted(height_m: float) -> Pose:
    return Pose(rotation_from_rotvec([0.0, 0.0, 0.0]), np.array([0.0, 0.0, height_m]))


@lru_cache(maxsize=1)
def _shares() -> Array:
    """Return how often each kind of ground is drawn: those that vehicles stand on more often."""
    weights = np.array([_OFTEN.get(kind, 1.0) for kind in KINDS])
    shares: Array = weights / weights.sum()
    return shares


@lru_cache(maxsize=_PHOTOS_KEPT)
def _photo(path: Path) -> GroundTexture:
    return photo_ground(path, np.random.default_rng(GROUND_SEED))
