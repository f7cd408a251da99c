"""Cars: sedan, estate, van and pickup, real size, big enough for the pad they carry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from landtool.geometry import Array
from landtool.synth.mesh import Albedo, Mesh, Thing, bar, box, flat, loft, panels, rounded, wedge
from landtool.synth.things import paint
from landtool.synth.things.parts import Body, antenna, discs, gear, planks, slab, within

_BLACK = paint.srgb((28, 28, 29))
_LAMP = paint.srgb((226, 228, 230))
_TAIL = paint.srgb((150, 18, 20))
_PLATE = paint.srgb((228, 226, 214))


@dataclass(frozen=True)
class _Shape:
    """Lengths of a car from its nose to its tail as seen from above, heights and widths, in metres."""

    bonnet: float
    windscreen: float
    roof: float
    rear: float
    boot: float
    nose_z: float
    belt_z: float
    roof_z: float
    width: float
    roof_width: float
    body: Albedo
    glass: Albedo

    @property
    def length(self) -> float:
        return self.bonnet + self.windscreen + self.roof + self.rear + self.boot

    @property
    def stations(self) -> tuple[float, float, float, float, float, float]:
        """X of nose, foot of the windscreen, front and rear edge of the roof, foot of the rear window, tail."""
        steps = np.cumsum([0.0, self.bonnet, self.windscreen, self.roof, self.rear, self.boot])
        return tuple(float(self.length / 2.0 - s) for s in steps)  # type: ignore[return-value]


def sedan(rng: Generator, side_m: float, keep_m: float, *, body: Albedo | None = None) -> Body:
    """Return a saloon car, of a colour drawn if none is given; the pad lies on its roof."""
    shape = _shape(rng, side_m, roof=(1.2, 1.5), rear=(0.5, 0.8), boot=(0.4, 0.8), high=(1.38, 1.5))
    return _closed_car(rng, shape if body is None else replace(shape, body=body), keep_m)


def suv(rng: Generator, side_m: float, keep_m: float, *, body: Albedo | None = None) -> Body:
    """Return an estate car or an off-road car, of a colour drawn if none is given; the pad lies on its roof."""
    shape = _shape(rng, side_m, roof=(1.8, 2.3), rear=(0.15, 0.4), boot=(0.05, 0.12), high=(1.55, 1.85))
    return _closed_car(rng, shape if body is None else replace(shape, body=body), keep_m)


def van(rng: Generator, side_m: float, keep_m: float) -> Body:
    """Return a van; the pad lies on its roof."""
    shape = _shape(
        rng, side_m, roof=(2.5, 3.2), rear=(0.06, 0.15), boot=(0.03, 0.06), high=(1.9, 2.4),
        bonnet=(0.4, 0.8), width=(1.85, 2.0), lean=(0.08, 0.18),
    )  # fmt: skip
    return _closed_car(rng, shape, keep_m, blind=rng.random() < 0.6)


def pickup(rng: Generator, _: float, keep_m: float) -> Body:
    """Return a pickup; the pad lies in its bed, or on the bed's cover."""
    bed = max(float(rng.uniform(1.5, 1.9)), keep_m + 0.25)
    shape = _shape(
        rng, 0.0, roof=(0.9, 1.7), rear=(0.08, 0.2), boot=(bed, bed), high=(1.6, 1.8),
        width=(max(1.8, keep_m + 0.4), max(2.0, keep_m + 0.45)),
    )  # fmt: skip
    covered = bool(rng.random() < 0.4)
    foot, tail = shape.stations[4:]
    deck_z = shape.belt_z if covered else shape.nose_z + float(rng.uniform(0.01, 0.08))
    floor = paint.plain(rng)
    # the cab's half of the body ends where the bed begins: it stands behind a cover, and above an open bed
    upper, bed_parts = _upper(shape, foot), _bed(rng, shape, deck_z, floor, covered)
    parts = [*_under(rng, shape), *([upper, *bed_parts] if covered else [*bed_parts, upper])]
    parts += [_skin(rng, shape, upper, tail_lights=False), *_mirrors(shape), *_cabin(rng, shape, blind=False)]
    x = (foot + tail) / 2.0 + 0.05  # the tailgate takes its share
    if rng.random() < 0.3:
        parts += gear(rng, shape.stations[3] + 0.3, 0.0, shape.roof_z + 0.05, 0.25)
    return Body((*parts, *_beside(rng, x, deck_z, bed - 0.3, shape.width - 0.2, keep_m)), (x, 0.0, deck_z), floor)


def _shape(
    rng: Generator, side_m: float, *, roof: tuple[float, float], rear: tuple[float, float], boot: tuple[float, float],
    high: tuple[float, float], bonnet: tuple[float, float] = (0.95, 1.35), width: tuple[float, float] = (1.7, 1.92),
    lean: tuple[float, float] = (0.16, 0.26),
) -> _Shape:  # fmt: skip
    """Draw a car whose roof holds a board of `side_m`, now and then just not."""
    holds = side_m * float(rng.uniform(0.98, 1.1))
    wide = float(rng.uniform(*width))
    tumble = float(rng.uniform(*lean)) + 0.06
    roof_width = max(wide - 2 * tumble, holds)
    roof_z = float(rng.uniform(*high))
    belt_z = float(rng.uniform(0.58, 0.66)) * roof_z if roof_z < 1.9 else float(rng.uniform(1.0, 1.2))
    return _Shape(
        bonnet=float(rng.uniform(*bonnet)), windscreen=float(rng.uniform(0.45, 0.8)),
        roof=max(float(rng.uniform(*roof)), holds), rear=float(rng.uniform(*rear)), boot=float(rng.uniform(*boot)),
        nose_z=belt_z - float(rng.uniform(0.22, 0.32)), belt_z=belt_z, roof_z=roof_z, width=roof_width + 2 * tumble,
        roof_width=roof_width, body=paint.car_paint(rng), glass=paint.glass(rng),
    )  # fmt: skip


def _closed_car(rng: Generator, shape: _Shape, keep_m: float, *, blind: bool = False) -> Body:
    *_, tail = shape.stations
    upper = _upper(shape, tail)
    parts = [*_under(rng, shape), upper, _skin(rng, shape, upper), *_mirrors(shape), *_cabin(rng, shape, blind=blind)]
    x = (shape.stations[2] + shape.stations[3]) / 2.0
    slack = max((shape.roof - keep_m) / 2.0, 0.0)
    # on a long roof the pad lies anywhere along it
    x += float(rng.uniform(-slack, slack)) * 0.8
    z = shape.roof_z + 0.05
    gear_parts = _on_roof(rng, shape, x, z, keep_m)
    return Body((*parts, *gear_parts), (x, 0.0, z), shape.body)


def _under(rng: Generator, shape: _Shape) -> list[Mesh]:
    """Return what is under the waist: shadowed floor, sills and bumpers, the flanks with the wheels on them."""
    length, width = shape.length, shape.width
    trim = shape.body if rng.random() < 0.6 else paint.srgb((52, 53, 55))
    radius = float(rng.uniform(0.25, 0.45))
    mid = shape.nose_z * 0.62
    floor = box((length * 0.9, width * 0.9, 0.25), (0.0, 0.0, 0.125), _BLACK)
    sill = loft(
        flat(rounded(length - 0.16, width - 0.1, radius, steps=2), 0.2),
        flat(rounded(length, width, radius, steps=2), mid),
        trim,
    )
    flank = slab(length, width, mid, shape.nose_z, shape.body, radius_m=radius, inset_m=0.05, steps=2)
    tyre, z = paint.rubber(rng), float(rng.uniform(0.3, 0.36))
    y, front, back = width / 2.0 + 0.01, length / 2.0 - 0.82, -length / 2.0 + 0.85
    spots = [(front, y, z), (front, -y, z), (back, y, z), (back, -y, z)]
    rim = paint.srgb((150, 152, 155), float(rng.uniform(0.1, 1.2)))
    return [floor, sill, flank, discs(spots, (z, z * 0.62), (tyre, rim))]


def _upper(shape: _Shape, back_m: float) -> Mesh:
    """Return the body from the waist to the belt, from the nose to `back_m`: bonnet, doors, boot lid."""
    nose, cowl = shape.stations[:2]
    low, high = shape.nose_z, shape.belt_z
    rise = 0.45 * (high - low)
    inner = back_m + min(0.12, (cowl - back_m) / 4)
    profile = [(back_m + 0.06, low), (nose - 0.06, low), (nose - 0.2, low + rise), (cowl, high), (inner, high)]
    return wedge(profile, shape.width / 2.0 - 0.05, shape.width / 2.0 - 0.1, shape.body)


def _quad(mesh: Mesh, edge: int) -> Array:
    """Return the face (4, 3) over an edge of a wedge's profile: from its left to its right."""
    return mesh.points_m[mesh.faces[1 + edge]]


def _skin(rng: Generator, shape: _Shape, upper: Mesh, *, tail_lights: bool = True) -> Mesh:
    """Return lamps, grille, the joints of bonnet and doors."""
    nose, bonnet, tail = _quad(upper, 1), _quad(upper, 2), _quad(upper, 4)
    joint, grille = paint.dimmed(shape.body, 0.45), _BLACK if rng.random() < 0.7 else paint.dimmed(shape.body, 0.6)
    # a quad of the wedge runs along the profile first, then from left to right
    faces = [
        (within(nose, (0.3, 0.95), (0.04, 0.24)), _LAMP),
        (within(nose, (0.3, 0.95), (0.76, 0.96)), _LAMP),
        (within(nose, (0.1, 0.8), (0.3, 0.7)), grille),
        (within(bonnet, (0.05, 0.97), (0.09, 0.1)), joint),
        (within(bonnet, (0.05, 0.97), (0.9, 0.91)), joint),
        (within(bonnet, (0.93, 0.99), (0.08, 0.92)), _BLACK),
    ]
    if tail_lights:
        faces += [
            (within(tail, (0.2, 0.9), (0.03, 0.2)), _TAIL),
            (within(tail, (0.2, 0.9), (0.8, 0.97)), _TAIL),
            (within(tail, (0.4, 0.85), (0.38, 0.62)), _PLATE),
        ]
    return panels([face for face, _ in faces], [albedo for _, albedo in faces])


def _mirrors(shape: _Shape) -> list[Mesh]:
    x, y = shape.stations[1] - 0.25, shape.width / 2.0 + 0.02
    return [box((0.12, 0.2, 0.14), (x, s * y, shape.belt_z + 0.05), shape.body, taper=0.2) for s in (1.0, -1.0)]


def _cabin(rng: Generator, shape: _Shape, *, blind: bool) -> list[Mesh]:
    """Return the part with the windows and the roof; blind: a van without windows behind the driver."""
    _, cowl, front, rear, foot, _ = shape.stations
    profile = [(foot, shape.belt_z), (cowl, shape.belt_z), (front + 0.05, shape.roof_z), (rear - 0.02, shape.roof_z)]
    half = shape.roof_width / 2.0 + 0.05
    house = wedge(profile, shape.width / 2.0 - 0.1, half, shape.body)
    glass = shape.glass
    left, right = house.points_m[[0, 1, 2, 3]][::-1], house.points_m[[4, 5, 6, 7]]
    driver = float(rng.uniform(0.5, 0.6))
    spans = [(driver, 0.93)] if blind else [(driver, 0.93), (0.07, driver - 0.03)]
    faces = [within(_quad(house, 1), (0.08, 0.94), (0.05, 0.95))]
    faces += [] if blind else [within(_quad(house, 3), (0.1, 0.85), (0.08, 0.92))]
    faces += [within(left, u, (0.1, 0.92)) for u in spans] + [within(right, u, (0.08, 0.9)) for u in spans]
    roof = loft(
        flat(rounded(shape.roof + 0.1, 2 * half, 0.12, steps=1), shape.roof_z, x_m=(front + rear) / 2.0),
        flat(rounded(shape.roof, shape.roof_width, 0.12, steps=1), shape.roof_z + 0.05, x_m=(front + rear) / 2.0),
        shape.body,
    )
    return [house, panels(faces, [glass] * len(faces)), roof]


def _on_roof(rng: Generator, shape: _Shape, x_m: float, z_m: float, keep_m: float) -> Thing:
    """Return rails, an antenna, a light bar or luggage, where the roof has room beside the pad."""
    *_, front, rear, _, _ = shape.stations
    parts: list[Mesh] = []
    y = shape.roof_width / 2.0 - 0.03
    if rng.random() < 0.4 and y > keep_m / 2.0 + 0.03:
        rail = paint.srgb((40, 40, 42)) if rng.random() < 0.5 else paint.srgb((170, 172, 174))
        parts += [
            bar((rear + 0.1, s * y, z_m + 0.03), (front - 0.1, s * y, z_m + 0.03), 0.04, rail) for s in (1.0, -1.0)
        ]
    return (*parts, *_beside(rng, x_m, z_m, shape.roof, shape.roof_width, keep_m, span_x_m=(rear, front)))


def _beside(
    rng: Generator, x_m: float, z_m: float, length_m: float, width_m: float, keep_m: float, *,
    span_x_m: tuple[float, float] | None = None,
) -> Thing:  # fmt: skip
    """Return gear on a deck before and behind the pad, if there is room."""
    low, high = span_x_m or (x_m - length_m / 2.0, x_m + length_m / 2.0)
    parts: Thing = ()
    for a, b in ((low, x_m - keep_m / 2.0), (x_m + keep_m / 2.0, high)):
        size = min(b - a - 0.04, 0.5)
        if size < 0.12 or rng.random() < 0.5:
            continue
        y = float(rng.uniform(-0.5, 0.5)) * max(width_m - size - 0.1, 0.0)
        parts += antenna(rng, (a + b) / 2, y, z_m) if rng.random() < 0.4 else gear(rng, (a + b) / 2, y, z_m, size * 0.9)
    return parts


def _bed(rng: Generator, shape: _Shape, deck_z_m: float, floor: Albedo, covered: bool) -> list[Mesh]:
    """Return the bed of a pickup: its floor or cover, and its walls."""
    *_, foot, tail = shape.stations
    length, x, top = foot - tail, (foot + tail) / 2.0, shape.belt_z
    if covered:
        return [
            slab(length - 0.02, shape.width - 0.1, shape.nose_z, deck_z_m, floor, x_m=x, radius_m=0.06, inset_m=0.03)
        ]
    y, z, high = shape.width / 2.0 - 0.1, (shape.nose_z + top) / 2.0, top - shape.nose_z
    inner = (length - 0.12, 2 * y - 0.08)
    parts = [box((*inner, deck_z_m - shape.nose_z), (x, 0.0, (shape.nose_z + deck_z_m) / 2.0), floor)]
    parts += [planks(rng, *inner, deck_z_m, floor, count=7, x_m=x, gap_m=0.03)]
    parts += [box((length, 0.09, high), (x, s * y, z), shape.body) for s in (1.0, -1.0)]
    gate = box((0.08, 2 * y + 0.09, high), (tail + 0.1, 0.0, z), shape.body)
    lamp = np.array([[tail + 0.059, b, c] for b, c in ((0.08, -0.4), (-0.08, -0.4), (-0.08, 0.4), (0.08, 0.4))])
    lamps = [lamp * (1.0, 1.0, high) + (0.0, s * (y - 0.06), z) for s in (1.0, -1.0)]
    return [*parts, gate, panels(lamps, [_TAIL, _TAIL])]
