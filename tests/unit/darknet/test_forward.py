from __future__ import annotations

import math

import numpy as np
import pytest

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.forward import decode, forward, raw_heads, run_layers
from landtool.darknet.network import MaxPool, Network, Shape
from landtool.darknet.weights import ConvolutionWeights, Floats, Weights
from tests.unit.darknet.networks import SMALL, random_weights, small, tiny_yolov3


@pytest.fixture(scope="module")
def picture() -> Floats:
    """Two pictures (2, 3, 32, 64)."""
    return np.random.default_rng(5).random((2, 3, 32, 64), dtype=np.float32)


def at(maps: Floats, channel: int, y: int, x: int) -> float:
    """The value of a map of one picture, 0 outside of it."""
    inside = 0 <= y < maps.shape[1] and 0 <= x < maps.shape[2]
    return float(maps[channel, y, x]) if inside else 0.0


def test_a_convolution_is_its_sum(picture: Floats) -> None:
    network, weights = small()
    one = weights.layers[0]
    assert one.means is not None
    assert one.variances is not None
    assert one.scales is not None
    out = run_layers(network, weights, picture)[0]
    assert out.shape == (2, 4, 16, 32)
    for f, y, x in ((0, 0, 0), (1, 15, 31), (3, 7, 12)):
        total = sum(
            float(one.kernels[f, c, dy, dx]) * at(picture[1], c, 2 * y + dy - 1, 2 * x + dx - 1)
            for c in range(3)
            for dy in range(3)
            for dx in range(3)
        )
        value = (total - one.means[f]) / math.sqrt(one.variances[f] + 1e-5) * one.scales[f] + one.biases[f]
        assert out[1, f, y, x] == pytest.approx(value if value > 0 else 0.1 * value, abs=1e-5)


@pytest.mark.parametrize(("size", "stride"), [(2, 2), (2, 1), (3, 1), (3, 2), (5, 1)])
def test_a_maxpool_sees_only_the_picture(size: int, stride: int) -> None:
    layer = MaxPool(Shape(3, stride), size, stride)
    network = Network(8, 8, 3, (layer,))
    maps = -np.random.default_rng(1).random((1, 3, 8, 8), dtype=np.float32)  # all below the 0 of a plain padding
    out = run_layers(network, Weights({}), maps)[0]
    assert out.shape == (1, 3, 8 // stride, 8 // stride)
    first = (size - 1) // 2
    for y in range(out.shape[2]):
        for x in range(out.shape[3]):
            top, left = y * stride - first, x * stride - first
            seen = maps[0, 1, max(top, 0) : top + size, max(left, 0) : left + size]
            assert out[0, 1, y, x] == seen.max()


def test_route_and_upsample(picture: Floats) -> None:
    done = run_layers(*small(), picture)
    assert done[9].shape == (2, 12, 8, 16)
    assert np.array_equal(done[9][:, 6:], done[2])
    assert np.array_equal(done[9][:, :6, 1::2, ::2], done[4])
    assert np.array_equal(done[9][:, :6, ::2, 1::2], done[4])


def test_columns_are_heads_then_anchors_then_rows(picture: Floats) -> None:
    network, weights = small()
    heads = raw_heads(network, weights, picture)
    assert [head.shape for head in heads] == [(2, 14, 4, 8), (2, 14, 8, 16)]
    output = decode(network, heads)
    assert output.shape == (2, 6, 2 * 32 + 2 * 128)
    assert np.array_equal(output, forward(network, weights, picture))
    anchor, row, column = 1, 5, 9
    tx, ty, tw, th, to, *tc = (float(v) for v in heads[1][0, 7 * anchor : 7 * anchor + 7, row, column])
    assert len(tc) == 2

    def sigmoid(value: float) -> float:
        return 1 / (1 + math.exp(-value))

    expected = [
        (sigmoid(tx) * 1.05 - 0.025 + column) * 4,
        (sigmoid(ty) * 1.05 - 0.025 + row) * 4,
        9 * math.exp(tw),  # masks 0, 1: anchors 4,6 and 9,8
        8 * math.exp(th),
        *(sigmoid(to) * sigmoid(c) for c in tc),
    ]
    np.testing.assert_allclose(output[0, :, 64 + anchor * 128 + row * 16 + column], expected, rtol=1e-5)


def test_a_box_lies_where_its_cell_is() -> None:
    network = parse_cfg(SMALL)
    zero = {
        index: ConvolutionWeights(
            np.zeros(conv.filters, np.float32),
            np.zeros((conv.filters, conv.channels, conv.size, conv.size), np.float32),
            *(np.ones(conv.filters, np.float32),) * (3 if conv.batch_normalize else 0),
        )
        for index, conv in network.convolutions
    }
    output = forward(network, Weights(zero), np.zeros((1, 3, 32, 64), np.float32))
    assert output[0, :, 0].tolist() == [4, 4, 20, 18, 0.25, 0.25]
    assert output[0, :, 64 + 128 + 17].tolist() == pytest.approx([6, 6, 9, 8, 0.25, 0.25])


def test_tiny_yolov3_at_another_size() -> None:
    network = parse_cfg(tiny_yolov3(1))
    picture = np.zeros((1, 3, 64, 96), np.float32)
    assert forward(network, random_weights(network, 2), picture).shape == (1, 5, 3 * (2 * 3 + 4 * 6))
