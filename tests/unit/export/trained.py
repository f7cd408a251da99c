"""A small network with weights under which it is sure of some boxes, and pictures for it."""

from __future__ import annotations

import numpy as np

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.edit import edited
from landtool.darknet.network import Network
from landtool.darknet.weights import Floats, Weights
from landtool.types import Image
from tests.unit.darknet.networks import SMALL, random_weights, settled

NAMES = ("pad", "sign")


def trained(*, letterbox: bool = True) -> tuple[Network, Weights]:
    """Return network and weights; batch norm is that of noise."""
    network = edited(parse_cfg(SMALL), letterbox=letterbox)
    weights = settled(network, random_weights(network, 1, seen=640), noise(4))
    for index, _ in network.heads:  # no boxes beyond all bounds
        weights.layers[index - 1].kernels[:] *= np.float32(0.3)
    return network, weights


def noise(count: int, size: tuple[int, int] = (64, 32)) -> Floats:
    """Return inputs (count, 3, H, W), as if of pictures of 8 bits."""
    rng = np.random.default_rng(7)
    return rng.integers(0, 256, (count, 3, size[1], size[0])).astype(np.float32) / np.float32(255)


def images(count: int) -> list[Image]:
    """Return pictures (H, W, 3) BGR uint8 of several shapes."""
    rng = np.random.default_rng(3)
    shapes = ((32, 64, 3), (64, 32, 3), (50, 70, 3), (90, 90, 3))
    return [rng.integers(0, 256, shapes[index % 4], np.uint8) for index in range(count)]
