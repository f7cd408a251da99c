from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from landtool.darknet.cfg import parse_cfg, write_cfg
from landtool.darknet.forward import raw_heads
from landtool.darknet.network import Network
from landtool.darknet.weights import Floats, Weights, write_weights
from landtool.export.onnx_graph import build_model
from landtool.export.parity import ParityError, compare
from landtool.export.pictures import prepared, smaller_size, trial_pictures
from tests.unit.darknet.networks import random_weights, settled, tiny_yolov3
from tests.unit.export.trained import images, noise, trained


def test_an_equal_model_passes() -> None:
    network, weights = trained()
    (parity,) = compare(network, weights, build_model(network, weights), images(8))
    assert parity.is_equal
    assert (parity.reference, parity.pictures) == ("numpy", 8)
    assert parity.boxes > 8
    assert 0 < parity.raw < 1e-4


def with_biases(network: Network, weights: Weights, index: int, change: float) -> onnx.ModelProto:
    layers = dict(weights.layers)
    layers[index] = replace(layers[index], biases=layers[index].biases + np.float32(change))
    return build_model(network, Weights(layers))


@pytest.mark.parametrize(("index", "change"), [(10, 0.001), (0, 0.01), (5, np.nan)])
def test_a_model_that_is_a_little_off_is_refused(index: int, change: float) -> None:
    network, weights = trained()
    with pytest.raises(ParityError, match=r"differs from numpy: raw .* nothing was written") as raised:
        compare(network, weights, with_biases(network, weights, index, change), images(2))
    assert raised.value.exit_code == 1


@pytest.mark.parametrize("head", [6, 11])
def test_wrong_anchors_are_seen_in_the_boxes(head: int) -> None:
    network, weights = trained()
    model = build_model(network, weights)
    for constant in model.graph.initializer:
        if constant.name == f"layer{head}_anchors":
            constant.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(constant) * np.float32(1.2), constant.name))
    with pytest.raises(ParityError, match=r"raw \S+e-0[5-9] .*boxes \d"):
        compare(network, weights, model, images(4))


def test_other_references_count_too() -> None:
    network, weights = trained()

    def same(given: Floats) -> Sequence[Floats]:
        return raw_heads(network, weights, given)

    def off(given: Floats) -> Sequence[Floats]:
        return [head + np.float32(0.01) for head in same(given)]

    model = build_model(network, weights)
    assert [one.reference for one in compare(network, weights, model, images(2), {"torch": same})] == ["numpy", "torch"]
    with pytest.raises(ParityError, match="differs from torch"):
        compare(network, weights, model, images(2), {"torch": off})


@pytest.mark.full  # loads torch
def test_torch_agrees() -> None:
    torch = pytest.importorskip("torch")
    model = pytest.importorskip("landtool.train.model")
    network, weights = trained()
    net = model.TinyYolo(network)
    net.load(weights)
    net.eval()

    def forward(given: Floats) -> Sequence[Floats]:
        with torch.no_grad():
            found = net(torch.from_numpy(given))
        return [raw.permute(0, 1, 4, 2, 3).flatten(1, 2).numpy() for raw in found]

    assert all(
        one.is_equal for one in compare(network, weights, build_model(network, weights), images(4), {"torch": forward})
    )


@pytest.mark.full  # renders
def test_the_trial_pictures() -> None:
    first, second, again = [*trial_pictures(2), next(trial_pictures(1))]
    assert np.array_equal(first, again)
    assert first.shape[0] != first.shape[1]
    assert second.shape != first.shape
    # the pad is larger than the frame, which it covers: white paper or red ring to its corners
    blue, green, red = first.astype(int).transpose(2, 0, 1)
    ring = (red > 1.5 * green) & (red > 1.5 * blue)
    assert ring[:, :80].any()
    assert ring[:, -80:].any()
    assert ring[:120].any()
    assert ring[-120:].any()


def test_inputs_are_as_the_network_wants_them() -> None:
    network, _ = trained()
    assert smaller_size(network) == (32, 16)
    given, placement = prepared(network, np.full((64, 64, 3), (10, 20, 30), np.uint8))
    assert given.shape == (1, 3, 32, 64)
    assert (placement.left, placement.right) == (16, 48)
    np.testing.assert_allclose(given[0, :, 5, 30] * 255, (30, 20, 10), rtol=1e-6)


@pytest.mark.full
def test_opencv_4_reads_the_same_network(tmp_path: Path) -> None:
    """OpenCV 4.14 still imports darknet's files; LANDTOOL_OPENCV4 names a Python that has it.

    It adds 1e-6 to batch norm's variances where darknet adds 1e-5, so it is given variances that are larger by 9e-6.
    """
    python = os.environ.get("LANDTOOL_OPENCV4")
    if not python:
        pytest.skip("LANDTOOL_OPENCV4 names no Python")
    network = parse_cfg(tiny_yolov3(1))
    given = noise(1, (416, 416))
    weights = settled(network, random_weights(network, 3), given)
    write_cfg(tmp_path / "n.cfg", network)
    larger = {
        index: replace(one, variances=None if one.variances is None else one.variances + np.float32(9e-6))
        for index, one in weights.layers.items()
    }
    write_weights(tmp_path / "n.weights", Weights(larger), network)
    np.save(tmp_path / "given.npy", given)
    script = (
        "import cv2, numpy as np\n"
        "net = cv2.dnn.readNetFromDarknet('n.cfg', 'n.weights')\n"
        "net.enableWinograd(False)\n"  # which trades digits for speed
        "net.setInput(np.load('given.npy'))\n"
        "heads = net.forward(['conv_15', 'conv_22'])\n"
        "np.savez('found.npz', *heads)\n"
    )
    subprocess.run([python, "-c", script], cwd=tmp_path, check=True, timeout=120)
    with np.load(tmp_path / "found.npz") as found:
        for name, expected in zip(found.files, raw_heads(network, weights, given), strict=True):
            np.testing.assert_allclose(found[name], expected, rtol=1e-4, atol=1e-4)
