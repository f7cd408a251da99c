"""The rows of boxes.csv: every target, found or not, and every false alarm."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from landtool.evaluate.detection import FOUND_IOU
from landtool.evaluate.detection_metrics import ScoredPicture, matched
from landtool.evaluate.matching import NOBODY, Flags, Ints
from landtool.evaluate.set_matching import SetMatches
from landtool.geometry import Array
from landtool.io.tables import Cell, Columns, Row

BOX_COLUMNS: Columns = {
    "part": str,
    "file": str,
    "frame": int,
    "kind": str,
    "label": str,
    "found": int,
    **dict.fromkeys(("score", "iou", "size_px", "distance_m", "fog_per_m", "shadow", "blur_px"), float),
}


def box_rows(pictures: Sequence[ScoredPicture], names: Sequence[str], conf: float, alarm_conf: float) -> Iterator[Row]:
    """Yield the rows of BOX_COLUMNS, picture by picture: its targets, then its false alarms, the highest score first.

    A target is found by a detection of at least `conf` at an IoU of 0.5; score and iou are those of the one that
    matched it, which may have been of a lower score, empty where none did. A false alarm has at least `alarm_conf`;
    its iou is the largest with a target of its class, and what is known of the pad is not known of it. A crowd has no
    row.

    Raises InputError for a detection that is not finite.
    """
    matches = matched(pictures, names, (FOUND_IOU,))
    overlap = matches.pair_iou(0)
    targets = _by_picture(matches.truth_picture, ~matches.crowd, len(pictures))
    wrong = (matches.target[0] == NOBODY) & (matches.score >= alarm_conf)
    alarms = _by_picture(matches.found_picture, wrong, len(pictures))
    for k, picture in enumerate(pictures):
        for i in targets[k]:
            yield _target_row(picture, names, matches, int(i), overlap, conf)
        for i in alarms[k]:
            yield _alarm_row(picture, names, matches, int(i))


def _by_picture(picture: Ints, chosen: Flags, count: int) -> list[Ints]:
    """Return the indices of those chosen, of each picture; picture: (N,), ascending."""
    index = np.flatnonzero(chosen)
    return np.split(index, np.searchsorted(picture[index], np.arange(1, count)))


def _target_row(
    picture: ScoredPicture, names: Sequence[str], matches: SetMatches, i: int, overlap: Array, conf: float
) -> Row:
    by = int(matches.detection[0, i])
    score = None if by == NOBODY else float(matches.score[by])
    iou = None if by == NOBODY else float(overlap[by])
    found = int(score is not None and score >= conf)
    facts = picture.facts
    known = facts.distance_m, facts.fog_per_m, facts.shadow, facts.blur_px
    label = names[matches.truth_class[i]]
    return *_where(picture), "target", label, found, score, iou, _side(matches.truth[i]), *known


def _alarm_row(picture: ScoredPicture, names: Sequence[str], matches: SetMatches, i: int) -> Row:
    label, facts = names[matches.found_class[i]], picture.facts
    score, iou = float(matches.score[i]), float(matches.found_iou[i])
    known = None, facts.fog_per_m, None, facts.blur_px
    return *_where(picture), "false_alarm", label, None, score, iou, _side(matches.found[i]), *known


def _where(picture: ScoredPicture) -> tuple[Cell, ...]:
    return picture.part, picture.file, picture.frame


def _side(box: Array) -> float:
    """Return the longer side, pixels."""
    return float((box[2:] - box[:2]).max())
