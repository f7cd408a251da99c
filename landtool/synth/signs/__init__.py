"""Signs and things that resemble the pad, from near misses to what only has its colours."""

from __future__ import annotations

from collections.abc import Callable

from numpy.random import Generator

from landtool.errors import UsageError
from landtool.pad import PadSpec
from landtool.synth.grime import soil_picture, wear_off
from landtool.synth.signs import lookalikes, objects, traffic
from landtool.synth.signs.canvas import Picture

Painter = Callable[[Generator, PadSpec], Picture]

LOOKALIKES: dict[str, Painter] = {
    "empty-ring": lookalikes.empty_ring,
    "ring-letter": lookalikes.ring_letter,
    "ring-word": lookalikes.ring_word,
    "ring-tag": lookalikes.ring_tag,
    "other-ring": lookalikes.other_ring,
    "thin-ring": lookalikes.thin_ring,
    "letter-alone": lookalikes.letter_alone,
    "letter-in-square": lookalikes.letter_in_square,
    "light-on-dark": lookalikes.light_on_dark,
    "dashed-ring": lookalikes.dashed_ring,
    "red-disc": lookalikes.red_disc,
    "target-rings": lookalikes.target_rings,
    "double-ring": lookalikes.double_ring,
    "tag-on-board": lookalikes.tag_on_board,
    "small-family-tag": lookalikes.small_family_tag,
    "painted-helipad": lookalikes.painted_helipad,
    "triangle-helipad": lookalikes.triangle_helipad,
    "hospital-cross": lookalikes.hospital_cross,
    "speed-limit": traffic.speed_limit,
    "lifebuoy": objects.lifebuoy,
}
_OTHERS: dict[str, Painter] = {
    "no-entry": traffic.no_entry,
    "no-parking": traffic.no_parking,
    "forbidden": traffic.forbidden,
    "mandatory": traffic.mandatory,
    "warning": traffic.warning,
    "give-way": traffic.give_way,
    "stop": traffic.stop,
    "priority": traffic.priority,
    "end-of-limit": traffic.end_of_limit,
    "parking": traffic.parking,
    "disabled": traffic.disabled,
    "road-arrow": traffic.road_arrow,
    "crosswalk": traffic.crosswalk,
    "hatching": traffic.hatching,
    "lettering": traffic.lettering,
    "number-plate": traffic.number_plate,
    "manhole": objects.manhole,
    "drain": objects.drain,
    "tyre": objects.tyre,
    "wreath": objects.wreath,
    "coiled-hose": objects.coiled_hose,
    "chessboard": objects.chessboard,
    "charuco": objects.charuco,
    "matrix-code": objects.matrix_code,
    "survey-marker": objects.survey_marker,
    "poster": objects.poster,
}
SIGNS: dict[str, Painter] = LOOKALIKES | _OTHERS
"""Every kind of sign by name; `LOOKALIKES` are those a detector mistakes for the pad most easily."""

PAINTED = frozenset({"road-arrow", "crosswalk", "hatching", "painted-helipad", "triangle-helipad", "hospital-cross"})
"""Kinds that are paint on the ground, several metres large."""
FLAT = PAINTED | {"manhole", "drain", "lettering"}
"""Kinds that lie on the ground only, never on a board or a vehicle."""

_LOOKALIKE_SHARE = 0.6


def make_sign(name: str, rng: Generator, pad: PadSpec) -> Picture:
    """Paint one sign of a kind, worn and dirty: (256, 256, 4) uint8, sRGB albedo, blue first, and coverage.

    Raises UsageError for a name that is not in `SIGNS`.
    """
    if name not in SIGNS:
        raise UsageError(f"there is no sign '{name}'", hint=f"known: {', '.join(SIGNS)}")
    picture = SIGNS[name](rng, pad)
    if rng.random() < 0.8:
        soil_picture(picture, rng, float(rng.random()))
    if name in PAINTED or rng.random() < 0.1:
        wear_off(picture, rng)
    return picture


def random_sign(rng: Generator, pad: PadSpec) -> tuple[str, Picture]:
    """Paint a sign of a random kind, more often one like the pad. Returns its name and `make_sign`'s picture."""
    names = list(LOOKALIKES if rng.random() < _LOOKALIKE_SHARE else _OTHERS)
    name = names[int(rng.integers(len(names)))]
    return name, make_sign(name, rng, pad)
