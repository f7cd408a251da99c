"""Time of the metric code of boxes against that of the network that finds them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from bench.detect_sets import FIXTURES
from bench.show import table
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import Detector
from landtool.evaluate.boxes import box_rows
from landtool.evaluate.detection_metrics import ScoredPicture, detection_curve, detection_metrics
from landtool.evaluate.stills_truth import read_stills_truth
from landtool.io.images import read_picture
from landtool.io.labels import read_yolo
from landtool.io.tables import format_cell
from landtool.types import Image

PICTURES = 1120
SCORED_CONF, CONF, ALARM_CONF = 0.001, 0.25, 0.5
ROUNDS = 5
GOAL = 0.05  # of the network's time
NAMES = ("pad",)


def main() -> None:
    """Print all tables."""
    cv2.setNumThreads(1)  # as the network: one
    detector = Detector(DetectorConfig(conf=SCORED_CONF, threads=1))
    images, stills = _stills(detector)
    rng = np.random.default_rng(0)
    drawn = [replace(stills[i], unit=k, file=str(k)) for k, i in enumerate(rng.integers(len(stills), size=PICTURES))]
    ways: dict[str, Callable[[], object]] = {
        "metrics, intervals, parts": lambda: detection_metrics(drawn, NAMES, conf=CONF, alarm_conf=ALARM_CONF),
        "curve": lambda: detection_curve(drawn, NAMES),
        "rows of boxes.csv": lambda: [
            ",".join(map(format_cell, row)) for row in box_rows(drawn, NAMES, CONF, ALARM_CONF)
        ],
    }
    network_s, best_s = np.inf, dict.fromkeys(ways, np.inf)
    for _ in range(ROUNDS):  # in turns, so that what else the machine does costs all the same
        network_s = min(network_s, _spent(lambda: [detector.detect(image) for image in images]))
        for name, way in ways.items():
            best_s[name] = min(best_s[name], _spent(way))
    network_s *= PICTURES / len(images)
    found = np.mean([len(picture.found) for picture in drawn])
    rows = [[name, f"{spent:.3f}", f"{100 * spent / network_s:.2f} %"] for name, spent in best_s.items()]
    total = sum(best_s.values())
    rows.append(["together", f"{total:.3f}", f"{100 * total / network_s:.2f} %"])
    rows.append(["the network", f"{network_s:.3f}", "100 %"])
    said = f"{PICTURES} pictures, {found:.1f} boxes of {SCORED_CONF:g} and more each, one thread"
    table(f"{said}: best of {ROUNDS} rounds in turns; goal {100 * GOAL:g} %", ["work", "s", "of the network"], rows)


def _stills(detector: Detector) -> tuple[list[Image], list[ScoredPicture]]:
    """Return the shipped stills, and what the network finds in them."""
    folder = FIXTURES / "stills"
    truth, dataset = read_stills_truth(folder / "truth.csv"), read_yolo(folder / "data.yaml")
    images, pictures = [], []
    for split in dataset.splits:
        for labelled in dataset.read(split):
            file = labelled.path.relative_to(folder).as_posix()
            images.append(read_picture(labelled.path).image)
            found = detector.detect(images[-1])
            pictures.append(ScoredPicture(split, file, None, file, labelled, found, truth[file].facts))
    return images, pictures


def _spent(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
