"""The detector: accuracy on path-traced and on our own pictures, recall in fog, and time against the bare network."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bench.detect_sets import PictureSet
from bench.show import table
from landtool.evaluate.detection import IOUS, DetectionScore, SizeRecall, score_detections
from landtool.types import Detection, Image

SCORED_CONF = 0.001  # least score of a box that counts in the average precision
LEAST_PX = 14.0  # targets from here on must be found

Finder = Callable[[Image], Sequence[Detection]]


@dataclass(frozen=True, eq=False)
class Scored:
    """What a detector found in each picture of a set, and how good that is."""

    pictures: PictureSet
    found: Sequence[Sequence[Detection]]
    score: DetectionScore


def score_set(find: Finder, pictures: PictureSet) -> Scored:
    """Run a detector on a set; it must give boxes down to scores of SCORED_CONF."""
    found = [tuple(find(pictures.picture(i))) for i in range(len(pictures.truth))]
    return Scored(pictures, found, score_detections(pictures.truth, found, pictures.names))


def print_scores(title: str, scores: Sequence[Scored]) -> None:
    """Print the tables of how good a detector is on some sets."""
    first = scores[0].score
    head = ["set", "pictures", "targets", "mAP50", "mAP50-95", "precision", "recall", f">= {LEAST_PX:g} px", "mean IoU"]
    alarms = f"alarms > {first.alarm_conf:g}"
    table(
        f"{title}: precision and recall at conf {first.conf:g}, IoU 0.5; false alarms, and those where nothing is",
        [*head, alarms, "on nothing"],
        [_main_row(scored) for scored in scores],
    )
    table(
        f"{title}: recall by the target's longer side, px",
        ["set", *map(_size_name, first.sizes)],
        [[scored.pictures.name, *map(_size_cell, scored.score.sizes)] for scored in scores],
    )
    table(
        f"{title}: average precision by IoU",
        ["set", *(f"{iou:.2f}" for iou in IOUS)],
        [[scored.pictures.name, *map(_cell, scored.score.ap_by_iou)] for scored in scores],
    )


def _main_row(scored: Scored) -> list[str]:
    score = scored.score
    values = (score.map50, score.map50_95, score.precision, score.recall, score.recall_from(LEAST_PX), score.mean_iou)
    alarms = score.false_alarms
    counts = [str(len(alarms)), str(sum(alarm.background for alarm in alarms))]
    return [scored.pictures.name, str(score.pictures), str(score.targets), *map(_cell, values), *counts]


def _size_name(size: SizeRecall) -> str:
    return f">= {size.low_px:g}" if size.high_px == float("inf") else f"{size.low_px:g}-{size.high_px:g}"


def _size_cell(size: SizeRecall) -> str:
    return f"{size.found}/{size.targets}" if size.targets else "-"


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"
