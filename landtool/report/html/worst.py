"""Which frames a page shows as its worst: of every kind of trouble, and far enough apart in time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

MOST = 12


@dataclass(frozen=True)
class Fault:
    """Something that went wrong at a moment. size: how much, for comparing faults of one kind. words: what it was.

    place: of the moment's recording, "" where a page has one; at: its time, apart from others of the same place.
    frame: its place in the flight, or a frame number.
    """

    kind: str
    size: float
    words: str
    at: float
    frame: int
    place: str = ""


@dataclass(frozen=True)
class Moment:
    """One frame to show, and everything that went wrong in it."""

    fault: Fault
    words: tuple[str, ...]


def worst(faults: Sequence[Fault], apart: float, most: int = MOST) -> list[Moment]:
    """Return up to `most` moments in order of time: the worst of each kind in turn, no two nearer than `apart`.

    apart: in the unit of `at`. Kinds come in the order in which they first appear, which is that of their weight.
    """
    kinds: dict[str, list[Fault]] = defaultdict(list)
    for fault in faults:
        kinds[fault.kind].append(fault)
    queues = [sorted(of, key=lambda fault: -fault.size) for of in kinds.values()]
    chosen: list[Fault] = []
    while any(queues) and len(chosen) < most:
        for queue in queues:
            while queue and len(chosen) < most:
                fault = queue.pop(0)
                if all(fault.place != c.place or abs(fault.at - c.at) >= apart for c in chosen):
                    chosen.append(fault)
                    break
    chosen.sort(key=lambda fault: (fault.place, fault.at))
    return [Moment(fault, _words(fault, faults)) for fault in chosen]


def length(metres: float) -> str:
    """Return a length with the digits that tell something: below a decimetre in millimetres."""
    return f"{1000.0 * metres:.2g} mm" if metres < 0.0995 else f"{metres:.2f} m"


def _words(shown: Fault, faults: Sequence[Fault]) -> tuple[str, ...]:
    same = [f.words for f in faults if (f.place, f.frame) == (shown.place, shown.frame) and f is not shown]
    return tuple(dict.fromkeys((shown.words, *same)))
