"""Write a darknet network as ONNX, with batch norm folded into the kernels and the boxes decoded inside.

Height and width of the input are free, so that a tracker can look at a part of a picture; the grid of cells is made
from the shape the network is run at. Layer i of the cfg gives the tensor `layer<i>`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from landtool.darknet.forward import LARGEST_EXPONENT, LEAKY_SLOPE
from landtool.darknet.network import Convolutional, MaxPool, Network, Route, Upsample, Yolo
from landtool.darknet.weights import ConvolutionWeights, Floats, Weights
from landtool.errors import InputError
from landtool.export.rounding import Scale, Storage, column, rounded_kernels

OPSET, IR_VERSION = 17, 8  # what every ONNX Runtime since 1.12 takes
INPUT, OUTPUT = "images", "output0"


@dataclass(frozen=True)
class Rounding:
    """How an int8 network rounds. scales: of tensors, by name. exact: layers that stay float32."""

    scales: Mapping[str, Scale]
    exact: frozenset[int] = frozenset()


def build_model(
    network: Network,
    weights: Weights,
    *,
    size: tuple[int, int] | None = None,
    storage: Storage = "float32",
    rounding: Rounding | None = None,
    also: Sequence[str] = (),
) -> onnx.ModelProto:
    """Return the network as a checked ONNX model without metadata.

    size: width and height of its only input; none: they are free, in multiples of the network's stride.
    storage: how the kernels are kept; they are unpacked to float32 when the model is loaded. rounding: makes it
    compute in int8. also: names of tensors that it gives out, too.
    Raises InputError when weights are missing.
    """
    if not weights.is_complete(network):
        raise InputError("the weights hold the first layers of the network only", hint="give weights of all layers")
    graph = _Graph(network, storage, rounding)
    for index, layer in enumerate(network.layers):
        graph.add_layer(index, layer, weights.layers.get(index))
    graph.node("Concat", graph.found, OUTPUT, axis=2)
    width, height = size or ("width", "height")
    batch = "batch" if size is None else 1
    columns = "anchors" if size is None else column_count(network, size)
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "landtool",
            [helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, [batch, 3, height, width])],
            [
                helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, [batch, 4 + network.classes, columns]),
                *(helper.make_tensor_value_info(name, TensorProto.FLOAT, [None] * 4) for name in also),
            ],
            list(graph.constants.values()),
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="landtool",
    )
    onnx.checker.check_model(model)
    return model


def column_count(network: Network, size: tuple[int, int]) -> int:
    """Return how many boxes a network gives for an input of width and height."""
    cells = ((len(head.anchors), head.out.stride) for _, head in network.heads)
    return sum(anchors * (size[0] // stride) * (size[1] // stride) for anchors, stride in cells)


@dataclass
class _Graph:
    """The nodes so far. found: the decoded heads.

    _maps: each layer's tensor. _waiting: the tensors whose leaky activation is still to come: it grows with its
    input, so it can follow a maximum, where it has a quarter of the cells to work on.
    """

    network: Network
    storage: Storage
    rounding: Rounding | None
    nodes: list[onnx.NodeProto] = field(default_factory=list)
    constants: dict[str, onnx.TensorProto] = field(default_factory=dict)
    found: list[str] = field(default_factory=list)
    _maps: list[str] = field(default_factory=list)
    _waiting: set[str] = field(default_factory=set)
    _activated: dict[str, str] = field(default_factory=dict)

    def node(self, kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> str:
        """Add a node and return its output's name, which is its own, too."""
        self.nodes.append(helper.make_node(kind, list(inputs), [output], name=output, **attributes))
        return output

    def constant(self, name: str, values: NDArray[np.generic] | np.generic) -> str:
        """Add a constant, once, and return its name."""
        self.constants[name] = numpy_helper.from_array(np.asarray(values, order="C"), name)
        return name

    def whole(self, *values: int) -> str:
        """Add int64 numbers as a constant (N,)."""
        return self.constant("_".join(["whole", *map(str, values)]), np.asarray(values, np.int64))

    def add_layer(self, index: int, layer: object, numbers: ConvolutionWeights | None) -> None:
        """Add a layer of the cfg."""
        name = f"layer{index}"
        match layer:
            case Convolutional() if numbers is not None:
                self._maps.append(self._convolution(name, index, layer, numbers))
            case MaxPool():
                self._maps.append(self._pool(name, layer))
            case Upsample():
                self._maps.append(self._upsample(name, layer))
            case Route():
                self._maps.append(self._route(name, layer))
            case Yolo():
                self.found.append(self._decoded(name, layer))
                self._maps.append(self._maps[-1])

    def _layer(self, index: int) -> str:
        """Return the tensor of a layer, activated."""
        tensor = self._maps[index] if index >= 0 or self._maps else INPUT
        if tensor not in self._waiting:
            return self._rounded(tensor)
        if tensor not in self._activated:
            leaky = self.node("LeakyRelu", [self._rounded(tensor)], f"{tensor}_leaky", alpha=float(LEAKY_SLOPE))
            self._activated[tensor] = leaky
        return self._rounded(self._activated[tensor])

    def _rounded(self, tensor: str) -> str:
        """Return a tensor rounded to eight bits, where it has a scale."""
        scale = self.rounding.scales.get(tensor) if self.rounding else None
        if scale is None:
            return tensor
        done = f"{tensor}_rounded"
        if not any(node.name == done for node in self.nodes):
            step = self.constant(f"{tensor}_step", np.float32(scale.step))
            zero = self.constant(f"{tensor}_zero", np.uint8(scale.zero))
            self.node("QuantizeLinear", [tensor, step, zero], f"{tensor}_bits")
            self.node("DequantizeLinear", [f"{tensor}_bits", step, zero], done)
        return done

    def _convolution(self, name: str, index: int, layer: Convolutional, numbers: ConvolutionWeights) -> str:
        kernels, biases = numbers.folded()
        given = self._layer(-1)
        scale = self._input_scale(given)
        if scale is None or self.rounding is None or index in self.rounding.exact:
            parts = [self._kept(f"{name}_kernels", kernels), self.constant(f"{name}_biases", biases)]
        else:
            parts = self._rounded_parts(name, kernels, biases, scale)
        pads, sides = [layer.padding] * 4, [layer.size] * 2
        self.node("Conv", [given, *parts], name, kernel_shape=sides, strides=[layer.stride] * 2, pads=pads)
        if layer.activation == "leaky":
            self._waiting.add(name)
            if self.rounding is None:  # ONNX Runtime makes one node of both
                self._activated[name] = self.node("LeakyRelu", [name], f"{name}_leaky", alpha=float(LEAKY_SLOPE))
                return self._activated[name]
        return name

    def _input_scale(self, rounded: str) -> Scale | None:
        return self.rounding.scales.get(rounded.removesuffix("_rounded")) if self.rounding else None

    def _kept(self, name: str, kernels: Floats) -> str:
        """Return kernels as the file keeps them, unpacked to float32; ONNX Runtime does that once, at its start."""
        if self.storage == "float32":
            return self.constant(name, kernels)
        if self.storage == "float16":
            half = self.constant(f"{name}_half", kernels.astype(np.float16))
            return self.node("Cast", [half], name, to=TensorProto.FLOAT)
        bits, steps = rounded_kernels(kernels)
        levels = self.node("Cast", [self.constant(f"{name}_bits", bits)], f"{name}_levels", to=TensorProto.FLOAT)
        return self.node("Mul", [levels, self.constant(f"{name}_steps", column(steps))], name)

    def _rounded_parts(self, name: str, kernels: Floats, biases: Floats, scale: Scale) -> list[str]:
        """Return int8 kernels, and int32 biases of which one is the product of both steps."""
        bits, steps = rounded_kernels(kernels)
        bias_steps = (steps.astype(np.float64) * scale.step).astype(np.float32)
        bias_bits = np.clip(np.rint(biases / bias_steps.astype(np.float64)), -(2**31), 2**31 - 1).astype(np.int32)
        zeros = np.zeros(len(steps))
        parts = []
        for part, values, step in (("kernels", bits, steps), ("biases", bias_bits, bias_steps)):
            inputs = [
                self.constant(f"{name}_{part}_bits", values),
                self.constant(f"{name}_{part}_steps", step),
                self.constant(f"{name}_{part}_zeros", zeros.astype(values.dtype)),
            ]
            parts.append(self.node("DequantizeLinear", inputs, f"{name}_{part}", axis=0))
        return parts

    def _pool(self, name: str, layer: MaxPool) -> str:
        given = self._maps[-1] if self._maps else INPUT
        before, after = layer.padding
        # windows side by side never reach into a padding on the right only, as the input is a multiple of them
        pads = [0] * 4 if (before, layer.stride) == (0, layer.size) else [before, before, after, after]
        self.node(
            "MaxPool",
            [self._rounded(given)],
            name,
            kernel_shape=[layer.size] * 2,
            strides=[layer.stride] * 2,
            pads=pads,
        )
        if given in self._waiting:
            self._waiting.add(name)
        return name

    def _upsample(self, name: str, layer: Upsample) -> str:
        scales = self.constant(f"{name}_scales", np.asarray([1, 1, layer.factor, layer.factor], np.float32))
        how = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
        return self.node("Resize", [self._layer(-1), "", scales], name, **how)

    def _route(self, name: str, layer: Route) -> str:
        if len(layer.layers) == 1:
            return self._maps[layer.layers[0]]
        return self.node("Concat", [self._layer(index) for index in layer.layers], name, axis=1)

    def _decoded(self, name: str, head: Yolo) -> str:
        """Add a head's boxes and scores, (B, 4 + classes, anchors * h * w)."""
        raw, stride = self._layer(-1), head.out.stride
        count, channels = len(head.anchors), 5 + head.classes
        cells = self.node("Reshape", [raw, self.whole(0, count, channels, -1)], f"{name}_cells")

        def part(what: str, first: int, last: int) -> str:
            inputs = [cells, self.whole(first), self.whole(last), self.whole(2)]
            return self.node("Slice", inputs, f"{name}_t{what}")

        # c = sigmoid(t) s stride + (cell - (s - 1) / 2) stride
        share = self.node("Sigmoid", [part("xy", 0, 2)], f"{name}_share")
        reach = self.constant(f"{name}_reach", np.float32(head.scale_xy * stride))
        offset = self.node("Mul", [share, reach], f"{name}_offset")
        centre = self.node("Add", [offset, self._corners(name, raw, head)], f"{name}_centre")
        # side = anchor exp(t)
        most = self.constant("largest_exponent", LARGEST_EXPONENT)
        factor = self.node("Exp", [self.node("Min", [part("wh", 2, 4), most], f"{name}_power")], f"{name}_factor")
        anchors = self.constant(f"{name}_anchors", np.asarray(head.anchors, np.float32)[None, :, :, None])
        side = self.node("Mul", [factor, anchors], f"{name}_side")
        surely = self.node("Sigmoid", [part("object", 4, channels)], f"{name}_surely")
        sizes = self.constant(f"split_{head.classes}", np.asarray([1, head.classes], np.int64))
        self.nodes.append(helper.make_node("Split", [surely, sizes], [f"{name}_object", f"{name}_class"], axis=2))
        score = self.node("Mul", [f"{name}_object", f"{name}_class"], f"{name}_score")
        boxes = self.node("Concat", [centre, side, score], f"{name}_boxes", axis=2)
        turned = self.node("Transpose", [boxes], f"{name}_turned", perm=[0, 2, 1, 3])
        return self.node("Reshape", [turned, self.whole(0, 4 + head.classes, -1)], f"{name}_found")

    def _corners(self, name: str, raw: str, head: Yolo) -> str:
        """Add x and y of the cells, (1, 1, 2, h * w) in input pixels, from the shape the network is run at."""
        shape = self.node("Shape", [raw], f"{name}_shape", start=2)
        zero, one, stride = (self.constant(f"int_{v}", np.int64(v)) for v in (0, 1, head.out.stride))
        axes = []
        for axis, view in ((1, self.whole(1, -1)), (0, self.whole(-1, 1))):
            count = self.node("Gather", [shape, self.constant(f"int_{axis}", np.int64(axis))], f"{name}_count{axis}")
            numbers = self.node("Range", [zero, count, one], f"{name}_number{axis}")
            line = self.node(
                "Reshape", [self.node("Mul", [numbers, stride], f"{name}_at{axis}"), view], f"{name}_l{axis}"
            )
            full = self.node("Expand", [line, shape], f"{name}_full{axis}")
            axes.append(self.node("Reshape", [full, self.whole(1, 1, 1, -1)], f"{name}_row{axis}"))
        both = self.node("Concat", axes, f"{name}_grid", axis=2)
        exact = self.node("Cast", [both], f"{name}_corner", to=TensorProto.FLOAT)
        if head.scale_xy == 1.0:
            return exact
        shift = self.constant(f"{name}_shift", np.float32((head.scale_xy - 1.0) / 2.0 * head.out.stride))
        return self.node("Sub", [exact, shift], f"{name}_shifted")
