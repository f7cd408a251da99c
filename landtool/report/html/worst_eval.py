"""What went wrong in an evaluation, by truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from landtool.io.tables import Cell, ReadTable
from landtool.report.html.worst import Fault, length

# Smaller errors trouble no landing: a page of them would only look like trouble
_PLACE_SHARE, _PLACE_M, _NORMAL_DEG = 0.01, 0.01, 2.0
UNNOTABLE = (
    "no flip, no miss, no false alarm, no place off by more than "
    f"{_PLACE_SHARE:.0%} of the distance and {100 * _PLACE_M:g} cm, no tilt off by more than {_NORMAL_DEG:g} deg"
)
_KINDS = ("flip", "miss", "missed target", "false alarm", "place", "normal")  # the weightiest first


def evaluation_faults(tables: Mapping[str, ReadTable]) -> list[Fault]:
    """Return flips, misses, false alarms and notable errors; `place` is the clip or part and the file in it."""
    found: list[Fault] = []
    if poses := tables.get("pose_errors.csv"):
        found += _poses(poses)
    if boxes := tables.get("boxes.csv"):
        found += _boxes(boxes, {(fault.place, fault.frame): fault.at for fault in found})
    return sorted(found, key=lambda fault: _KINDS.index(fault.kind))


def _poses(table: ReadTable) -> Iterator[Fault]:
    for row in _rows(table):
        clip, frame, at = str(row["clip"] or ""), _whole(row["frame"]), _number(row["t_ns"]) / 1e9
        distance_m, place_m, normal_deg = (_number(row[name]) for name in ("distance_m", "place_m", "normal_deg"))
        method = str(row["method"] or "")
        away = f"at {distance_m:.1f} m"
        if row["flipped"]:
            words = f"the pad is mirrored or turned by half {away}: tilt {normal_deg:.0f} deg off, by {method}"
            yield Fault("flip", max(normal_deg, 1.0), words, at, frame, clip)
        if not method and _number(row["visible"]) > 0.0:
            yield Fault("miss", -distance_m, f"no pose of the pad {away}", at, frame, clip)
        if distance_m > 0.0 and place_m > max(_PLACE_M, _PLACE_SHARE * distance_m):
            share = 100.0 * place_m / distance_m
            words = f"the pad's place {length(place_m)} off {away} ({share:.2g} %), by {method}"
            yield Fault("place", share, words, at, frame, clip)
        if normal_deg > _NORMAL_DEG:
            yield Fault(
                "normal", normal_deg, f"the pad's tilt {normal_deg:.1f} deg off {away}, by {method}", at, frame, clip
            )


def _boxes(table: ReadTable, times: Mapping[tuple[str, int], float]) -> Iterator[Fault]:
    """Yield misses and false alarms; those of a clip at the frame's time, by (clip, frame)."""
    for row in _rows(table):
        frame = _whole(row["frame"])
        file = str(row["file"] or "")
        part = str(row["part"] or "")
        place = part if Path(file).stem == part else f"{part}/{file}".strip("/")
        at = times.get((place, frame), float(frame))
        score, size_px = _number(row["score"]), _number(row["size_px"])
        if row["kind"] == "false_alarm":
            words = f"false alarm: {row['label'] or 'a box'} of score {score:.2f} where there is none"
            yield Fault("false alarm", score, words, at, frame, place)
        elif row["kind"] == "target" and not row["found"]:
            size = f" of {size_px:.0f} px" if size_px > 0.0 else ""
            words = f"missed: the detector did not find a {row['label'] or 'target'}{size}"
            yield Fault("missed target", size_px, words, at, frame, place)


def _rows(table: ReadTable) -> Iterator[dict[str, Cell]]:
    names = list(table.columns)
    for values in zip(*table.columns.values(), strict=True):
        yield dict(zip(names, values, strict=True))


def _number(value: Cell) -> float:
    """Return a cell's number, 0 where it is unknown."""
    return 0.0 if value is None else float(value)


def _whole(value: Cell) -> int:
    return 0 if value is None else int(value)
