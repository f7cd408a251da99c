"""The network in torch as a plain function, for whoever compares it with another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from landtool.darknet.network import Network
from landtool.darknet.weights import Floats, Weights
from landtool.train.model import TinyYolo


def torch_heads(network: Network, weights: Weights) -> Callable[[Floats], list[Floats]]:
    """Return what gives the raw heads (1, anchors * (5 + classes), h, w) of pictures (1, 3, H, W)."""
    model = TinyYolo(network)
    model.load(weights)
    model.eval()

    def heads(pictures: Floats) -> list[Floats]:
        with torch.inference_mode():
            raws = model(torch.from_numpy(np.ascontiguousarray(pictures)))
        return [raw.permute(0, 1, 4, 2, 3).flatten(1, 2).numpy() for raw in raws]

    return heads
