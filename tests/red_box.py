"""A network that a test can foresee: one box around all that is red."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper

SCORE = 0.9
_MORE_RED = 0.25  # than green, of 1, to be red


def red_box(path: Path, *, label: str = "pad", size: tuple[int, int] | None = None, widened_px: float = 0.0) -> Path:
    """Write it as ONNX. size: width and height of its input; None takes any. widened_px: on every side of the box."""
    height, width = ("height", "width") if size is None else size[::-1]
    constants = {
        "0": np.array([0]), "1": np.array([1]), "2": np.array([2]), "axis1": np.array([1]), "flat": np.array([1, 5, 1]),
        "more": np.float32(_MORE_RED), "one": np.float32(1.0), "half": np.float32(0.5), "score": np.float32(SCORE),
        "wide": np.float32(2.0 * widened_px),
    }  # fmt: skip
    node = helper.make_node
    nodes = [
        node("Slice", ["images", "0", "1", "axis1"], ["red"]),
        node("Slice", ["images", "1", "2", "axis1"], ["green"]),
        node("Sub", ["red", "green"], ["redness"]),
        node("Greater", ["redness", "more"], ["is-red"]),
        node("Cast", ["is-red"], ["mask"], to=TensorProto.FLOAT),
        node("ReduceMax", ["mask"], ["any"], axes=[2, 3], keepdims=1),
        node("Mul", ["any", "score"], ["scores"]),
    ]
    for axis, other, name in ((3, 2, "x"), (2, 3, "y")):
        nodes += [
            node("ReduceMax", ["mask"], [f"along-{name}"], axes=[other], keepdims=1),
            node("ArgMax", [f"along-{name}"], [f"first-{name}-int"], axis=axis, keepdims=1),
            node("ArgMax", [f"along-{name}"], [f"last-{name}-int"], axis=axis, keepdims=1, select_last_index=1),
            node("Cast", [f"first-{name}-int"], [f"first-{name}"], to=TensorProto.FLOAT),
            node("Cast", [f"last-{name}-int"], [f"last-{name}"], to=TensorProto.FLOAT),
            node("Add", [f"last-{name}", "one"], [f"end-{name}"]),
            node("Add", [f"first-{name}", f"end-{name}"], [f"twice-{name}"]),
            node("Mul", [f"twice-{name}", "half"], [f"centre-{name}"]),
            node("Sub", [f"end-{name}", f"first-{name}"], [f"tight-{name}"]),
            node("Add", [f"tight-{name}", "wide"], [f"side-{name}"]),
        ]
    nodes += [
        node("Concat", ["centre-x", "centre-y", "side-x", "side-y", "scores"], ["joined"], axis=1),
        node("Reshape", ["joined", "flat"], ["output0"]),
    ]
    graph = helper.make_graph(
        nodes,
        "red box",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, height, width])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 5, 1])],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    said = {"names": repr({0: label}), "landtool.layout": "yolov8", "imgsz": "[480, 640]", "stride": "32"}
    helper.set_model_props(model, said)
    path.write_bytes(model.SerializeToString())
    return path
