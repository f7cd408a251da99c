"""The pictures an export is tried on, and how a network is given one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from landtool.darknet.network import Network
from landtool.darknet.weights import Floats
from landtool.detect.preprocess import InputSpec, Placement, Preprocessor
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.types import Image

_SEED = 26
_SIZES = ((320, 240), (240, 320), (400, 225), (333, 250), (640, 480))  # other shapes than most networks' input, too
# so low over a pad that it fills the frame
_NEAR = Domain(height_m=(0.5, 0.55), tilt_deg=(0.0, 3.0), absent=0.0, cut=0.0, small_print=0.0, occlusion=0.0)


def trial_pictures(count: int) -> Iterator[Image]:
    """Yield generated pictures (H, W, 3) BGR uint8, always the same; the pad fills the frame of the first."""
    for index in range(count):
        yield make_sample(Domain() if index else _NEAR, PadSpec(), _SIZES[index % len(_SIZES)], _SEED, index).image


def prepared(network: Network, image: Image, size: tuple[int, int] | None = None) -> tuple[Floats, Placement]:
    """Return what the network is given for a picture (H, W, 3) BGR uint8, (1, 3, h, w), and where the picture lies.

    size: width and height of the input; none: the network's own.
    """
    spec = InputSpec(preprocess="letterbox" if network.letterbox else "stretch")
    given = Preprocessor(spec, np.dtype(np.float32))
    return given.prepare(image, size or (network.width, network.height))


def smaller_size(network: Network) -> tuple[int, int]:
    """Return about half the network's input, in its strides: what a tracker looks at."""
    stride = network.stride
    return max(network.width // 2 // stride, 1) * stride, max(network.height // 2 // stride, 1) * stride
