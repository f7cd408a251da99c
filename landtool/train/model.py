"""Tiny-YOLOv3 in torch, layer by layer as a darknet network describes it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from landtool.darknet.forward import GREY
from landtool.darknet.network import Convolutional, MaxPool, Network, Route, Upsample, Yolo
from landtool.darknet.weights import BATCH_NORM_EPSILON, ConvolutionWeights, Weights

_LEAK = 0.1
_STATISTICS_MOMENTUM = 0.03  # of batch norm's running mean; torch's 0.1 follows too few pictures
_RARE = 1e-3  # share of cells that hold a target: where an untrained objectness starts


@dataclass(frozen=True)
class Head:
    """One detection head: its anchors (width, height) in input pixels, the input pixels of a cell, its scale_x_y."""

    anchors: tuple[tuple[float, float], ...]
    stride: int
    scale_xy: float
    ignore_iou: float
    positive_iou: float


class TinyYolo(nn.Module):
    """The network. Takes (B, 3, H, W) RGB in [0, 1], H and W multiples of its stride.

    Gives a tensor (B, anchors, h, w, 5 + classes) a head, in the order of the cfg: x, y, w, h, objectness and classes,
    before any sigmoid or exponential.
    """

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network
        self.convolutions = nn.ModuleDict({str(i): _convolution(c) for i, c in network.convolutions})
        for index, head in network.heads:
            _start_rare(self._last(index), len(head.anchors), head.classes)

    @property
    def heads(self) -> tuple[Head, ...]:
        """The heads, in the order of the cfg."""
        return tuple(
            Head(y.anchors, y.out.stride, y.scale_xy, y.ignore_iou, y.positive_iou) for _, y in self.network.heads
        )

    def forward(self, pictures: Tensor) -> list[Tensor]:
        """Run every layer on what the one before it gave out; routes look further back."""
        maps: list[Tensor] = []
        found: list[Tensor] = []
        x = pictures
        for index, layer in enumerate(self.network.layers):
            match layer:
                case Convolutional():
                    x = self.convolutions[str(index)](x)
                    x = functional.leaky_relu(x, _LEAK, inplace=True) if layer.activation == "leaky" else x
                case MaxPool():
                    x = _max_pool(x, layer)
                case Upsample():
                    x = functional.interpolate(x, scale_factor=float(layer.factor), mode="nearest")
                case Route():
                    x = (
                        torch.cat([maps[i] for i in layer.layers], dim=1)
                        if len(layer.layers) > 1
                        else maps[layer.layers[0]]
                    )
                case Yolo():
                    found.append(_by_anchor(x, layer))
            maps.append(x)
        return found

    def load(self, weights: Weights) -> None:
        """Take the weights of the layers that are in `weights`; a backbone leaves the others as they are."""
        with torch.no_grad():
            for index, numbers in weights.layers.items():
                block = cast(nn.Sequential, self.convolutions[str(index)])
                for tensor, array in zip(_tensors(block), numbers.arrays(), strict=True):
                    tensor.copy_(torch.from_numpy(np.ascontiguousarray(array)))

    def weights(self, seen: int = 0) -> Weights:
        """Return the weights, copied. seen: pictures trained on."""
        layers = {}
        for index, _ in self.network.convolutions:
            block = cast(nn.Sequential, self.convolutions[str(index)])
            arrays = [t.detach().float().contiguous().numpy().copy() for t in _tensors(block)]
            if len(arrays) == 2:
                layers[index] = ConvolutionWeights(biases=arrays[0], kernels=arrays[1])
            else:
                biases, scales, means, variances, kernels = arrays
                layers[index] = ConvolutionWeights(biases, kernels, scales, means, variances)
        return Weights(layers, seen)

    def _last(self, head_index: int) -> nn.Conv2d:
        return cast(nn.Conv2d, cast(nn.Sequential, self.convolutions[str(head_index - 1)])[0])


def decode(raw: Tensor, head: Head) -> tuple[Tensor, Tensor]:
    """Return boxes (..., 4) cx, cy, w, h in input pixels and logits (..., 1 + classes) of a head's output.

    bx = (s sigmoid(tx) - (s - 1) / 2 + column) stride, bw = anchor exp(tw): YOLOv3, with darknet's scale_x_y s.
    """
    rows, columns = raw.shape[2:4]
    shift = (head.scale_xy - 1.0) / 2.0
    grid_y, grid_x = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    grid = torch.stack([grid_x, grid_y], dim=-1).to(raw.dtype)
    centre = (raw[..., 0:2].sigmoid() * head.scale_xy - shift + grid) * head.stride
    anchors = torch.tensor(head.anchors, dtype=raw.dtype).view(1, -1, 1, 1, 2)
    # beyond e^8 nothing is a box any more: keeps an untrained network from overflowing
    size = anchors * raw[..., 2:4].clamp(max=8.0).exp()
    return torch.cat([centre, size], dim=-1), raw[..., 4:]


def found_in(model: TinyYolo, pictures: Tensor) -> Tensor:
    """Return `output0` of pictures (B, 3, H, W), and of their halves where the network looks at these, too."""
    full = output0([raw.float() for raw in model(pictures)], model.heads)
    if not model.network.pyramid:
        return full
    raws = [raw.float() for raw in model(halved(pictures, model.network))]
    scale = torch.ones(full.shape[1])
    scale[:4] = 2.0
    return torch.cat([full, output0(raws, model.heads) * scale[:, None]], dim=2)


def halved(pictures: Tensor, network: Network) -> Tensor:
    """Return pictures (B, 3, H, W) at half size, filled up with grey right and below to whole cells of the network."""
    half = functional.avg_pool2d(pictures, 2)
    columns, rows = network.half_size(pictures.shape[3], pictures.shape[2])
    return functional.pad(half, (0, columns - half.shape[3], 0, rows - half.shape[2]), value=float(GREY))


def output0(raws: list[Tensor], heads: tuple[Head, ...]) -> Tensor:
    """Return (B, 4 + classes, N): boxes in input pixels and scores, objectness times class, as the ONNX file has it."""
    parts = []
    for raw, head in zip(raws, heads, strict=True):
        boxes, logits = decode(raw, head)
        scores = logits[..., :1].sigmoid() * logits[..., 1:].sigmoid()
        parts.append(torch.cat([boxes, scores], dim=-1).flatten(1, 3))
    return torch.cat(parts, dim=1).transpose(1, 2)


def _convolution(layer: Convolutional) -> nn.Sequential:
    convolution = nn.Conv2d(
        layer.channels, layer.filters, layer.size, layer.stride, layer.padding, bias=not layer.batch_normalize
    )
    nn.init.kaiming_normal_(convolution.weight, a=_LEAK, nonlinearity="leaky_relu")
    if not layer.batch_normalize:
        return nn.Sequential(convolution)
    return nn.Sequential(
        convolution, nn.BatchNorm2d(layer.filters, eps=BATCH_NORM_EPSILON, momentum=_STATISTICS_MOMENTUM)
    )


def _tensors(block: nn.Sequential) -> list[Tensor]:
    """Return a block's numbers in the order of a darknet file."""
    convolution = cast(nn.Conv2d, block[0])
    if len(block) == 1:
        return [cast(Tensor, convolution.bias), convolution.weight]
    norm = cast(nn.BatchNorm2d, block[1])
    statistics = [cast(Tensor, norm.running_mean), cast(Tensor, norm.running_var)]
    return [norm.bias, norm.weight, *statistics, convolution.weight]


def _start_rare(convolution: nn.Conv2d, anchors: int, classes: int) -> None:
    """Start a head small and with a low objectness, so that the first steps do not only push the empty cells down."""
    bias = cast(Tensor, convolution.bias)
    with torch.no_grad():
        nn.init.normal_(convolution.weight, std=0.01)
        bias.zero_()
        bias.view(anchors, 5 + classes)[:, 4] = math.log(_RARE / (1.0 - _RARE))


def _max_pool(x: Tensor, layer: MaxPool) -> Tensor:
    before, after = layer.padding
    if before == 0 and layer.size == layer.stride:  # windows side by side never reach a padding on the right only
        return functional.max_pool2d(x, layer.size, layer.stride)
    return functional.max_pool2d(
        functional.pad(x, (before, after, before, after), value=-math.inf), layer.size, layer.stride
    )


def _by_anchor(x: Tensor, layer: Yolo) -> Tensor:
    batch, _, rows, columns = x.shape
    return x.view(batch, len(layer.anchors), 5 + layer.classes, rows, columns).permute(0, 1, 3, 4, 2)
