"""The detector: accuracy on path-traced and on our own pictures, recall in fog, and time against the bare network.

`python -m bench detect` measures the network in the package. To see another one, and its float32 and int8 forms beside
each other: `python -m bench.detect [--model MODEL.onnx] [--fp32 MODEL.onnx --int8 MODEL.onnx] [--data DIR/data.yaml]`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from bench.detect_sets import PictureSet, own_clips, own_fog_set, own_test_set, path_traced_sets, yolo_set
from bench.detect_speed import Followed, Network, print_speed
from bench.show import table
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import Detector
from landtool.detect.stage import DetectStage
from landtool.evaluate.detection import IOUS, DetectionScore, SizeRecall, score_detections
from landtool.pad import PadSpec
from landtool.types import Detection, Frame, Image

SCORED_CONF = 0.001  # least score of a box that counts in the average precision
LEAST_PX = 14.0  # targets from here on must be found

Finder = Callable[[Image], Sequence[Detection]]


def main(arguments: Sequence[str] = ()) -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(prog="python -m bench.detect")
    parser.add_argument("--model", type=Path, help="another network than that of the package")
    parser.add_argument("--fp32", type=Path, help="the same network in float32, for the comparison")
    parser.add_argument("--int8", type=Path, help="the same network in int8, for the comparison")
    parser.add_argument("--data", type=Path, help="a YOLO dataset whose split `test` is scored, too")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)  # as the networks: one
    sets = [*path_traced_sets(), own_test_set(), own_fog_set()]
    if options.data is not None:
        sets.append(yolo_set(options.data, "test"))
    detector = Detector(DetectorConfig(model=options.model, conf=SCORED_CONF))
    name = "Shipped network" if options.model is None else options.model.name
    print_scores(f"{name} alone", [score_set(detector.detect, each) for each in sets])
    print_scores(f"{name}, as `landtool detect` uses it", [score_set(on_print(detector), each) for each in sets])
    given = (("fp32", options.fp32), ("int8", options.int8))
    networks = [Network(name, path) for name, path in given if path is not None]
    networks = networks or [Network("shipped" if options.model is None else options.model.name, options.model)]
    _print_variants(networks, [*sets, *own_clips()])
    print_speed(networks)


def on_print(detector: Detector) -> Finder:
    """Return what `landtool detect` does in single pictures: boxes where the print is seen, doubted where it is not."""
    stage = DetectStage(detector, ring_of=PadSpec(), least_score=SCORED_CONF)
    return lambda image: stage.find(Frame(0, None, image)).detections


def _print_variants(networks: Sequence[Network], sets: Sequence[PictureSet]) -> None:
    """Print what other ways to run the same network cost in accuracy; single pictures have no regions to follow."""
    rows = []
    for pictures in sets:
        cells = [pictures.name, str(len(pictures.truth))]
        for network in networks:
            detector = Detector(DetectorConfig(model=network.path, conf=SCORED_CONF))
            cells.append(_cell(score_set(detector.detect, pictures).score.map50))
            cells.append(_cell(score_set(Followed(detector).detect, pictures).score.map50) if pictures.clip else "-")
        rows.append(cells)
    names = [f"{network.name}{way}" for network in networks for way in ("", ", regions")]
    table(
        "mAP50 of the same pictures: whole frames, and regions where a target was seen",
        ["set", "pictures", *names],
        rows,
    )


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


if __name__ == "__main__":
    main(sys.argv[1:])
