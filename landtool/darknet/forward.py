"""Run a network in plain numpy: slow, independent of every framework, the reference others are compared with.

Batch norm is worked out as the file has it, not folded into the kernels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from landtool.darknet.network import Convolutional, MaxPool, Network, Route, Upsample, Yolo
from landtool.darknet.weights import BATCH_NORM_EPSILON, ConvolutionWeights, Floats, Weights

LEAKY_SLOPE = np.float32(0.1)
GREY = np.float32(114.0 / 255.0)  # beside a picture, as letterboxing has it
LARGEST_EXPONENT = np.float32(8.0)  # of a box: thousands of times its anchor are none, and must not overflow


def run_layers(network: Network, weights: Weights, pictures: Floats) -> dict[int, Floats]:
    """Return what every layer gives out, by its index; of a detection head, what it is given.

    pictures: (B, 3, H, W) float32 RGB in [0, 1], sides multiples of the network's stride.
    """
    done: dict[int, Floats] = {}
    maps = pictures
    for index, layer in enumerate(network.layers):
        if isinstance(layer, Convolutional):
            maps = _convolve(maps, layer, weights.layers[index])
        elif isinstance(layer, MaxPool):
            maps = _pool(maps, layer)
        elif isinstance(layer, Upsample):
            maps = maps.repeat(layer.factor, axis=2).repeat(layer.factor, axis=3)
        elif isinstance(layer, Route):
            maps = np.concatenate([done[i] for i in layer.layers], axis=1)
        done[index] = maps
    return done


def raw_heads(network: Network, weights: Weights, pictures: Floats) -> tuple[Floats, ...]:
    """Return what the detection heads are given, (B, anchors * (5 + classes), h, w) float32, in the cfg's order."""
    done = run_layers(network, weights, pictures)
    return tuple(done[index] for index, _ in network.heads)


def decode(network: Network, heads: Sequence[Floats]) -> Floats:
    """Return (B, 4 + classes, N) float32: cx, cy, w, h in input pixels, then objectness times each class.

    N counts the heads in the cfg's order, in each the anchors, then rows, then columns.
    """
    parts = [_decode_head(head, raw) for (_, head), raw in zip(network.heads, heads, strict=True)]
    return np.concatenate(parts, axis=2)


def forward(network: Network, weights: Weights, pictures: Floats) -> Floats:
    """Return the boxes and scores of pictures; see `run_layers`, `decode`, and, for a pyramid, `halved`."""
    full = decode(network, raw_heads(network, weights, pictures))
    if not network.pyramid:
        return full
    return joined(full, decode(network, raw_heads(network, weights, halved(network, pictures))))


def halved(network: Network, pictures: Floats) -> Floats:
    """Return pictures (B, 3, H, W) at half size, filled up with grey right and below to whole cells of the network."""
    batch, channels, height, width = pictures.shape
    half = pictures.reshape(batch, channels, height // 2, 2, width // 2, 2).mean(axis=(3, 5))
    columns, rows = network.half_size(width, height)
    filled = np.full((batch, channels, rows, columns), GREY, np.float32)
    filled[:, :, : height // 2, : width // 2] = half
    return filled


def joined(full: Floats, half: Floats) -> Floats:
    """Return the boxes (B, 4 + classes, N) found in pictures and in their halves, in pixels of the former."""
    larger = half.copy()
    larger[:, :4] *= 2.0
    return np.concatenate([full, larger], axis=2)


def _convolve(maps: Floats, layer: Convolutional, numbers: ConvolutionWeights) -> Floats:
    batch, channels, height, width = maps.shape
    k, stride, pad = layer.size, layer.stride, layer.padding
    rows, columns = (height - 1) // stride + 1, (width - 1) // stride + 1
    padded = np.pad(maps, ((0, 0), (0, 0), (pad, pad), (pad, pad)))
    windows = np.empty((batch, channels, k, k, rows, columns), np.float32)
    for dy in range(k):
        for dx in range(k):
            windows[:, :, dy, dx] = padded[:, :, dy : dy + height : stride, dx : dx + width : stride]
    kernels = numbers.kernels.reshape(layer.filters, -1)
    out: Floats = kernels @ windows.reshape(batch, channels * k * k, rows * columns)
    out = _normalize(out, numbers)
    if layer.activation == "leaky":
        out = np.maximum(out, LEAKY_SLOPE * out)
    return out.reshape(batch, layer.filters, rows, columns)


def _normalize(maps: Floats, numbers: ConvolutionWeights) -> Floats:
    """Batch norm, y = s (x - m) / sqrt(v + e) + b, or y = x + b without; maps: (B, filters, cells)."""
    if numbers.scales is None or numbers.means is None or numbers.variances is None:
        return maps + numbers.biases[:, None]
    deviation = np.sqrt(numbers.variances + np.float32(BATCH_NORM_EPSILON))
    factor = numbers.scales / deviation
    maps -= numbers.means[:, None]
    maps *= factor[:, None]
    maps += numbers.biases[:, None]
    return maps


def _pool(maps: Floats, layer: MaxPool) -> Floats:
    _, _, height, width = maps.shape
    before, after = layer.padding
    rows, columns = (height - 1) // layer.stride + 1, (width - 1) // layer.stride + 1
    around = ((0, 0), (0, 0), (before, after), (before, after))
    padded = np.pad(maps, around, constant_values=-np.inf)
    step = layer.stride
    out: Floats | None = None
    for dy in range(layer.size):
        for dx in range(layer.size):
            seen = padded[:, :, dy : dy + rows * step : step, dx : dx + columns * step : step]
            out = seen[:, :, :rows, :columns] if out is None else np.maximum(out, seen[:, :, :rows, :columns])
    assert out is not None
    return np.ascontiguousarray(out)


def _decode_head(head: Yolo, raw: Floats) -> Floats:
    batch, _, rows, columns = raw.shape
    count = len(head.anchors)
    cells = raw.reshape(batch, count, 5 + head.classes, rows, columns)
    sides = np.asarray(head.anchors, np.float32)[None, :, :, None, None]
    corner = np.stack(np.meshgrid(np.arange(columns), np.arange(rows))).astype(np.float32)
    stride, scale = np.float32(head.out.stride), np.float32(head.scale_xy)
    # b = (sigmoid(t) s - (s - 1) / 2 + c) stride,  w = a exp(t)
    centres = (_sigmoid(cells[:, :, 0:2]) * scale - (scale - 1) / 2 + corner) * stride
    sizes = sides * np.exp(np.minimum(cells[:, :, 2:4], LARGEST_EXPONENT))
    scores = _sigmoid(cells[:, :, 4:5]) * _sigmoid(cells[:, :, 5:])
    boxes = np.concatenate([centres, sizes, scores], axis=2)
    return boxes.transpose(0, 2, 1, 3, 4).reshape(batch, 4 + head.classes, count * rows * columns)


def _sigmoid(values: Floats) -> Floats:
    with np.errstate(over="ignore"):
        return np.asarray(1 / (1 + np.exp(-values)), np.float32)
