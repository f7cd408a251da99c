"""Small networks with random numbers in them, and the cfg files people have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.forward import run_layers
from landtool.darknet.network import Convolutional, Network
from landtool.darknet.weights import ConvolutionWeights, Floats, Weights

# Every kind of layer, two heads, strides 8 and 4
SMALL = """# a small one
[net]
width=64
height=32
channels=3

[convolutional]
batch_normalize=1
filters=4
size=3
stride=2
pad=1
activation=leaky

[maxpool]
size=2
stride=2

[convolutional]
batch_normalize=1
filters=6
size=3
pad=1
activation=leaky

[maxpool]
size=2
stride=2

[maxpool]
size=2
stride=1

[convolutional]
filters=14
size=1
activation=linear

[yolo]
mask=2,3
anchors=4,6, 9,8, 20,18, 40,30
classes=2
num=4

[route]
layers=-3

[upsample]
stride=2

[route]
layers=-1,2

[convolutional]
filters=14
size=1
activation=linear

[yolo]
mask=0,1
anchors=4,6, 9,8, 20,18, 40,30
classes=2
num=4
scale_x_y=1.05
"""


def layer(**keys: object) -> str:
    """Return a [convolutional] section."""
    return "\n".join(["[convolutional]", *(f"{key}={value}" for key, value in keys.items())]) + "\n\n"


def tiny_yolov3(classes: int, head: str = "", net: str = "") -> str:
    """Return the cfg of Tiny-YOLOv3 as it is passed round, comments and blanks included."""
    filters = 3 * (classes + 5)

    def conv(filters: int, size: int) -> str:
        return layer(batch_normalize=1, filters=filters, size=size, stride=1, pad=1, activation="leaky")

    def yolo(mask: str) -> str:
        return (
            layer(size=1, stride=1, pad=1, filters=filters, activation="linear") + f"[yolo]\nmask = {mask}\n"
            "anchors = 10,14,  23,27,  37,58,  81,82,  135,169,  344,319\n"
            f"classes={classes}\nnum=6\njitter=.3\nignore_thresh = .7\ntruth_thresh = 1\nrandom=1\n{head}\n"
        )

    parts = [
        "[net]\n# Testing\nbatch=1\nsubdivisions=1\n# Training\n# batch=64\n# subdivisions=2\nwidth=416\nheight=416\n"
        "channels=3\nmomentum=0.9\ndecay=0.0005\nangle=0\nsaturation = 1.5\nexposure = 1.5\nhue=.1\n\n"
        "learning_rate=0.001\nburn_in=1000\nmax_batches = 500200\npolicy=steps\nsteps=400000,450000\nscales=.1,.1\n"
        f"{net}\n"
    ]
    for filters_of, stride in ((16, 2), (32, 2), (64, 2), (128, 2), (256, 2), (512, 1)):
        parts += [conv(filters_of, 3), f"[maxpool]\nsize=2\nstride={stride}\n\n"]
    parts += [conv(1024, 3), "###########\n\n", conv(256, 1), conv(512, 3), yolo("3,4,5")]
    parts += ["\n[route]\nlayers = -4\n\n", conv(128, 1), "[upsample]\nstride=2\n\n[route]\nlayers = -1, 8\n\n"]
    return "".join([*parts, conv(256, 3), yolo("0,1,2")])


def random_weights(network: Network, seed: int, *, seen: int = 0) -> Weights:
    """Return weights under which what a layer gives out keeps its scale."""
    rng = np.random.default_rng(seed)
    return Weights({index: _random(conv, rng) for index, conv in network.convolutions}, seen)


def settled(network: Network, weights: Weights, pictures: Floats) -> Weights:
    """Return the weights with batch norm's means and variances as they are over some pictures."""
    layers = dict(weights.layers)
    for index, conv in network.convolutions:
        if conv.batch_normalize:
            plain = replace(network, layers=(*network.layers[:index], replace(conv, activation="linear")))
            identity = replace(
                layers[index],
                biases=np.zeros(conv.filters, np.float32),
                scales=np.ones(conv.filters, np.float32),
                means=np.zeros(conv.filters, np.float32),
                variances=np.full(conv.filters, 1 - 1e-5, np.float32),
            )
            maps = run_layers(plain, Weights({**layers, index: identity}), pictures)[index]
            layers[index] = replace(layers[index], means=maps.mean(axis=(0, 2, 3)), variances=maps.var(axis=(0, 2, 3)))
    return Weights(layers, weights.seen)


def small() -> tuple[Network, Weights]:
    """Return the small network with weights."""
    network = parse_cfg(SMALL)
    return network, random_weights(network, 1, seen=640)


def _random(conv: Convolutional, rng: np.random.Generator) -> ConvolutionWeights:
    def between(low: float, high: float) -> Floats:
        return rng.uniform(low, high, conv.filters).astype(np.float32)

    shape = (conv.filters, conv.channels, conv.size, conv.size)
    kernels = (rng.standard_normal(shape) * np.sqrt(2 / (conv.channels * conv.size**2))).astype(np.float32)
    if not conv.batch_normalize:
        return ConvolutionWeights(between(-0.2, 0.2), kernels)
    return ConvolutionWeights(between(-0.2, 0.2), kernels, between(0.5, 1.5), between(-0.1, 0.1), between(0.5, 1.5))
