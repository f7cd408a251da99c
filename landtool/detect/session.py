"""A network ready to run: ONNX Runtime on the CPU, one picture in, arrays out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from landtool.detect.metadata import Anchors
from landtool.detect.model_file import ModelFile, Port
from landtool.errors import InputError

_INPUT_TYPES: dict[str, type[np.generic]] = {"FLOAT": np.float32, "FLOAT16": np.float16, "UINT8": np.uint8}
_SILENT = 4  # ONNX Runtime's severity "fatal": its warnings are for those who made the model


@dataclass(frozen=True, eq=False)
class Outputs:
    """What a network gave for one picture of width x height input pixels, and the anchors its raw heads refer to."""

    names: tuple[str, ...]
    arrays: tuple[NDArray[Any], ...]
    width: int
    height: int
    anchors: Anchors | None = None

    def __str__(self) -> str:
        return ", ".join(f"{name} {list(array.shape)}" for name, array in zip(self.names, self.arrays, strict=True))


class Session:
    """Runs a checked model. dtype: of its input. fixed_size: width and height of it, None where they are free.

    Raises InputError for a model ONNX Runtime refuses, or that does not take one picture (1, 3, height, width).
    """

    def __init__(self, model: ModelFile, *, threads: int = 1) -> None:
        self.model = model
        self._picture, self._shape = self._inputs(model)
        self.dtype = np.dtype(_INPUT_TYPES[self._picture.dtype])
        height, width = self._picture.shape[2:]
        self.fixed_size = None if width is None or height is None else (width, height)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = _SILENT
        # a thread that spins between two pictures takes its core from the decoder
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = onnxruntime.InferenceSession(model.data, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # its exceptions have no common class but this
            reason = f"ONNX Runtime refuses it: {_first_line(error)}"
            raise InputError(reason, file=model.file, hint="export it again") from error
        self._output_names = tuple(port.name for port in model.outputs)

    def run(self, tensor: NDArray[Any]) -> Outputs:
        """Run on one prepared picture (1, 3, height, width) of `dtype`. Raises InputError when the network fails."""
        height, width = tensor.shape[2:]
        feeds = {self._picture.name: tensor}
        if self._shape is not None:
            # the original's size: said to be the input's, so that boxes come in pixels of the input
            feeds[self._shape.name] = np.array([[height, width]], dtype=np.float32)
        try:
            arrays = self._session.run(None, feeds)
        except Exception as error:
            reason = f"cannot run at {width}x{height}: {_first_line(error)}"
            raise InputError(reason, file=self.model.file, hint="choose another --imgsz or model") from error
        return Outputs(self._output_names, tuple(arrays), width, height, self.model.metadata.anchors)

    @staticmethod
    def _inputs(model: ModelFile) -> tuple[Port, Port | None]:
        """Return the input of the picture, and the one of its size, where there is one."""
        pictures = [port for port in model.inputs if len(port.shape) == 4]
        others = [port for port in model.inputs if len(port.shape) != 4]
        said = ", ".join(map(str, model.inputs)) or "none"
        if len(pictures) != 1 or len(others) > 1 or any(port.name != "image_shape" for port in others):
            raise InputError(f"does not take one picture; its inputs: {said}", file=model.file, hint=_WANTED)
        picture = pictures[0]
        # a shape may say 0 or -1 where it means that a side is free
        sides = tuple(side if side is not None and side > 0 else None for side in picture.shape)
        if sides[0] not in (None, 1) or sides[1] not in (None, 3) or picture.dtype not in _INPUT_TYPES:
            raise InputError(f"takes no BGR picture; its input: {picture}", file=model.file, hint=_WANTED)
        return Port(picture.name, sides, picture.dtype), others[0] if others else None


_WANTED = "export it with an input [1, 3, height, width] of float32, float16 or uint8"


def _first_line(error: Exception) -> str:
    """Return what ONNX Runtime said, without its codes and source lines."""
    text = re.sub(r"^\[ONNXRuntimeError\] : \d+ : \w+ : ", "", str(error))
    line = (text.strip().splitlines() or ["no reason given"])[0]
    line = re.sub(r"\S+\.(cc|h):\d+ \S+( \S+\))? ", "", line)
    return line if len(line) <= 160 else f"{line[:157]}..."
