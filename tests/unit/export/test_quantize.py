from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import numpy_helper

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.forward import forward
from landtool.darknet.weights import Floats
from landtool.detect.model_file import parse_model
from landtool.detect.session import Session
from landtool.errors import InputError
from landtool.export.onnx_graph import build_model
from landtool.export.quantize import best_scale, choose_rounding
from landtool.export.rounding import Scale, rounded_kernels, scale_between
from tests.unit.darknet.networks import random_weights, tiny_yolov3
from tests.unit.export.trained import noise, trained


def pictures(count: int) -> list[Floats]:
    return [one[None] for one in noise(count)]


def test_zero_is_a_level() -> None:
    for low, high in ((-1.0, 3.0), (0.5, 2.0), (-4.0, -1.0), (0.0, 0.0)):
        scale = scale_between(low, high)
        assert 0 <= scale.zero <= 255
        assert (0 - scale.zero) * scale.step <= min(low, 0.0) + scale.step
        assert (255 - scale.zero) * scale.step >= max(high, 0.0) - scale.step


def test_each_filter_has_a_step_of_its_own() -> None:
    kernels = np.random.default_rng(1).standard_normal((5, 3, 3, 3)).astype(np.float32)
    kernels *= np.asarray([1e-4, 1, 100, 0, 3], np.float32)[:, None, None, None]
    levels, steps = rounded_kernels(kernels)
    assert levels.dtype == np.int8
    assert steps.shape == (5,)
    assert np.abs(levels).reshape(5, -1).max(axis=1).tolist() == [127, 127, 127, 0, 127]
    assert (np.abs(levels * steps[:, None, None, None] - kernels) <= 0.501 * steps[:, None, None, None]).all()


def test_rare_outliers_are_cut_off() -> None:
    values = np.random.default_rng(1).standard_normal(1_000_000).astype(np.float32)
    values[0] = 10.0
    assert best_scale(values, leaky=False).step < 0.75 * scale_between(float(values.min()), 10.0).step


def test_before_an_activation_the_negative_half_counts_less() -> None:
    values = np.random.default_rng(1).standard_normal(100_000).astype(np.float32)
    linear, leaky = (best_scale(values, leaky=given) for given in (False, True))
    assert leaky.zero < linear.zero


def test_int8_stays_near_the_network() -> None:
    network, weights = trained()
    rounding = choose_rounding(network, weights, pictures(6))
    model = build_model(network, weights, rounding=rounding)
    session = Session(parse_model(model.SerializeToString()))
    assert session.model.rounded
    expected, found = forward(network, weights, noise(1)), session.run(noise(1)).arrays[0]
    assert np.abs(found - expected)[:, 4:].max() < 0.1
    assert np.corrcoef(found[0, 4], expected[0, 4])[0, 1] > 0.99


def test_the_pictures_own_levels_are_kept() -> None:
    network, weights = trained()
    rounding = choose_rounding(network, weights, pictures(1))
    assert rounding.scales["images"] == Scale(float(np.float32(1 / 255)), 0)
    assert rounding.exact == {5, 10}
    for pool, given in ((1, 0), (3, 2), (4, 2)):
        assert rounding.scales[f"layer{pool}"] == rounding.scales[f"layer{given}"]
    assert rounding.scales["layer8"] == rounding.scales["layer4_leaky"]


def test_without_pictures() -> None:
    with pytest.raises(InputError, match="there is no picture to choose the scales by"):
        choose_rounding(*trained(), [])


def test_onnx_runtime_computes_all_but_the_heads_in_int8(tmp_path: object) -> None:
    network = parse_cfg(tiny_yolov3(1))
    weights = random_weights(network, 3)
    given = [np.random.default_rng(1).random((1, 3, 64, 64), dtype=np.float32)]
    model = build_model(network, weights, rounding=choose_rounding(network, weights, given))
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = f"{tmp_path}/seen.onnx"
    options.log_severity_level = 3
    onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    seen = onnx.load(options.optimized_model_filepath)
    kinds = [node.op_type for node in seen.graph.node]
    assert kinds.count("QLinearConv") == 11
    assert kinds.count("Conv") + kinds.count("FusedConv") == 2  # those that the heads read
    assert "LeakyRelu" not in kinds
    assert kinds.count("QuantizeLinear") == 1
    assert kinds.count("DequantizeLinear") == 2
    assert sum(numpy_helper.to_array(one).nbytes for one in model.graph.initializer) < 9_000_000
