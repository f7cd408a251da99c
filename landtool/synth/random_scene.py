"""One scene of a data set, drawn at random: where it is seen from, what the pad lies on, its weather and its motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from landtool.geometry import Pose, rotation_from_rotvec
from landtool.pad import PadSpec
from landtool.synth.domain import Domain, chance, log_uniform, uniform
from landtool.synth.mesh import Thing, place
from landtool.synth.motion_blur import flow_grid
from landtool.synth.scene import Scene, Sun, Target
from landtool.synth.sheet import random_sheet
from landtool.synth.surroundings import PHOTOGRAPH, Lot, furnish, random_ground
from landtool.synth.things import BOXES, CARRIERS, DECKS, VEHICLES, above_pad, drone, pole_shade, tree_shade
from landtool.synth.view import View
from landtool.synth.viewpoint import Viewpoint, random_camera, random_viewpoint
from landtool.synth.weather import random_fog, random_weather

_FASTEST_MPS, _FASTEST_RADPS = 4.0, 0.6


@dataclass(frozen=True, eq=False)
class Drawn:
    """A scene drawn at random and the view it is seen in. ground, carrier, signs, sky: names of what was drawn.

    level: brightness of a white level surface. scale: how much larger all around a small print is. motion_px: way of
    the median pixel while the shutter is open.
    """

    scene: Scene
    viewpoint: Viewpoint
    view: View
    ground: str
    carrier: str
    signs: tuple[str, ...]
    sky: str
    level: float
    scale: float
    motion_px: float


def draw_scene(
    domain: Domain, pad: PadSpec, size: tuple[int, int], photos: Sequence[Path], rng: np.random.Generator
) -> Drawn:
    """Return a scene. Raises UsageError when the domain has no place from which enough of the pad is in the picture."""
    camera = random_camera(domain, *size, rng)
    viewpoint = random_viewpoint(domain, pad, camera, rng)
    present = not chance(rng, domain.absent)
    scale = log_uniform(rng, domain.small_print_scale) if chance(rng, domain.small_print) else 1.0
    carrier_name, carrier, pad_height = _carrier(domain, pad, scale > 1.0, rng)
    heading = float(rng.uniform(-math.pi, math.pi))
    world_T_pad = Pose(rotation_from_rotvec([0.0, 0.0, heading]), np.array([0.0, 0.0, pad_height]))
    view = View.still(camera, world_T_pad @ viewpoint.pad_T_camera)
    floor = random_ground(domain, photos, scale, rng)
    lot = Lot(view, _keep_m(carrier, pad), scale)
    around = furnish(domain, pad, lot, floor, _sign_count(domain, present, rng), rng)
    weather = random_weather(domain, rng)
    relief = uniform(rng, domain.relief)
    distance_m = float(np.linalg.norm(viewpoint.pad_T_camera.translation))
    scene = Scene(
        ground=around.ground,
        sun=weather.sun,
        target=_target(domain, pad, world_T_pad, carrier, rng) if present else None,
        regions=around.regions,
        marks=around.marks,
        decals=around.decals,
        things=around.things,
        shades=_shades(domain, view, world_T_pad, weather.sun, scale, rng),
        fog=random_fog(domain, weather, distance_m, rng),
        phase_m=(float(rng.uniform(0.0, 500.0)), float(rng.uniform(0.0, 500.0))),
        relief=1.0 if around.kind == PHOTOGRAPH else relief,
    )
    view, motion_px = _moving(domain, view, pad_height, rng)
    name = carrier_name if present else ""
    return Drawn(scene, viewpoint, view, around.kind, name, around.signs, weather.kind, weather.level, scale, motion_px)


def _carrier(domain: Domain, pad: PadSpec, small: bool, rng: np.random.Generator) -> tuple[str, Thing, float]:
    """Return the name of what the pad lies on, its bodies in the pad frame, and the pad's height over the ground."""
    roll = float(rng.random())
    if small:
        # a small print lies on the ground, on a box or on a table, not on a vehicle of its size
        roll = domain.on_vehicle + roll * (1.0 - domain.on_vehicle)
    names: tuple[str, ...]
    if roll < domain.on_vehicle:
        names = VEHICLES
    elif roll < domain.on_vehicle + domain.on_box:
        names = BOXES
    elif roll < domain.on_vehicle + domain.on_box + domain.on_deck:
        names = DECKS
    else:
        return "ground", (), float(rng.uniform(0.002, 0.02)) * pad.diameter_m
    name = names[int(rng.integers(len(names)))]
    carrier = CARRIERS[name](rng, pad.extent_m)
    return name, carrier.thing, carrier.pad_height_m


def _keep_m(carrier: Thing, pad: PadSpec) -> float:
    """Return the radius about the pad that other bodies keep out of."""
    reaches = [float(np.hypot(*mesh.points_m[:, :2].T).max()) for mesh in carrier]
    return max([0.75 * pad.extent_m, *reaches])


def _sign_count(domain: Domain, present: bool, rng: np.random.Generator) -> int:
    share = domain.signs_with_pad if present else domain.signs_without_pad
    return int(rng.integers(1, 5)) if chance(rng, share) else 0


def _target(domain: Domain, pad: PadSpec, world_T_pad: Pose, carrier: Thing, rng: np.random.Generator) -> Target:
    sheet = random_sheet(
        rng,
        pad,
        dirtiness=uniform(rng, domain.dirt),
        curled=not carrier and chance(rng, domain.curl),
        glossy=chance(rng, domain.gloss),
    )
    above = above_pad(rng, pad.extent_m) if chance(rng, domain.occlusion) else ()
    return Target(pad, sheet, world_T_pad, carrier, above)


def _shades(
    domain: Domain, view: View, world_T_pad: Pose, sun: Sun, scale: float, rng: np.random.Generator
) -> tuple[Thing, ...]:
    """Return what throws shadows on and about the pad: trees, poles, and the drone itself."""
    shades: list[Thing] = []
    if chance(rng, domain.shadow):
        make = (pole_shade, tree_shade)[int(rng.integers(2))]
        thing = tuple(mesh.stretched(scale) for mesh in make(rng))
        top = max(float(mesh.points_m[:, 2].max()) for mesh in thing)
        pad = world_T_pad.translation
        # the light that passes this high over the ground falls on or near the pad
        high = float(rng.uniform(0.3, 1.0)) * top
        x, y, z = sun.direction
        at = pad[:2] + np.array([x, y]) / max(z, 0.05) * (high - pad[2]) + rng.normal(0.0, 0.4, 2)
        shades.append(place(thing, Pose.from_rotvec([at[0], at[1], 0.0], [0.0, 0.0, float(rng.uniform(-3.1, 3.1))])))
    if chance(rng, domain.drone_shadow):
        above = view.world_T_camera.translation + np.array([0.0, 0.0, 0.08])
        shades.append(place(drone(rng), Pose.from_rotvec(above, [0.0, 0.0, float(rng.uniform(-3.1, 3.1))])))
    return tuple(shades)


def _moving(domain: Domain, view: View, plane_z_m: float, rng: np.random.Generator) -> tuple[View, float]:
    """Return the view with the motion that gives the picture the blur and the shear that were drawn, and the blur."""
    velocity = rng.normal(0.0, 0.5, 3) * _FASTEST_MPS
    rate = rng.normal(0.0, 0.5, 3) * _FASTEST_RADPS
    blurred, rolling = chance(rng, domain.motion_blur), chance(rng, domain.rolling_shutter)
    length_px, shear_px = uniform(rng, domain.motion_blur_px), float(rng.uniform(1.0, 14.0))
    if not (blurred or rolling):
        return view, 0.0
    second = replace(view, velocity_mps=velocity, rate_radps=rate, exposure_s=1e-3)
    flow = flow_grid(second, plane_z_m)
    px_per_s = 1e3 * float(np.median(np.linalg.norm(flow.reshape(-1, 2), axis=1)))
    exposure = min(length_px / max(px_per_s, 1.0), 0.04) if blurred else 0.0
    readout = min(shear_px / max(px_per_s, 1.0), 0.04) if rolling else 0.0
    return replace(second, exposure_s=exposure, readout_s=readout), exposure * px_per_s
