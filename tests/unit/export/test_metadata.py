from __future__ import annotations

import ast
import hashlib
from datetime import date
from pathlib import Path

import onnx
import pytest

from landtool.detect.detector import Detector, DetectorConfig
from landtool.errors import InputError
from landtool.export.metadata import described, model_entries
from landtool.export.onnx_graph import build_model
from tests.unit.export.trained import NAMES, images, trained

DAY = date(2026, 1, 2)


def test_entries_are_python_literals_other_tools_read() -> None:
    network, _ = trained()
    entries = model_entries(network, NAMES, DAY)
    read = {key: ast.literal_eval(entries[key]) for key in ("stride", "batch", "channels", "imgsz", "names", "args")}
    assert read == {
        "stride": 8,
        "batch": 1,
        "channels": 3,
        "imgsz": [32, 64],
        "names": {0: "pad", 1: "sign"},
        "args": {"dynamic": True, "nms": False},
    }
    assert entries["task"] == "detect"
    assert entries["date"] == "2026-01-02"
    assert entries["landtool.cfg_sha256"] == hashlib.sha256(network.text.encode()).hexdigest()
    assert ast.literal_eval(entries["landtool.anchors"]) == [[[20, 18], [40, 30]], [[4, 6], [9, 8]]]


@pytest.mark.parametrize("letterbox", [True, False])
def test_the_detector_takes_it(letterbox: bool, tmp_path: Path) -> None:
    network, weights = trained(letterbox=letterbox)
    model = described(build_model(network, weights), model_entries(network, NAMES, DAY))
    (tmp_path / "a.onnx").write_bytes(model.SerializeToString())
    detector = Detector(DetectorConfig(model=tmp_path / "a.onnx"))
    assert (detector.names, detector.imgsz, detector.layout) == (NAMES, (64, 32), "yolov8")
    entries = {entry.key: entry.value for entry in model.metadata_props}
    assert entries["landtool.preprocess"] == ("letterbox" if letterbox else "stretch")
    assert {found.label for found in detector.detect(images(1)[0])} <= set(NAMES)


def test_a_changed_network_is_found_out(tmp_path: Path) -> None:
    network, weights = trained()
    model = described(build_model(network, weights), model_entries(network, NAMES, DAY))
    swapped = onnx.ModelProto()
    swapped.CopyFrom(model)
    for entry in swapped.metadata_props:
        if entry.key == "landtool.preprocess":
            entry.value = "stretch"
    (tmp_path / "a.onnx").write_bytes(swapped.SerializeToString())
    with pytest.raises(InputError, match="gives other numbers than when it was exported"):
        Detector(DetectorConfig(model=tmp_path / "a.onnx"))
