"""Read and write darknet's .weights: a header, then the float32 numbers of each convolution, in the cfg's order.

Layout (hank-ai/darknet, weights.cpp): int32 major, minor, revision; `seen`, uint64 from version 0.2 on and uint32
before; then a convolution: biases, with batch norm scales, means and variances, then the kernels (filters, channels,
size, size). All little-endian. A file that ends after some convolutions holds a backbone.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landtool.darknet.network import Convolutional, Network
from landtool.errors import InputError, UsageError
from landtool.io.atomic import atomic_path
from landtool.io.local import local_file

Floats = NDArray[np.float32]
BATCH_NORM_EPSILON = 1e-5  # AlexeyAB's and hank-ai's darknet, and torch: (x - mean) / sqrt(variance + epsilon)
_NUMBER = np.dtype("<f4")
_VERSION = (0, 2, 5)
_TRANSPOSED = 1000  # a version beyond it marks kernels stored transposed, by no network of this kind


@dataclass(frozen=True, eq=False)
class ConvolutionWeights:
    """The numbers of one convolution, float32.

    biases: (filters,), those of batch norm where there is one. kernels: (filters, channels, size, size).
    scales, means, variances: (filters,) of batch norm, None without.
    """

    biases: Floats
    kernels: Floats
    scales: Floats | None = None
    means: Floats | None = None
    variances: Floats | None = None

    def folded(self) -> tuple[Floats, Floats]:
        """Return kernels and biases of the same convolution without batch norm.

        k' = k s / sqrt(v + e), b' = b - m s / sqrt(v + e), worked out in double precision.
        """
        if self.scales is None or self.means is None or self.variances is None:
            return self.kernels, self.biases
        factor = self.scales.astype(np.float64) / np.sqrt(self.variances.astype(np.float64) + BATCH_NORM_EPSILON)
        kernels = self.kernels * factor[:, None, None, None]
        biases = self.biases - self.means * factor
        return kernels.astype(np.float32), biases.astype(np.float32)

    def arrays(self) -> Iterator[Floats]:
        """Yield the numbers in the file's order."""
        yield self.biases
        for array in (self.scales, self.means, self.variances):
            if array is not None:
                yield array
        yield self.kernels


@dataclass(frozen=True, eq=False)
class Weights:
    """What a weights file holds. seen: pictures trained on. version: its header's.

    layers: the numbers of the first convolutions of a network, by layer index; all of them unless it is a backbone.
    """

    layers: dict[int, ConvolutionWeights]
    seen: int = 0
    version: tuple[int, int, int] = _VERSION

    def is_complete(self, network: Network) -> bool:
        """Whether every convolution of the network is there."""
        return all(index in self.layers for index, _ in network.convolutions)


def read_weights(path: Path, network: Network, *, backbone: bool = False) -> Weights:
    """Read the weights of a network.

    backbone: the file may end after any convolution, as one for fine-tuning does.
    Raises UsageError when the file cannot be opened; InputError when its length is not exactly that of the network,
    or when it holds numbers that are not finite or variances below zero.
    """
    try:
        data = local_file(path).read_bytes()
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path, hint="give a darknet .weights file") from error
    try:
        return parse_weights(data, network, backbone=backbone)
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint) from error


def parse_weights(data: bytes, network: Network, *, backbone: bool = False) -> Weights:
    """Return the weights of a network from the bytes of a file; see `read_weights`."""
    version, seen, start = _header(data)
    _check_length(len(data) - start, network, backbone)
    numbers = np.frombuffer(data, _NUMBER, offset=start).astype(np.float32)
    layers: dict[int, ConvolutionWeights] = {}
    place = 0
    for index, layer in network.convolutions:
        if place + layer.parameters > len(numbers):
            break
        layers[index] = _convolution(numbers[place : place + layer.parameters], layer, index)
        place += layer.parameters
    return Weights(layers, seen, version)


def weights_bytes(weights: Weights, network: Network) -> bytes:
    """Return the bytes of a file with these weights, in the order of the network's layers."""
    major, minor, revision = weights.version
    seen = struct.pack("<Q" if _is_long(major, minor) else "<I", weights.seen)
    parts = [struct.pack("<3i", major, minor, revision), seen]
    for index, _ in network.convolutions:
        if index in weights.layers:
            parts += [array.astype(_NUMBER).tobytes() for array in weights.layers[index].arrays()]
    return b"".join(parts)


def write_weights(path: Path, weights: Weights, network: Network, *, overwrite: bool = False) -> None:
    """Write a weights file, whole or not at all. Raises OutputError, OutputExistsError as `atomic_path` does."""
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(weights_bytes(weights, network))


def _header(data: bytes) -> tuple[tuple[int, int, int], int, int]:
    """Return version, pictures seen, and the header's length."""
    if len(data) < 12:
        raise InputError("is too short for a weights file")
    major, minor, revision = struct.unpack_from("<3i", data)
    if not (0 <= major <= _TRANSPOSED and 0 <= minor <= _TRANSPOSED):
        raise InputError(f"is no weights file (version {major}.{minor})", hint="give a darknet .weights file")
    kind = "<Q" if _is_long(major, minor) else "<I"
    length = 12 + struct.calcsize(kind)
    if len(data) < length:
        raise InputError("is too short for a weights file")
    return (major, minor, revision), struct.unpack_from(kind, data, 12)[0], length


def _is_long(major: int, minor: int) -> bool:
    return major * 10 + minor >= 2


def _check_length(size: int, network: Network, backbone: bool) -> None:
    wanted = _NUMBER.itemsize * network.parameters
    if size == wanted:
        return
    ends = _NUMBER.itemsize * np.cumsum([layer.parameters for _, layer in network.convolutions])
    if size in ends:
        if backbone:
            return
        reason = f"holds the first {int(np.searchsorted(ends, size)) + 1} of {len(ends)} convolutions only"
        raise InputError(reason, hint="a backbone is for `landtool train --weights`")
    by = f"{abs(size - wanted)} bytes {'short' if size < wanted else 'too long'}"
    reason = f"does not fit the cfg: {size} bytes of weights, {wanted} belong to it ({by})"
    raise InputError(reason, hint="give the cfg it was trained with, or a whole file")


def _convolution(numbers: Floats, layer: Convolutional, index: int) -> ConvolutionWeights:
    if not np.isfinite(numbers).all():
        raise InputError(f"layer {index} holds numbers that are not finite", hint="the training failed; use another")
    n = layer.filters
    kernels = numbers[len(numbers) - n * layer.channels * layer.size**2 :]
    kernels = kernels.reshape(n, layer.channels, layer.size, layer.size)
    if not layer.batch_normalize:
        return ConvolutionWeights(numbers[:n], kernels)
    biases, scales, means, variances = numbers[: 4 * n].reshape(4, n)
    if (variances < 0.0).any():
        raise InputError(f"layer {index} holds variances below zero", hint="give the cfg it was trained with")
    return ConvolutionWeights(biases, kernels, scales, means, variances)
