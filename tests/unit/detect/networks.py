"""Small networks, built node by node, that tests of the detector run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

Arrays = Mapping[str, NDArray[Any]]
NAMES = {"names": "{0: 'pad'}", "stride": "32", "task": "detect"}


def saved(path: Path, model: onnx.ModelProto, metadata: Mapping[str, str] | None = None) -> Path:
    """Write a model with these metadata entries."""
    helper.set_model_props(model, dict(metadata or {}))
    path.write_bytes(model.SerializeToString())
    return path


def model_of(
    nodes: Sequence[onnx.NodeProto],
    outputs: Sequence[str],
    constants: Arrays,
    *,
    size: tuple[int, int] | None,
    dtype: int = TensorProto.FLOAT,
    integers: Sequence[str] = (),
    more_inputs: Sequence[onnx.ValueInfoProto] = (),
) -> onnx.ModelProto:
    """A network of these nodes with the input `images`, of `size` (width, height) or free."""
    height, width = ("height", "width") if size is None else size[::-1]
    graph = helper.make_graph(
        list(nodes),
        "network",
        [helper.make_tensor_value_info("images", dtype, [1, 3, height, width]), *more_inputs],
        [
            helper.make_tensor_value_info(name, TensorProto.INT32 if name in integers else TensorProto.FLOAT, None)
            for name in outputs
        ],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def fixed_answer(
    answers: Arrays,
    scores: Arrays,
    *,
    size: tuple[int, int],
    red: int = 0,
    full: float = 1.0,
    with_shape: bool = False,
) -> onnx.ModelProto:
    """A network that gives `answers` for a picture that is all red, as channel `red` of value `full`.

    For any other `answers + (red / full - 1) * scores`: a wrong channel or range shows in the scores.
    """
    constants: dict[str, NDArray[Any]] = {
        "first": np.array([red]), "last": np.array([red + 1]), "axis": np.array([1]),
        "full": np.float32(full), "one": np.float32(1.0),
    }  # fmt: skip
    nodes = [
        helper.make_node("Slice", ["images", "first", "last", "axis"], ["red"]),
        helper.make_node("ReduceMean", ["red"], ["mean"], keepdims=0),
        helper.make_node("Div", ["mean", "full"], ["share"]),
        helper.make_node("Sub", ["share", "one"], ["lack"]),
    ]
    integers = [name for name, answer in answers.items() if answer.dtype == np.int32]
    for name, answer in answers.items():
        constants[f"{name}-is"] = answer
        if name in integers:
            nodes.append(helper.make_node("Identity", [f"{name}-is"], [name]))
            continue
        constants[f"{name}-by"] = scores.get(name, np.float32(0.0))
        nodes.append(helper.make_node("Mul", ["lack", f"{name}-by"], [f"{name}-lack"]))
        nodes.append(helper.make_node("Add", [f"{name}-is", f"{name}-lack"], [name]))
    shape = [helper.make_tensor_value_info("image_shape", TensorProto.FLOAT, [1, 2])] if with_shape else []
    return model_of(nodes, list(answers), constants, size=size, integers=integers, more_inputs=shape)


def red_cells(size: tuple[int, int] | None = None, dtype: int = TensorProto.FLOAT) -> onnx.ModelProto:
    """A network of layout yolov8 that scores every cell of 32 x 32 input pixels by how red (not white) it is.

    Its boxes are the cells. `dtype`: of the input; a byte counts as 1 / 255.
    """
    kernel = np.zeros((1, 3, 32, 32), dtype=np.float32)
    kernel[0, 0], kernel[0, 1] = 1.0 / 1024, -1.0 / 1024
    constants: dict[str, NDArray[Any]] = {
        "kernel": kernel, "x": np.array(3), "y": np.array(2), "half": np.float32(0.5), "side": np.float32(32.0),
        "flat": np.array([1, 5, -1]), "unit": np.float32(1 / 255 if dtype == TensorProto.UINT8 else 1.0),
    }  # fmt: skip
    nodes = [
        helper.make_node("Cast", ["images"], ["floats"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["floats", "unit"], ["units"]),
        helper.make_node("Conv", ["units", "kernel"], ["difference"], strides=[32, 32]),
        helper.make_node("Relu", ["difference"], ["score"]),
        helper.make_node("Equal", ["score", "score"], ["same"]),
        helper.make_node("Cast", ["same"], ["ones"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["ones", "side"], ["sides"]),
    ]
    for axis in "xy":
        nodes += [
            helper.make_node("CumSum", ["ones", axis], [f"count-{axis}"]),
            helper.make_node("Sub", [f"count-{axis}", "half"], [f"cell-{axis}"]),
            helper.make_node("Mul", [f"cell-{axis}", "side"], [f"centre-{axis}"]),
        ]
    nodes += [
        helper.make_node("Concat", ["centre-x", "centre-y", "sides", "sides", "score"], ["maps"], axis=1),
        helper.make_node("Reshape", ["maps", "flat"], ["output0"]),
    ]
    return model_of(nodes, ["output0"], constants, size=size, dtype=dtype)


def random_convolution(
    size: tuple[int, int] | None = None, *, int8: bool = False, swap: bool = False
) -> onnx.ModelProto:
    """A network of layout yolov8 with random weights; `swap` exchanges its red and blue weights."""
    weights = np.random.default_rng(5).normal(0.0, 0.3, (5, 3, 32, 32)).astype(np.float32)
    if swap:
        weights = weights[:, ::-1].copy()
    constants: dict[str, NDArray[Any]] = {
        "weights": weights, "flat": np.array([1, 5, -1]), "split": np.array([4, 1]),
        "scale": np.float32(1 / 255), "zero": np.uint8(0),
    }  # fmt: skip
    start = [
        helper.make_node("QuantizeLinear", ["images", "scale", "zero"], ["bytes"]),
        helper.make_node("DequantizeLinear", ["bytes", "scale", "zero"], ["input"]),
    ]
    nodes = [
        *(start if int8 else [helper.make_node("Identity", ["images"], ["input"])]),
        helper.make_node("Conv", ["input", "weights"], ["maps"], strides=[32, 32]),
        helper.make_node("Reshape", ["maps", "flat"], ["rows"]),
        helper.make_node("Split", ["rows", "split"], ["boxes", "logits"], axis=1),
        helper.make_node("Sigmoid", ["logits"], ["scores"]),
        helper.make_node("Concat", ["boxes", "scores"], ["output0"], axis=1),
    ]
    return model_of(nodes, ["output0"], constants, size=size)
