"""Where a clip plays: the platform's body, the ground, what stands along its way, light, and what hides the pad."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from landtool.errors import UsageError
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.synth import markings
from landtool.synth.clips.config import ClipConfig
from landtool.synth.clips.flight import Flight
from landtool.synth.clips.platform import PlatformMotion
from landtool.synth.clips.scenarios import ScenarioName
from landtool.synth.domain import Domain
from landtool.synth.fog import Fog
from landtool.synth.grounds import VARIANTS, GroundKind, GroundTexture, ground
from landtool.synth.mesh import Mesh, Thing, box, place
from landtool.synth.scene import Mark, Region, Scene, Target
from landtool.synth.sheet import random_sheet
from landtool.synth.things import CARRIERS, PROPS, VEHICLES, drone
from landtool.synth.weather import Weather, random_weather

# of light and camera a clip has the better half: what moves through it is to be tracked
DOMAIN = Domain(light=(0.45, 1.15), sun_elevation_deg=(12.0, 70.0), defocus=0.0, rescaled=0.0, vignette=(0.0, 0.25))
_CARRIERS: dict[ScenarioName, tuple[str, ...]] = {
    "straight": VEHICLES,
    "turn": VEHICLES,
    "stop-and-go": VEHICLES,
    "figure-eight": ("rover6", "tracked", "trailer"),
    "heave": ("boat",),
    "hover": ("box", "table", "flatbed", "rover6", "tracked"),
    "occlusion": ("sedan", "suv", "rover6", "tracked"),
}
_Layout = Callable[[np.random.Generator], markings.Layout]
_ROADS: tuple[tuple[GroundKind, _Layout | None], ...] = (("asphalt", markings.road), ("asphalt", markings.crossing))
_YARDS: tuple[tuple[GroundKind, _Layout | None], ...] = (
    ("asphalt", markings.parking_lot),
    ("concrete", markings.apron),
    ("concrete", None),
    ("soil", None),
    ("grass", None),
)
_PLACES: dict[ScenarioName, tuple[tuple[GroundKind, _Layout | None], ...]] = {
    "straight": _ROADS,
    "turn": _YARDS,
    "stop-and-go": _ROADS,
    "figure-eight": _YARDS,
    "heave": (("water", None),),
    "hover": (*_YARDS, ("gravel", None), ("tiles", None)),
    "occlusion": _ROADS,
}
_MOST_THINGS = 16
_CLEAR_M = 0.6  # between the drone and what it flies over


@dataclass(frozen=True, eq=False)
class Body:
    """What the pad is on. thing: in the pad frame. height_m: of the pad over the ground."""

    name: str
    thing: Thing
    height_m: float

    @property
    def reach_m(self) -> float:
        """How far it goes from the pad's centre, on the level."""
        return max(float(np.hypot(*mesh.points_m[:, :2].T).max()) for mesh in self.thing)

    @property
    def top_m(self) -> float:
        """Its highest point over the pad, at least 0."""
        return max(0.0, *(float(mesh.points_m[:, 2].max()) for mesh in self.thing))


def draw_body(scenario: ScenarioName, pad: PadSpec, rng: np.random.Generator) -> Body:
    """Return a body that suits a scenario."""
    names = _CARRIERS[scenario]
    name = names[int(rng.integers(len(names)))]
    carrier = CARRIERS[name](rng, pad.extent_m)
    return Body(name, carrier.thing, carrier.pad_height_m)


@dataclass(frozen=True, eq=False)
class ClipScene:
    """A scene that moves: `at` a time, with the pad, its body, and the shadow of the drone where they are then."""

    still: Scene
    motion: PlatformMotion
    flight: Flight
    drone: Thing
    hider: Thing
    weather: str
    ground: str

    def at(self, t_s: float) -> Scene:
        """Return the scene at a time in seconds."""
        assert self.still.target is not None
        world_T_pad = self.motion.world_T_pad(t_s)
        x, y, z = (float(v) for v in self.motion.velocities_mps(t_s)[0])
        # in the pad's frame what hides it is painted after it; its own motion is that of the pad for one exposure
        above = place(self.hider, world_T_pad.inverse())
        target = replace(self.still.target, world_T_pad=world_T_pad, velocity_mps=(x, y, z), above=above)
        return replace(self.still, target=target, shades=(place(self.drone, self.flight.world_T_body(t_s)),))


def clip_scene(
    rng: np.random.Generator, config: ClipConfig, motion: PlatformMotion, flight: Flight, body: Body
) -> ClipScene:
    """Return the place of a clip, drawn once. Raises UsageError when nothing fits between the drone and the pad."""
    weather = random_weather(DOMAIN, rng)
    places = _PLACES[config.scenario]
    kind, layout = places[int(rng.integers(len(places)))]
    way = motion.positions_m(np.arange(-1.0, config.duration_s + 1.0, 0.2))[:, :2]
    marks, regions, things = _laid_out(layout, way, rng)
    if kind != "water":
        things += _along(way, body.reach_m, rng)
    sheet = random_sheet(rng, config.pad, dirtiness=0.5 * float(rng.random()))
    target = Target(config.pad, sheet, motion.world_T_pad(0.0), body.thing)
    hider: Thing = ()
    if motion.hidden_s is not None:
        hider, legs = _gantry(rng, config, motion, flight, body)
        things += (legs,)
    still = Scene(
        _ground(kind, rng), weather.sun, target, regions, marks, things=things, fog=_fog(config.fog_beta, weather, rng),
        phase_m=(float(rng.uniform(0.0, 500.0)), float(rng.uniform(0.0, 500.0))),
    )  # fmt: skip
    return ClipScene(still, motion, flight, drone(rng), hider, weather.kind, kind)


def _ground(kind: GroundKind, rng: np.random.Generator) -> GroundTexture:
    texture = ground(kind, int(rng.integers(VARIANTS)))
    b, g, r = (float(t) for t in np.exp(rng.normal(0.0, 0.1) + rng.normal(0.0, 0.03, 3)))
    return replace(texture, tint=(b, g, r))


def _fog(beta_per_m: float, weather: Weather, rng: np.random.Generator) -> Fog | None:
    """Return even fog, grey and somewhat darker than white under that sky."""
    share, tint = float(rng.uniform(0.6, 0.9)), rng.normal(0.0, 0.03, 3)
    if beta_per_m == 0.0:
        return None
    b, g, r = (float(v) for v in np.clip(weather.level * share * (1.0 + tint), 0.05, 0.95))
    return Fog(beta_per_m, (b, g, r))


def _laid_out(
    layout: _Layout | None, way: Array, rng: np.random.Generator
) -> tuple[tuple[Mark, ...], tuple[Region, ...], tuple[Thing, ...]]:
    """Return markings, other grounds and kerbs about the way (N, 2); roads go along x, as the way does there."""
    stains = markings.stains(rng).over(markings.cracks(rng))
    found = (layout(rng) if layout else markings.Layout()).over(stains)
    shift = way.mean(axis=0) + (0.0, float(rng.uniform(-1.8, 1.8)))
    marks = tuple(replace(m, polygons_m=tuple(p + shift for p in m.polygons_m)) for m in found.marks)
    regions = tuple(
        Region(polygon + shift, ground(kind, int(rng.integers(VARIANTS))), 0.06) for polygon, kind in found.regions
    )
    world_T_layout = Pose(np.eye(3), np.array([*shift, 0.0]))
    return marks, regions, tuple(place(thing, world_T_layout) for thing in found.things)


def _along(way: Array, keep_m: float, rng: np.random.Generator) -> tuple[Thing, ...]:
    """Return bodies beside the way (N, 2), none of them on it."""
    length = float(np.hypot(*np.diff(way, axis=0).T).sum())
    names, things = tuple(PROPS), []
    for _ in range(min(_MOST_THINGS, 4 + int(length / 2.0))):
        thing = PROPS[names[int(rng.integers(len(names)))]](rng)
        reach = max(float(np.abs(mesh.points_m[:, :2]).max()) for mesh in thing)
        angle, free = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(0.3, 4.5))
        from_way = (keep_m + reach + free) * np.array([math.cos(angle), math.sin(angle)])
        spot = way[int(rng.integers(len(way)))] + from_way
        if np.hypot(*(way - spot).T).min() > keep_m + reach:
            turn = np.array([0.0, 0.0, float(rng.uniform(-math.pi, math.pi))])
            things.append(place(thing, Pose.from_rotvec([*spot, 0.0], turn)))
    return tuple(things)


def _gantry(
    rng: np.random.Generator, config: ClipConfig, motion: PlatformMotion, flight: Flight, body: Body
) -> tuple[Thing, Thing]:
    """Return the deck of a footbridge or gantry across the way, which hides the pad just when it should, and its legs.

    The way goes along x.
    """
    assert motion.hidden_s is not None
    times = np.linspace(*motion.hidden_s, 21)
    pads = motion.positions_m(times)
    bodies = [flight.world_T_body(float(t)) for t in times]
    eyes = np.array([(b @ config.body_T_camera).translation for b in bodies])
    # the drone is over it for a while longer than it hides the pad
    later = flight.world_T_body(float(times[-1]) + 0.3).translation[2]
    low, high = float(pads[:, 2].max()) + body.top_m + 0.15, min(float(later), float(eyes[:, 2].min())) - _CLEAR_M
    if low + 0.3 > high:
        raise UsageError("nothing fits between the drone and the pad", hint="start higher or take longer")
    z = low + 0.3 * (high - low)
    # where the line of sight to the pad's middle meets the height of the deck, and how far its edges are from there
    share = (z - pads[:, 2]) / (eyes[:, 2] - pads[:, 2])
    sight = pads[:, :2] + share[:, None] * (eyes - pads)[:, :2]
    reach = float(((1.0 - share) * config.pad.extent_m).max()) * math.sqrt(0.5)
    start, end = float(sight[:, 0].min()) - reach, float(sight[:, 0].max()) + reach
    return _deck(rng, (start, end), float(sight[:, 1].mean()), z)


def _deck(rng: np.random.Generator, span_m: tuple[float, float], y_m: float, z_m: float) -> tuple[Thing, Thing]:
    """Return a deck with its upper side at z_m between two x, and the legs it stands on."""
    grey = float(rng.uniform(0.08, 0.4))
    tone = tuple(float(grey * t) for t in rng.uniform(0.85, 1.15, 3))
    steel = (tone[0], tone[1], tone[2])
    dark = (0.4 * tone[0], 0.4 * tone[1], 0.4 * tone[2])
    start, end = span_m
    long, half = end - start, float(rng.uniform(4.5, 7.0))
    middle = (start + end) / 2.0
    planks: list[Mesh] = [box((long, 2.0 * half, 0.12), (middle, y_m, z_m - 0.06), steel)]
    planks += [box((0.06, 2.0 * half, 0.02), (x, y_m, z_m + 0.01), dark) for x in (start + 0.05, end - 0.05)]
    planks += [
        box((0.9 * long, 0.03, 0.006), (middle, y_m + y, z_m + 0.003), dark) for y in np.arange(-half, half, 0.8)
    ]
    foot_z = z_m - 0.12
    legs = tuple(
        box((0.18, 0.18, foot_z), (x, y_m + s * (half - 0.2), foot_z / 2.0), dark)
        for x in (start + 0.2, end - 0.2)
        for s in (-1.0, 1.0)
    )
    return tuple(planks), legs
