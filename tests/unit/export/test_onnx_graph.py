from __future__ import annotations

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.forward import decode, forward, raw_heads
from landtool.darknet.weights import Floats, Weights
from landtool.detect.model_file import parse_model
from landtool.detect.session import Session
from landtool.errors import InputError
from landtool.export.onnx_graph import Rounding, build_model, column_count
from landtool.export.rounding import Storage
from tests.unit.darknet.networks import SMALL, layer, random_weights
from tests.unit.export.trained import noise, trained


def run(model: onnx.ModelProto, given: Floats) -> Floats:
    """Run a model that may take one picture at a time only."""
    session = Session(parse_model(model.SerializeToString()))
    return np.concatenate([session.run(given[i : i + 1]).arrays[0] for i in range(len(given))])


@pytest.mark.parametrize("size", [(64, 32), (32, 32), (128, 96), (8, 8)])
def test_gives_what_the_network_gives_at_any_size(size: tuple[int, int]) -> None:
    network, weights = trained()
    given = noise(2, size)
    expected = forward(network, weights, given)
    found = run(build_model(network, weights), given)
    assert found.shape == expected.shape == (2, 6, column_count(network, size))
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_a_batch() -> None:
    network, weights = trained()
    given = noise(3)
    session = Session(parse_model(build_model(network, weights).SerializeToString()))
    np.testing.assert_allclose(session.run(given).arrays[0], forward(network, weights, given), rtol=1e-4, atol=1e-4)


def test_a_fixed_size() -> None:
    network, weights = trained()
    session = Session(parse_model(build_model(network, weights, size=(64, 32)).SerializeToString()))
    assert session.fixed_size == (64, 32)
    assert session.model.outputs[0].shape == (1, 6, 320)
    np.testing.assert_allclose(
        session.run(noise(1)).arrays[0], forward(network, weights, noise(1)), rtol=1e-4, atol=1e-4
    )


def test_names_types_and_versions() -> None:
    model = build_model(*trained())
    assert (model.ir_version, [(o.domain, o.version) for o in model.opset_import]) == (8, [("", 17)])
    shapes = [
        [side.dim_param or side.dim_value for side in value.type.tensor_type.shape.dim]
        for value in (*model.graph.input, *model.graph.output)
    ]
    assert shapes == [["batch", 3, "height", "width"], ["batch", 6, "anchors"]]
    assert [value.name for value in (*model.graph.input, *model.graph.output)] == ["images", "output0"]
    assert not any(node.op_type == "BatchNormalization" for node in model.graph.node)


def test_three_heads_and_other_poolings() -> None:
    third = "[route]\nlayers=0\n\n[maxpool]\nsize=3\nstride=1\n\n[maxpool]\nsize=5\nstride=2\n\n"
    text = SMALL + "\n" + third + layer(filters=14, size=1) + SMALL[SMALL.rindex("[yolo]") :]
    network = parse_cfg(text)
    weights = random_weights(network, 4)
    given = noise(1, (96, 64))
    for rounding in (None, Rounding({})):  # with activations at once, and after the poolings
        found = run(build_model(network, weights, rounding=rounding), given)
        np.testing.assert_allclose(found, forward(network, weights, given), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(("storage", "bytes_a_number", "most"), [("float16", 2, 0.01), ("int8", 1, 0.1)])
def test_storage_makes_the_file_smaller(storage: Storage, bytes_a_number: int, most: float) -> None:
    network, weights = trained()
    model = build_model(network, weights, storage=storage)
    kernels = sum(one.kernels.size for one in weights.layers.values())
    stored = [numpy_helper.to_array(one) for one in model.graph.initializer]
    assert sum(
        one.nbytes for one in stored if one.ndim == 4 and one.shape[2:] in ((3, 3), (1, 1)) and one.size > 14
    ) == (bytes_a_number * kernels)
    found, expected = run(model, noise(2)), forward(network, weights, noise(2))
    assert 1e-6 < np.abs(found - expected)[:, 4:].max() < most


def test_large_exponents_stay_finite() -> None:
    network, weights = trained()
    heads = [
        np.where(np.arange(14)[:, None, None] % 7 == 2, 500, head) for head in raw_heads(network, weights, noise(1))
    ]
    assert np.isfinite(decode(network, [head.astype(np.float32) for head in heads])).all()
    last = weights.layers[5]
    last.biases[2] += 500.0
    expected, found = forward(network, weights, noise(1)), run(build_model(network, weights), noise(1))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_a_backbone_is_no_network() -> None:
    network, weights = trained()
    with pytest.raises(InputError, match="first layers of the network only"):
        build_model(network, Weights({0: weights.layers[0]}))
