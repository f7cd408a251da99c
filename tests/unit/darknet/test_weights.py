from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.forward import raw_heads
from landtool.darknet.network import Convolutional
from landtool.darknet.weights import (
    ConvolutionWeights,
    Weights,
    parse_weights,
    read_weights,
    weights_bytes,
    write_weights,
)
from landtool.errors import InputError, OutputExistsError, UsageError
from tests.unit.darknet.networks import SMALL, random_weights, small, tiny_yolov3

NETWORK = parse_cfg(SMALL)
BODY = 4 * NETWORK.parameters


@pytest.fixture(scope="module")
def data() -> bytes:
    """The bytes of a weights file of the small network."""
    network, weights = small()
    return weights_bytes(weights, network)


class TestBytes:
    def test_the_order_is_darknets(self, data: bytes) -> None:
        _, weights = small()
        assert struct.unpack_from("<3iQ", data) == (0, 2, 5, 640)
        first = weights.layers[0]
        assert first.scales is not None
        assert first.means is not None
        assert first.variances is not None
        parts = (first.biases, first.scales, first.means, first.variances, first.kernels.ravel())
        expected = np.concatenate(parts)
        assert np.array_equal(np.frombuffer(data, "<f4", len(expected), 20), expected)
        assert len(data) == 20 + BODY

    @settings(max_examples=30, deadline=None)
    @given(
        version=st.sampled_from([(0, 1, 0), (0, 2, 0), (0, 2, 5), (1, 0, 0), (0, 0, 0)]),
        seen=st.integers(0, 2**32 - 1),
        bits=st.binary(min_size=64, max_size=64),
    )
    def test_reading_and_writing_gives_the_same_bytes(
        self, version: tuple[int, int, int], seen: int, bits: bytes
    ) -> None:
        # any finite bits: negative zeros and subnormal numbers come back, too
        numbers = np.resize(np.frombuffer(bits, "<f4"), NETWORK.parameters)
        numbers = np.abs(np.where(np.isfinite(numbers), numbers, np.float32(1))).astype("<f4")
        header = struct.pack("<3i", *version) + struct.pack("<Q" if version >= (0, 2) else "<I", seen)
        data = header + numbers.tobytes()
        weights = parse_weights(data, NETWORK)
        assert (weights.version, weights.seen) == (version, seen)
        assert weights_bytes(weights, NETWORK) == data

    def test_the_old_header_is_four_bytes_shorter(self, data: bytes) -> None:
        old = struct.pack("<3iI", 0, 1, 0, 7) + data[20:]
        assert parse_weights(old, NETWORK).seen == 7
        with pytest.raises(InputError, match="4 bytes short"):
            parse_weights(struct.pack("<3iI", 0, 2, 0, 7) + data[20:], NETWORK)

    def test_files(self, data: bytes, tmp_path: Path) -> None:
        network, weights = small()
        path = tmp_path / "a.weights"
        write_weights(path, weights, network)
        assert path.read_bytes() == data
        assert weights_bytes(read_weights(path, network), network) == data
        with pytest.raises(OutputExistsError):
            write_weights(path, weights, network)


class TestBackbone:
    def test_the_first_15_layers_of_tiny_yolov3(self) -> None:
        network = parse_cfg(tiny_yolov3(1))
        weights = random_weights(network, 3)
        backbone = replace(weights, layers={index: weights.layers[index] for index in weights.layers if index < 15})
        data = weights_bytes(backbone, network)
        read = parse_weights(data, network, backbone=True)
        assert sorted(read.layers) == [0, 2, 4, 6, 8, 10, 12, 13, 14]
        assert not read.is_complete(network)
        assert weights_bytes(read, network) == data
        with pytest.raises(InputError, match="holds the first 9 of 13 convolutions only; a backbone is for"):
            parse_weights(data, network)
        # a backbone is the same whatever the classes are
        assert sorted(parse_weights(data, parse_cfg(tiny_yolov3(80)), backbone=True).layers) == sorted(read.layers)

    def test_must_end_after_a_convolution(self, data: bytes) -> None:
        with pytest.raises(InputError, match="does not fit the cfg"):
            parse_weights(data[:-4], NETWORK, backbone=True)


class TestRefuse:
    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (lambda d: d[:-4], f"{BODY - 4} bytes of weights, {BODY} belong to it .4 bytes short"),
            (lambda d: d + b"1234", r"\(4 bytes too long\)"),
            (lambda d: d[:-1], r"\(1 bytes short\)"),
            (lambda _: b"", "is too short for a weights file"),
            (lambda d: d[:16], "is too short for a weights file"),
            (lambda d: struct.pack("<3i", 1001, 0, 0) + d[12:], r"is no weights file \(version 1001.0\)"),
            (lambda _: b"<!DOCTYPE html><html>" * 9, "is no weights file"),
            (lambda d: d[:-4] + struct.pack("<f", np.nan), "layer 10 holds numbers that are not finite"),
            (lambda d: d[:20] + struct.pack("<f", np.inf) + d[24:], "layer 0 holds numbers that are not finite"),
            (lambda d: d[:68] + struct.pack("<f", -0.5) + d[72:], "layer 0 holds variances below zero"),
        ],
    )
    def test_what_is_no_file_of_this_network(self, change: object, said: str, data: bytes, tmp_path: Path) -> None:
        assert callable(change)
        (tmp_path / "x.weights").write_bytes(change(data))
        with pytest.raises(InputError, match=f"x.weights: .*{said}"):
            read_weights(tmp_path / "x.weights", NETWORK)

    def test_weights_of_another_cfg(self) -> None:
        one, two = parse_cfg(tiny_yolov3(1)), parse_cfg(tiny_yolov3(2))
        data = weights_bytes(random_weights(one, 1), one)
        with pytest.raises(InputError, match=r"does not fit the cfg: .* short\); give the cfg it was trained with"):
            parse_weights(data, two)

    def test_a_file_that_is_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="does not exist"):
            read_weights(tmp_path / "x.weights", NETWORK)


def only_variances(weights: Weights, value: float) -> Weights:
    layers = {
        index: replace(one, variances=None if one.variances is None else np.full_like(one.variances, value))
        for index, one in weights.layers.items()
    }
    return replace(weights, layers=layers)


@pytest.mark.parametrize("variance", [0.0, 1e-12, 1e-7, 1.0])
def test_folding_keeps_batch_norm_with_tiny_variances(variance: float) -> None:
    network, weights = small()
    weights = only_variances(weights, variance)
    plain = replace(
        network,
        layers=tuple(
            replace(layer, batch_normalize=False) if isinstance(layer, Convolutional) else layer
            for layer in network.layers
        ),
    )
    folded = Weights(
        {index: ConvolutionWeights(one.folded()[1], one.folded()[0]) for index, one in weights.layers.items()}
    )
    picture = np.random.default_rng(0).random((1, 3, 32, 64), dtype=np.float32)
    for a, b in zip(raw_heads(network, weights, picture), raw_heads(plain, folded, picture), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5 * np.abs(a).max())


def test_epsilon_is_added_to_the_variance() -> None:
    one = ConvolutionWeights(
        np.zeros(1, np.float32), np.ones((1, 1, 1, 1), np.float32), *(np.full(1, v, np.float32) for v in (1, 0, 0))
    )
    # AlexeyAB's 1 / sqrt(0 + 1e-5), not 1 / (sqrt(0) + 1e-6)
    assert one.folded()[0].item() == pytest.approx(316.2278, rel=1e-5)
