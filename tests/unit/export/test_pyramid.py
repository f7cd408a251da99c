from __future__ import annotations

import numpy as np
import pytest

from landtool.darknet.edit import edited
from landtool.darknet.forward import forward, halved
from landtool.detect.model_file import parse_model
from landtool.detect.session import Session
from landtool.export.onnx_graph import INPUT, Rounding, build_model
from landtool.export.parity import compare
from landtool.export.pyramid import looking, with_half_size
from landtool.export.quantize import choose_rounding
from landtool.types import Image
from tests.unit.export.trained import noise, trained


# of the last, half a side is no whole number of cells
@pytest.mark.parametrize("size", [(64, 32), (32, 64), (128, 96), (40, 24)])
def test_both_looks_are_those_of_the_reference(size: tuple[int, int]) -> None:
    network, weights = trained()
    network = edited(network, pyramid=True)
    model = with_half_size(build_model(network, weights), network)
    given = noise(1, size)
    found = Session(parse_model(model.SerializeToString())).run(given).arrays[0]
    expected = forward(network, weights, given)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_a_fixed_size_knows_how_many_boxes_it_gives() -> None:
    network, weights = trained()
    network = edited(network, pyramid=True)
    model = with_half_size(build_model(network, weights, size=(40, 24)), network)
    session = Session(parse_model(model.SerializeToString()))
    assert session.run(noise(1, (40, 24))).arrays[0].shape == session.model.outputs[0].shape


def test_the_weights_are_there_once() -> None:
    network, weights = trained()
    once = build_model(network, weights)
    twice = looking(once, edited(network, pyramid=True))
    assert looking(once, network) is once
    kernels = sum(layer.parameters for _, layer in network.convolutions) * 4
    assert twice.ByteSize() - once.ByteSize() < 0.5 * kernels + 20000


def test_a_second_look_in_eight_bits_shares_the_scales() -> None:
    network, weights = trained()
    network = edited(network, pyramid=True)
    given = [noise(1), halved(network, noise(1))]
    rounding = choose_rounding(network, weights, given)
    assert isinstance(rounding, Rounding)
    assert INPUT in rounding.scales
    model = with_half_size(build_model(network, weights, rounding=rounding), network)
    found = Session(parse_model(model.SerializeToString())).run(noise(1)).arrays[0]
    expected = forward(network, weights, noise(1))
    assert found.shape == expected.shape
    assert np.corrcoef(found[0, 4:].ravel(), expected[0, 4:].ravel())[0, 1] > 0.9


def test_the_gate_compares_both_looks() -> None:
    network, weights = trained()
    network = edited(network, pyramid=True)
    rng = np.random.default_rng(3)
    pictures: list[Image] = [rng.integers(0, 256, (h, w, 3)).astype(np.uint8) for h, w in ((32, 64), (50, 40))]
    (parity,) = compare(network, weights, build_model(network, weights), pictures)
    assert parity.is_equal
