"""The shipped network on the shipped recordings: what a user of `landtool detect` gets, against exact truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.detect.config import DetectorConfig
from landtool.detect.detector import Detector
from landtool.detect.stage import DetectStage
from landtool.evaluate.detection import DetectionScore, score_detections
from landtool.io.labels import LabelledImage, read_yolo
from landtool.pad import PadSpec
from landtool.types import Frame
from landtool_cli.main import run
from tests.golden.clip import FIXTURES
from tests.shared import ROOT

PACKAGE_MB = 12.0


@pytest.fixture(scope="module")
def stage() -> DetectStage:
    return DetectStage(Detector(DetectorConfig(conf=0.01)), ring_of=PadSpec(), least_score=0.01)


@pytest.fixture(scope="module")
def stills(stage: DetectStage) -> DetectionScore:
    data = read_yolo(FIXTURES / "stills" / "data.yaml")
    truth: list[LabelledImage] = [image for split in data.splits for image in data.read(split)]
    frames = [Frame(0, None, np.asarray(cv2.imread(str(image.path)), np.uint8)) for image in truth]
    return score_detections(truth, [stage.find(frame).detections for frame in frames], data.names)


def test_the_network_is_small_enough_to_ship() -> None:
    assert sum(path.stat().st_size for path in (ROOT / "landtool" / "models").iterdir()) < PACKAGE_MB * 1e6


def test_stills_are_found(stills: DetectionScore) -> None:
    assert stills.targets > 30
    assert (stills.map50 or 0.0) > 0.9
    assert (stills.map50_95 or 0.0) > 0.8
    assert (stills.recall_from(20.0) or 0.0) > 0.9


def test_the_landing_is_seen_from_its_first_frame_to_its_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["detect", str(ROOT / "datasets" / "fixtures" / "approach.mp4"), "-o", "found", "--save", "csv"]) == 0
    assert "frames 120, with a box 120 (100.0%)" in capfd.readouterr().out
    rows = (tmp_path / "found" / "approach" / "detections.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == "frame,t_ns,label,score,x_min_px,y_min_px,x_max_px,y_max_px"
    assert {int(row.split(",")[0]) for row in rows[1:]} == set(range(120))
