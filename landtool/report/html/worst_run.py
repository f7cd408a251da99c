"""What went wrong in a run, frame by frame, as the run itself can tell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from landtool.report.gaps import NOTABLE_S
from landtool.report.html.flight import Flight
from landtool.report.html.worst import Fault, length

_MISFIT_PX = 3.0  # a corner further off than this was not misread by noise
_AMBIGUOUS = 0.8  # the two solutions of a pose fit nearly alike
_RESIDUAL_M = 0.05  # what a landing does not feel
UNNOTABLE = (
    f"no gap over {NOTABLE_S:g} s, no lost or damaged picture, no prediction off by more than {100 * _RESIDUAL_M:g} cm"
)
_MOST_RESIDUALS = 200  # to choose from: more than a page could show
_HANDOVERS = ("near stage:", "far stage:")  # reasons that tell of a change of stage, which is nothing wrong


def run_faults(flight: Flight) -> list[Fault]:
    """Return the faults of a run, the weightiest kind first."""
    return [
        *_gaps(flight),
        *_pictures(flight),
        *_residuals(flight),
        *_refused(flight),
        *_values(flight, "misfit", flight.reproj_px, _MISFIT_PX, "corners {:.1f} px from their places (RMS)"),
        *_values(flight, "ambiguity", flight.ambiguity, _AMBIGUOUS, "the mirror pose fits nearly as well, {:.2f}"),
        *_reasons(flight),
    ]


def _gaps(flight: Flight) -> Iterator[Fault]:
    """Say where the pad was not measured for a time that matters, in the gap's middle."""
    missing = [i for i, method in enumerate(flight.method) if not method]
    start = 0
    while start < len(missing):
        end = start
        while end + 1 < len(missing) and missing[end + 1] == missing[end] + 1:
            end += 1
        first, last = missing[start], missing[end]
        start = end + 1
        yield from _gap(flight, first, last)


def _gap(flight: Flight, first: int, last: int) -> Iterator[Fault]:
    before, after = max(0, first - 1), min(len(flight) - 1, last + 1)
    length = float(flight.at[after] - flight.at[before])
    if not np.isfinite(length) or (flight.has_clock and length <= NOTABLE_S):
        return
    proven = all(state in ("confirmed", "coasting") for state in flight.state[first : last + 1])
    bridged = "bridged by prediction" if proven else "and no track that foretold its place"
    unit = f"{length:.1f} s" if flight.has_clock else f"{last - first + 1} frames"
    middle = (first + last) // 2
    words = f"the pad was not measured for {unit}, {bridged}"
    yield Fault("gap", length * (1.0 if proven else 10.0), words, float(flight.at[middle]), middle)


def _pictures(flight: Flight) -> Iterator[Fault]:
    for i, (has, status) in enumerate(zip(flight.has_picture, flight.status, strict=True)):
        if not has or status == "damaged":
            words = "the picture is damaged" if has else "no picture could be got from the recording"
            yield _at(flight, "picture", 1.0 if has else 2.0, words, i)


def _residuals(flight: Flight) -> Iterator[Fault]:
    """The largest prediction errors that matter."""
    known = np.flatnonzero(np.isfinite(flight.residual_m))
    if not len(known):
        return
    median = float(np.median(flight.residual_m[known]))
    known = known[flight.residual_m[known] > _RESIDUAL_M]
    for i in known[np.argsort(-flight.residual_m[known], kind="stable")][:_MOST_RESIDUALS]:
        size = float(flight.residual_m[i])
        made = f"the prediction made {flight.horizon_s:g} s before" if flight.horizon_s else "the prediction"
        yield _at(flight, "prediction", size, f"{made} was {length(size)} off (median {length(median)})", int(i))


def _refused(flight: Flight) -> Iterator[Fault]:
    for i, (method, state) in enumerate(zip(flight.method, flight.state, strict=True)):
        if method and state == "coasting":
            distance_m = float(flight.distance_m[i])
            words = f"a pose by {method} at {distance_m:.1f} m did not go into the track"
            yield _at(flight, "refused", distance_m, words, i)


def _values(flight: Flight, kind: str, values: np.ndarray, limit: float, words: str) -> Iterator[Fault]:
    for i in np.flatnonzero(values > limit):
        yield _at(flight, kind, float(values[i]), words.format(float(values[i])), int(i))


def _reasons(flight: Flight) -> Iterator[Fault]:
    """What the run wrote down of frames, each text once, in the middle of its frames."""
    frames: dict[str, list[int]] = {}
    for i, reason in enumerate(flight.reason):
        if reason and not reason.startswith(_HANDOVERS):
            frames.setdefault(reason, []).append(i)
    for reason, of in frames.items():
        yield _at(flight, "reason", float(len(of)), reason, of[len(of) // 2])


def _at(flight: Flight, kind: str, size: float, words: str, i: int) -> Fault:
    at = float(flight.at[i])
    return Fault(kind, size, words, at if np.isfinite(at) else 0.0, i)
