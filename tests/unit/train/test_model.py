"""The network in torch against the reference in numpy."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="torch is not installed: pip install 'landtool[train]'")

from landtool.darknet.cfg import parse_cfg  # noqa: E402
from landtool.darknet.edit import edited  # noqa: E402
from landtool.darknet.forward import forward, raw_heads  # noqa: E402
from landtool.darknet.network import Network  # noqa: E402
from landtool.darknet.weights import Weights, parse_weights, weights_bytes  # noqa: E402
from landtool.train.model import TinyYolo, decode, found_in, output0  # noqa: E402
from tests.unit.darknet.networks import SMALL, random_weights, settled, small, tiny_yolov3  # noqa: E402


@pytest.fixture(scope="module")
def tiny() -> tuple[Network, Weights, np.ndarray]:
    """Tiny-YOLOv3 for two classes at 96 x 96 with weights, and two pictures."""
    network = parse_cfg(tiny_yolov3(2).replace("width=416", "width=96").replace("height=416", "height=96"))
    pictures = np.random.default_rng(3).random((2, 3, 96, 96), dtype=np.float32)
    return network, settled(network, random_weights(network, 2), pictures), pictures


def run(network: Network, weights: Weights, pictures: np.ndarray) -> tuple[TinyYolo, list[torch.Tensor]]:
    model = TinyYolo(network).eval()
    model.load(weights)
    with torch.inference_mode():
        return model, model(torch.from_numpy(pictures))


def reference_raw(network: Network, weights: Weights, pictures: np.ndarray) -> list[np.ndarray]:
    """The heads' maps as (B, anchors, h, w, 5 + classes)."""
    found = []
    for (_, head), raw in zip(network.heads, raw_heads(network, weights, pictures), strict=True):
        batch, _, rows, columns = raw.shape
        found.append(raw.reshape(batch, len(head.anchors), -1, rows, columns).transpose(0, 1, 3, 4, 2))
    return found


def test_heads_have_the_shapes_of_the_cfg(tiny: tuple[Network, Weights, np.ndarray]) -> None:
    network, weights, _ = tiny
    pictures = np.zeros((2, 3, 64, 128), np.float32)  # any multiple of the stride will do
    model, raws = run(network, weights, pictures)
    assert [tuple(raw.shape) for raw in raws] == [(2, 3, 2, 4, 7), (2, 3, 4, 8, 7)]
    assert [head.stride for head in model.heads] == [32, 16]
    assert tuple(output0(raws, model.heads).shape) == (2, 6, 3 * (2 * 4 + 4 * 8))


def test_tiny_yolov3_is_that_of_the_reference(tiny: tuple[Network, Weights, np.ndarray]) -> None:
    network, weights, pictures = tiny
    model, raws = run(network, weights, pictures)
    for raw, wanted in zip(raws, reference_raw(network, weights, pictures), strict=True):
        assert np.abs(wanted).max() > 0.5
        assert np.abs(raw.numpy() - wanted).max() <= 1e-4
    assert np.allclose(output0(raws, model.heads).numpy(), forward(network, weights, pictures), rtol=1e-4, atol=1e-4)


def test_every_kind_of_layer_is_that_of_the_reference() -> None:
    network, weights = small()
    pictures = np.random.default_rng(5).random((2, 3, 32, 64), dtype=np.float32)
    model, raws = run(network, weights, pictures)
    for raw, wanted in zip(raws, reference_raw(network, weights, pictures), strict=True):
        assert np.abs(raw.numpy() - wanted).max() <= 1e-4
    assert np.allclose(output0(raws, model.heads).numpy(), forward(network, weights, pictures), rtol=1e-4, atol=1e-4)


def test_weights_come_out_as_they_were_loaded() -> None:
    network, weights = small()
    model = TinyYolo(network)
    model.load(weights)
    assert weights_bytes(model.weights(weights.seen), network) == weights_bytes(weights, network)


def test_weights_are_copies() -> None:
    network, _ = small()
    model = TinyYolo(network)
    before = model.weights()
    kept = weights_bytes(before, network)
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(1.0)
    assert weights_bytes(before, network) == kept


def test_a_backbone_leaves_the_other_layers_as_they_are() -> None:
    network, weights = small()
    data = weights_bytes(weights, network)
    first, second = (layer.parameters for _, layer in network.convolutions[:2])
    backbone = parse_weights(data[: 20 + 4 * (first + second)], network, backbone=True)
    model = TinyYolo(network)
    before = model.weights().layers
    model.load(backbone)
    after = model.weights().layers
    assert sorted(backbone.layers) == [0, 2]
    for index, numbers in after.items():
        wanted = (weights.layers if index in (0, 2) else before)[index]
        assert all(np.array_equal(a, b) for a, b in zip(numbers.arrays(), wanted.arrays(), strict=True))


def test_columns_of_the_output_count_heads_anchors_rows_columns() -> None:
    network, _ = small()
    heads = TinyYolo(network).heads
    raws = [torch.full((1, 2, 4, 8, 7), -9.0), torch.full((1, 2, 8, 16, 7), -9.0)]
    raws[1][0, 1, 5, 11] = torch.tensor([0.0, 0.0, 0.0, 0.0, 9.0, -9.0, 9.0])
    found = output0(raws, heads)[0]
    column = 2 * 4 * 8 + 1 * 8 * 16 + 5 * 16 + 11
    assert int(found[5].argmax()) == column
    # the middle of its cell of 4 pixels, and the size of its anchor
    assert found[:4, column].tolist() == pytest.approx([11.5 * 4, 5.5 * 4, *heads[1].anchors[1]])
    assert found[4:, column].tolist() == pytest.approx([0.0, 1.0], abs=1e-3)


def test_scale_x_y_lets_centres_leave_their_cell() -> None:
    network, _ = small()
    head = TinyYolo(network).heads[1]
    raw = torch.zeros(1, 2, 8, 16, 7)
    raw[..., 0], raw[..., 1] = 20.0, -20.0
    boxes, _ = decode(raw, head)
    assert boxes[0, 0, 3, 2, :2].tolist() == pytest.approx([(3 + 0.025) * 4, (3 - 0.025) * 4], abs=1e-4)


def test_an_untrained_network_says_there_is_nothing() -> None:
    network, _ = small()
    torch.manual_seed(0)
    model = TinyYolo(network)
    with torch.no_grad():
        raws = model(torch.rand(2, 3, 32, 64))
    assert max(float(raw[..., 4].sigmoid().max()) for raw in raws) < 0.02


def test_a_second_look_at_half_size_is_the_references() -> None:
    network = edited(parse_cfg(SMALL), pyramid=True)
    weights = random_weights(network, 5)
    model = TinyYolo(network)
    model.load(weights)
    model.eval()
    pictures = np.random.default_rng(1).random((2, 3, 24, 40), np.float32)
    with torch.inference_mode():
        found = found_in(model, torch.from_numpy(pictures)).numpy()
    np.testing.assert_allclose(found, forward(network, weights, pictures), rtol=1e-4, atol=1e-4)
