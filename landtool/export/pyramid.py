"""Let an ONNX network look at a picture twice, in full and in half size, in one graph with one set of weights."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from landtool.darknet.forward import GREY
from landtool.darknet.network import Network
from landtool.export.onnx_graph import INPUT, OUTPUT

HALF = "half_"  # before the names of what the second look works out


def looking(model: onnx.ModelProto, network: Network) -> onnx.ModelProto:
    """Return the model as it is, or looking twice where the network does."""
    return with_half_size(model, network) if network.pyramid else model


def with_half_size(model: onnx.ModelProto, network: Network) -> onnx.ModelProto:
    """Return the model with the boxes of both looks as its output; of other outputs, those of both, too.

    The half is the mean of two by two pixels, filled up with grey to whole cells, as landtool.darknet.forward has it.
    """
    looking = onnx.ModelProto()
    looking.CopyFrom(model)
    graph = looking.graph
    alike = _independent(graph)
    full = [_renamed(node, {OUTPUT: f"full_{OUTPUT}"}) for node in graph.node]
    names = {out: f"{HALF}{out}" for node in graph.node if node.output[0] not in alike for out in node.output}
    half = [_renamed(node, {**names, INPUT: f"{HALF}{INPUT}"}) for node in graph.node if node.output[0] not in alike]
    del graph.node[:]
    graph.node.extend([*full, *_halving(), *half, *_joining()])
    graph.initializer.extend(_constants(network))
    if graph.output[0].type.tensor_type.shape.dim[2].HasField("dim_value"):
        dim = graph.output[0].type.tensor_type.shape.dim[2]
        width, height = (graph.input[0].type.tensor_type.shape.dim[i].dim_value for i in (3, 2))
        cells = [(len(head.anchors), head.out.stride) for _, head in network.heads]
        columns, rows = network.half_size(width, height)
        dim.dim_value += sum(count * (columns // stride) * (rows // stride) for count, stride in cells)
    for output in list(graph.output)[1:]:
        more = helper.make_tensor_value_info(f"{HALF}{output.name}", TensorProto.FLOAT, [None] * 4)
        graph.output.append(more)
    onnx.checker.check_model(looking)
    return looking


def _independent(graph: onnx.GraphProto) -> set[str]:
    """Return the tensors that do not depend on the picture: they serve both looks."""
    known = {constant.name for constant in graph.initializer} | {""}
    for node in graph.node:
        if all(name in known for name in node.input):
            known.update(node.output)
    return known


def _renamed(node: onnx.NodeProto, names: dict[str, str]) -> onnx.NodeProto:
    copy = onnx.NodeProto()
    copy.CopyFrom(node)
    copy.input[:] = [names.get(name, name) for name in node.input]
    copy.output[:] = [names.get(name, name) for name in node.output]
    copy.name = copy.output[0]
    return copy


def _halving() -> list[onnx.NodeProto]:
    """The half of the input, and below and right of it as much grey as is missing to whole cells."""
    node = helper.make_node
    return [
        node("AveragePool", [INPUT], ["half_bare"], "half_bare", kernel_shape=[2, 2], strides=[2, 2]),
        node("Shape", ["half_bare"], ["half_shape"], "half_shape", start=2),
        node("Neg", ["half_shape"], ["half_negative"], "half_negative"),
        # of whole numbers, Mod takes the sign of its divisor: -h mod s is what h lacks to a multiple of s
        node("Mod", ["half_negative", "half_stride"], ["half_missing"], "half_missing"),
        node("Concat", ["half_nothing", "half_missing"], ["half_pads"], "half_pads", axis=0),
        node("Pad", ["half_bare", "half_pads", "half_grey"], [f"{HALF}{INPUT}"], "half_pad", mode="constant"),
    ]


def _joining() -> list[onnx.NodeProto]:
    """Boxes found at half size are in half pixels."""
    node = helper.make_node
    half = f"{HALF}{OUTPUT}"
    return [
        node("Mul", [half, "half_scale"], ["half_found"], "half_found"),
        node("Concat", [f"full_{OUTPUT}", "half_found"], [OUTPUT], OUTPUT, axis=2),
    ]


def _constants(network: Network) -> list[onnx.TensorProto]:
    scale = np.ones((1, 4 + network.classes, 1), np.float32)
    scale[:, :4] = 2.0
    values = {
        "half_stride": np.asarray([network.stride], np.int64),
        "half_nothing": np.zeros(6, np.int64),  # before every axis, and behind those of pictures and channels
        "half_grey": GREY,
        "half_scale": scale,
    }
    return [numpy_helper.from_array(np.asarray(value), name) for name, value in values.items()]
