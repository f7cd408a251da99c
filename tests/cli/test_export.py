"""`landtool export` from the outside: files, what it says, what it refuses."""

from __future__ import annotations

import importlib.util
import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest

from landtool.darknet.cfg import write_cfg
from landtool.darknet.checkpoint import checkpoint_arrays
from landtool.darknet.network import Network
from landtool.darknet.weights import Weights, write_weights
from landtool.detect.detector import Detector, DetectorConfig
from landtool.export import accuracy, write
from landtool.export.onnx_graph import build_model
from landtool.io.labels import LabelledBox, data_yaml, yolo_rows
from landtool.types import Image
from landtool_cli.main import run
from tests.unit.export.trained import NAMES, images, trained

Said = pytest.CaptureFixture[str]
# what an export is compared with: torch only where that is installed
REFERENCES = ("numpy",) if importlib.util.find_spec("torch") is None else ("numpy", "torch")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: a checkpoint, darknet's files, pictures whose labels are what the network finds."""
    monkeypatch.chdir(tmp_path)
    network, weights = trained()
    with Path("best.landtool").open("wb") as file:
        np.savez(file, allow_pickle=False, **checkpoint_arrays(network, weights, NAMES))
    write_cfg(Path("net.cfg"), network)
    write_weights(Path("net.weights"), weights, network)
    Path("net.names").write_text("pad\nsign\n")
    monkeypatch.setattr(write, "trial_pictures", some_pictures)
    return tmp_path


def some_pictures(count: int) -> Iterator[Image]:
    """Noise in place of generated pictures, which take their time."""
    assert count == 20
    yield from images(count)


@pytest.fixture
def dataset(here: Path, capsys: Said) -> Path:
    """The data.yaml of pictures labelled with what the float32 network finds in them."""
    assert run(["export", "best.landtool", "-o", "labels.onnx"]) == 0
    detector = Detector(DetectorConfig(model=Path("labels.onnx"), conf=0.5, iou=0.1))
    for split in ("train", "val"):
        for folder in ("images", "labels"):
            (here / folder / split).mkdir(parents=True)
        for index, image in enumerate(images(6)):
            cv2.imwrite(f"images/{split}/{index}.png", image)
            found = detector.detect(image)[:3]
            boxes = [LabelledBox(NAMES.index(d.label), d.x_min_px, d.y_min_px, d.x_max_px, d.y_max_px) for d in found]
            Path(f"labels/{split}/{index}.txt").write_text(yolo_rows(boxes, image.shape[1], image.shape[0]))
    Path("data.yaml").write_text(data_yaml(NAMES, ("train", "val")))
    capsys.readouterr()
    return here / "data.yaml"


@pytest.mark.parametrize("model", ["best.landtool", "net.weights"])
def test_an_onnx_that_was_compared(model: str, capsys: Said) -> None:
    assert run(["export", model, "-o", "out/a.onnx"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    first, head, *rows = out.splitlines()
    assert first.startswith("out/a.onnx: 0.0 MB")
    assert head.split() == ["reference", "pictures", "raw", "score", "boxes", "box"]
    assert [row.split()[:2] for row in rows] == [[name, "20"] for name in REFERENCES]
    assert Detector(DetectorConfig(model=Path("out/a.onnx"))).names == NAMES


def test_the_same_call_gives_the_same_bytes() -> None:
    for name in ("a.onnx", "b.onnx"):
        assert run(["export", "best.landtool", "-o", name]) == 0
    assert Path("a.onnx").read_bytes() == Path("b.onnx").read_bytes()


def test_another_size() -> None:
    assert run(["export", "best.landtool", "-o", "a.onnx", "--size", "96x64"]) == 0
    assert Detector(DetectorConfig(model=Path("a.onnx"))).imgsz == (96, 64)


def test_darknets_files_come_back_byte_for_byte(capsys: Said) -> None:
    assert run(["export", "best.landtool", "-o", "out/net.weights"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == ["  out/net.cfg", "  out/net.names"]
    for suffix in (".weights", ".cfg", ".names"):
        assert Path("out/net").with_suffix(suffix).read_bytes() == Path("net").with_suffix(suffix).read_bytes()
    assert run(["export", "best.landtool", "-o", "out/net.weights"]) == 2


def test_int8(dataset: Path, capsys: Said) -> None:
    args = ["--int8", "--calibration", str(dataset), "--val", str(dataset)]
    assert run(["export", "best.landtool", "-o", "a.onnx", *args]) == 0
    out = capsys.readouterr().out.splitlines()
    told = out[2 + len(REFERENCES) :]
    assert "6 validation pictures  mAP50" in told[0]
    exact, rounded = (float(line.split()[1]) for line in told[1:3])
    assert exact > 0.9
    assert rounded > exact - 0.005
    kinds = {node.op_type for node in onnx.load("a.onnx").graph.node}
    assert {"QuantizeLinear", "DequantizeLinear"} <= kinds
    Detector(DetectorConfig(model=Path("a.onnx")))


def test_rounding_that_costs_too_much_is_refused(dataset: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accuracy, "MOST_LOSS", -1.0)
    assert run(["export", "best.landtool", "-o", "a.onnx", "--storage", "int8", "--val", str(dataset)]) == 1
    assert "rounding costs " in capsys.readouterr().err
    assert not Path("a.onnx").exists()


def test_a_model_that_differs_is_not_written(capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    def other(network: Network, weights: Weights) -> onnx.ModelProto:
        last = weights.layers[5]
        changed = replace(last, biases=last.biases + np.float32(0.01))
        return build_model(network, Weights({**weights.layers, 5: changed}))

    monkeypatch.setattr(write, "build_model", other)
    assert run(["export", "best.landtool", "-o", "a.onnx"]) == 1
    assert capsys.readouterr().err.startswith("landtool: error: differs from numpy: raw ")
    assert not Path("a.onnx").exists()


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["none.weights", "-o", "a.onnx"], 2, "none.weights: does not exist; "),
        (["net.weights", "-o", "a.pt"], 2, "a.pt: unknown kind of output; use one of .onnx, .weights"),
        (["net.weights"], 2, "missing option '-o' / '--output'"),
        (["lonely.weights", "-o", "a.onnx"], 2, "lonely.weights: there is no lonely.cfg beside it; give it with --cfg"),
        (["lonely.weights", "-o", "a.onnx", "--cfg", "net.cfg"], 2, "lonely.weights: there is no lonely.names beside"),
        (["net.weights", "-o", "a.onnx", "--cfg", "page.cfg"], 1, "page.cfg: line 1: is neither a [section] nor"),
        (["net.weights", "-o", "a.onnx", "--names", "one.names"], 1, "one.names: holds 1 name for 2 classes"),
        (["best.landtool", "-o", "a.onnx", "--cfg", "net.cfg"], 2, "best.landtool: has its own cfg; leave --cfg out"),
        (["best.pt", "-o", "a.onnx"], 1, "best.pt: is pickled, and could run code when opened; give a checkpoint"),
        (["short.weights", "-o", "a.onnx", "--cfg", "net.cfg"], 1, "short.weights: does not fit the cfg: "),
        (["best.landtool", "-o", "a.onnx", "--size", "70x64"], 2, "width = 70 is no multiple of 8"),
        (["best.landtool", "-o", "a.onnx", "--size", "big"], 2, "invalid value for '--size': 'big' is no picture size"),
        (["best.landtool", "-o", "a.onnx", "--int8"], 2, "--int8 needs pictures to choose its scales by"),
        (["best.landtool", "-o", "a.onnx", "--storage", "int8"], 2, "rounding needs labelled pictures"),
        (["best.landtool", "-o", "a.onnx", "--val", "d.yaml"], 2, "--val is for --int8 and --storage only"),
        (["best.landtool", "-o", "a.onnx", "--calibration", "d"], 2, "--calibration is for --int8 only"),
        (["best.landtool", "-o", "a.weights", "--int8"], 2, "a.weights: darknet's weights are float32"),
        (["net.weights", "-o", "net.weights", "--overwrite"], 2, "net.cfg: is the input itself"),
        (["flat.weights", "-o", "a.onnx", "--cfg", "net.cfg", "--names", "net.names"], 1, "its output hardly depends"),
    ],
)
def test_what_it_refuses(args: list[str], code: int, said: str, here: Path, capsys: Said) -> None:
    network, weights = trained()
    data = Path("net.weights").read_bytes()
    Path("lonely.weights").write_bytes(data)
    Path("short.weights").write_bytes(data[:-4])
    Path("one.names").write_text("pad\n")
    Path("page.cfg").write_text("<!DOCTYPE html>\n")
    Path("best.pt").write_bytes(pickle.dumps({"a": 1}, protocol=2))
    for one in weights.layers.values():
        one.kernels[:] = 0
    write_weights(Path("flat.weights"), weights, network)
    before = {path: path.read_bytes() for path in here.iterdir()}
    assert run(["export", *args]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"landtool: error: {said}")
    assert err.count("\n") == 1
    assert {path: path.read_bytes() for path in here.iterdir()} == before
