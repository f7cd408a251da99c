"""What the pad lies on, built around the pad and in its frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from landtool.geometry import Pose
from landtool.synth.mesh import Albedo, Mesh, Thing, box, place
from landtool.synth.things import cars, machines, paint, stands
from landtool.synth.things.parts import Body


@dataclass(frozen=True, eq=False)
class Carrier:
    """What the pad lies on.

    thing: in the pad's frame, so the ground is at z = -pad_height_m. First come the meshes that end at the pad's
    plane or below it, then those that rise above it, as a cab or a railing; these are beside the pad, and are to be
    painted after it.
    """

    thing: Thing
    pad_height_m: float


_Builder = Callable[[Generator, float, float], Body]


def _carrier(build: _Builder, *, turned: float, plated: float) -> Callable[[Generator, float], Carrier]:
    """Return a maker of carriers. turned, plated: shares of pads that lie askew, that are fixed to a plate."""

    def make(rng: Generator, side_m: float) -> Carrier:
        yaw = float(rng.uniform(-0.6, 0.6)) if rng.random() < turned else float(rng.normal(0.0, 0.02))
        plate_m = side_m * float(rng.uniform(1.01, 1.25)) if rng.random() < plated else 0.0
        board_m = max(side_m, plate_m)
        # the square along the body's axes that the turned board needs
        keep_m = board_m * float(np.abs(np.cos(yaw)) + np.abs(np.sin(yaw))) * 1.01
        body = build(rng, board_m, keep_m)
        plate = _plate(rng, side_m, plate_m, body.deck_albedo) if plate_m else None
        lift = 0.0 if plate is None else float(plate.points_m[:, 2].max() - plate.points_m[:, 2].min())
        turn = Pose.from_rotvec(np.zeros(3), np.array([0.0, 0.0, yaw]))
        pad_T_body = turn @ Pose(np.eye(3), np.array([-body.deck_m[0], -body.deck_m[1], -body.deck_m[2] - lift]))
        parts = place(body.thing, pad_T_body)
        below = [mesh for mesh in parts if mesh.points_m[:, 2].max() <= 1e-9]
        above = [mesh for mesh in parts if mesh.points_m[:, 2].max() > 1e-9]
        plates = [] if plate is None else [plate]
        return Carrier((*below, *plates, *above), body.deck_m[2] + lift)

    return make


def _plate(rng: Generator, side_m: float, plate_m: float, deck: Albedo) -> Mesh:
    """Return a board under the pad, its top at z = 0."""
    thick = side_m * float(rng.uniform(0.01, 0.08))
    kind = rng.random()
    albedo = (
        paint.signal(rng)
        if kind < 0.4
        else paint.plain(rng)
        if kind < 0.7
        else paint.wood(rng)
        if kind < 0.85
        else deck
    )
    return box((plate_m, plate_m, thick), (0.0, 0.0, -thick / 2.0), albedo)


CARRIERS: dict[str, Callable[[Generator, float], Carrier]] = {
    "sedan": _carrier(cars.sedan, turned=0.15, plated=0.35),
    "suv": _carrier(cars.suv, turned=0.15, plated=0.35),
    "van": _carrier(cars.van, turned=0.3, plated=0.25),
    "pickup": _carrier(cars.pickup, turned=0.0, plated=0.3),
    "flatbed": _carrier(machines.flatbed, turned=0.1, plated=0.4),
    "trailer": _carrier(machines.trailer, turned=0.15, plated=0.3),
    "rover6": _carrier(machines.rover6, turned=0.05, plated=0.25),
    "tracked": _carrier(machines.tracked, turned=0.05, plated=0.25),
    "box": _carrier(stands.crate, turned=0.5, plated=0.2),
    "table": _carrier(stands.table, turned=0.4, plated=0.3),
    "boat": _carrier(stands.boat, turned=0.3, plated=0.3),
}
"""By kind: a maker of carriers from a generator and the side of the pad's board in metres."""
VEHICLES = ("sedan", "suv", "van", "pickup", "flatbed", "trailer", "rover6", "tracked")
BOXES = ("box",)
DECKS = ("table", "boat")
