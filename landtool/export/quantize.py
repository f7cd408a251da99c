"""Make a network compute in eight bits: scales from pictures, chosen so that what follows sees the least error."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import onnx

from landtool.darknet.forward import LEAKY_SLOPE
from landtool.darknet.network import Network
from landtool.darknet.weights import Floats, Weights
from landtool.detect.model_file import parse_model
from landtool.detect.session import Session
from landtool.errors import InputError
from landtool.export.onnx_graph import INPUT, Rounding, build_model
from landtool.export.rounding import Scale, scale_between

_VALUES = 8192  # of a tensor that are kept of each picture
_BINS = 4096
_SHARES = np.geomspace(1.0, 0.1, 20)  # of the least and the greatest value, beyond which the rest may be cut off
_PICTURES = Scale(float(np.float32(1.0 / 255.0)), 0)  # these come in 256 levels as they are
_MAPS = re.compile(r"layer\d+(_leaky)?")


def choose_rounding(network: Network, weights: Weights, pictures: Iterable[Floats]) -> Rounding:
    """Return how a network is to round, from prepared pictures (1, 3, H, W) like those it will see.

    The convolutions that the heads read stay exact: their numbers go through exponentials, and cost next to nothing.
    Raises InputError without pictures.
    """
    exact = frozenset(index - 1 for index, _ in network.heads)
    groups = _groups(build_model(network, weights, rounding=Rounding({})), exact)
    tensors = sorted({tensor for group in groups for tensor in group.read})
    samples = _samples(network, weights, tensors, pictures)
    scales = {INPUT: _PICTURES}
    for group in groups:
        values = np.concatenate([samples[tensor] for tensor in group.read])
        scales |= dict.fromkeys(group.members, best_scale(values, leaky=group.leaky))
    return Rounding(scales, exact)


def best_scale(values: Floats, *, leaky: bool) -> Scale:
    """Return the scale under which values (N,) lose least, in the squared error summed over all.

    leaky: an activation follows, in which an error below 0 shrinks to a tenth.
    """
    counts, edges = np.histogram(values, _BINS)
    seen = counts > 0
    centres, weight = ((edges[:-1] + edges[1:]) / 2.0)[seen], counts[seen]
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)

    def loss(scale: Scale) -> float:
        levels = np.clip(np.rint(centres / scale.step) + scale.zero, 0, 255)
        back = (levels - scale.zero) * scale.step
        error = _activated(back) - _activated(centres) if leaky else back - centres
        return float(np.sum(weight * error**2))

    return min((scale_between(low * a, high * b) for b in _SHARES for a in _SHARES), key=loss)


@dataclass
class _Group:
    """Tensors of one scale, so that a maximum or an enlargement works on the levels themselves.

    read: those that anything else works on. leaky: that is an activation.
    """

    members: list[str]
    read: list[str] = field(default_factory=list)
    leaky: bool = False


def _groups(model: onnx.ModelProto, exact: frozenset[int]) -> list[_Group]:
    """Return the groups of the tensors that are to be rounded, in their order in the network."""
    groups: dict[str, _Group] = {}
    kept = {f"layer{index}" for index in exact}
    for node in model.graph.node:
        name = node.output[0]
        for given in node.input:
            if given in groups and node.op_type != "MaxPool" and given not in groups[given].read:
                groups[given].read.append(given)
                groups[given].leaky |= node.op_type == "LeakyRelu"
        if not _MAPS.fullmatch(name) or name in kept:
            continue
        if node.op_type in ("MaxPool", "Resize") and node.input[0] in groups:
            groups[name] = groups[node.input[0]]
            groups[name].members.append(name)
        else:
            groups[name] = _Group([name])
    unique = {id(group): group for group in groups.values() if group.read}
    return list(unique.values())


def _samples(
    network: Network, weights: Weights, tensors: Sequence[str], pictures: Iterable[Floats]
) -> Mapping[str, Floats]:
    """Return values of tensors over all pictures, their least and greatest among them."""
    model = build_model(network, weights, rounding=Rounding({}), also=tensors)
    session = Session(parse_model(model.SerializeToString()))
    found: dict[str, list[Floats]] = {tensor: [] for tensor in tensors}
    for picture in pictures:
        outputs = session.run(picture)
        for name, array in zip(outputs.names, outputs.arrays, strict=True):
            if name in found:
                values = array.ravel()
                found[name] += [values[:: max(values.size // _VALUES, 1)], np.asarray([values.min(), values.max()])]
    if not any(found.values()):
        raise InputError("there is no picture to choose the scales by", hint="give pictures with --calibration")
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _activated(values: Floats) -> Floats:
    return np.asarray(np.maximum(values, LEAKY_SLOPE * values))
