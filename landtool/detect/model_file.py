"""Read an ONNX file and check it before anything runs it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import onnx
from google.protobuf.message import DecodeError

from landtool.detect.metadata import ModelMetadata, parse_metadata
from landtool.errors import InputError
from landtool.io.local import local_file

_MOST_BYTES = 2**31 - 1  # of one protobuf message
_ROUNDED_OPERATORS = frozenset({"QuantizeLinear", "DequantizeLinear", "QLinearConv", "ConvInteger"})


@dataclass(frozen=True)
class Port:
    """An input or output: shape with None where it is free, the ONNX name of its element type, as `FLOAT`."""

    name: str
    shape: tuple[int | None, ...]
    dtype: str

    def __str__(self) -> str:
        return f"{self.name} [{', '.join('?' if side is None else str(side) for side in self.shape)}]"


@dataclass(frozen=True, eq=False)
class ModelFile:
    """A checked ONNX model.

    file: where it was read. data: the model as bytes, complete: what was stored beside it has been put in.
    rounded: it computes with int8 or float16, which other processors may round in another way.
    """

    file: Path | None
    data: bytes
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    metadata: ModelMetadata
    rounded: bool


def read_model(path: Path) -> ModelFile:
    """Read and check an ONNX file.

    Raises UsageError for a path that is no plain file, InputError for a file that is no whole ONNX model, one whose
    weights lie outside its own folder, and one whose metadata cannot be used.
    """
    path = local_file(path)
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError("is larger than an ONNX model can be (2 GiB)", file=path, hint="give the model itself")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=path) from error
    return parse_model(data, path)


def parse_model(data: bytes, file: Path | None = None) -> ModelFile:
    """Check an ONNX model in memory; weights it keeps elsewhere are looked for in the folder of `file` only.

    Raises InputError as `read_model` does.
    """
    _refuse_other_kinds(data, file)
    try:
        proto = onnx.ModelProto.FromString(data)
    except DecodeError:
        raise InputError("is cut short, or no ONNX model", file=file, hint="copy or export it again") from None
    if not proto.graph.node or not proto.graph.output:
        raise InputError("is no ONNX model: there is no network in it", file=file, hint="copy or export it again")
    tensors = list(_tensors(proto))
    outside = [tensor for tensor in tensors if tensor.data_location == onnx.TensorProto.EXTERNAL]
    if outside:
        _put_in(outside, file)
        data = _serialized(proto, file)
    fed = {tensor.name for tensor in proto.graph.initializer}
    props = {entry.key: entry.value for entry in proto.metadata_props}
    return ModelFile(
        file=file,
        data=data,
        inputs=tuple(_port(value) for value in proto.graph.input if value.name not in fed),
        outputs=tuple(_port(value) for value in proto.graph.output),
        metadata=parse_metadata(props, file),
        rounded=any(tensor.data_type == onnx.TensorProto.FLOAT16 for tensor in tensors)
        or any(node.op_type in _ROUNDED_OPERATORS for node in proto.graph.node),
    )


def _refuse_other_kinds(data: bytes, file: Path | None) -> None:
    """Name the files that are often mistaken for a model: none of them begins as one."""
    start = data[:512].lstrip().lower()
    if not data:
        raise InputError("is empty", file=file, hint="copy or export it again")
    if start.startswith((b"<!doctype", b"<html", b"<?xml")):
        raise InputError("is a web page, no ONNX model", file=file, hint="download the file behind the page")
    if start.startswith(b"version https://git-lfs"):
        raise InputError("is a Git LFS pointer, no ONNX model", file=file, hint="fetch the file with `git lfs pull`")
    if start.startswith((b"pk\x03\x04", b"\x80\x02", b"\x80\x04")):
        raise InputError("is a PyTorch checkpoint or archive", file=file, hint="export it to ONNX with its own tools")


def _tensors(message: Any) -> Iterator[onnx.TensorProto]:
    """Yield every tensor, wherever in the model it is stored: initializers, attributes, subgraphs, functions."""
    for field, value in message.ListFields():
        if field.message_type is None:
            continue
        for item in value if hasattr(value, "__len__") else (value,):
            if isinstance(item, onnx.TensorProto):
                yield item
            else:
                yield from _tensors(item)


def _put_in(tensors: list[onnx.TensorProto], file: Path | None) -> None:
    """Move what is stored beside the model into it. Raises InputError for any place outside the model's folder."""
    total = 0
    for tensor in tensors:
        entries = {entry.key: entry.value for entry in tensor.external_data}
        place = _place(entries.get("location", ""), file)
        try:
            offset, size = int(entries.get("offset", 0)), place.stat().st_size
            length = int(entries.get("length", size - offset))
            total += length
            if min(offset, length) < 0 or offset + length > size or total > _MOST_BYTES:
                raise ValueError
            with place.open("rb") as beside:
                beside.seek(offset)
                tensor.raw_data = beside.read(length)
        except (OSError, ValueError):
            reason = f"its weights in {place.name} are incomplete"
            raise InputError(reason, file=file, hint="copy both files again") from None
        del tensor.external_data[:]
        tensor.ClearField("data_location")


def _place(location: str, file: Path | None) -> Path:
    hint = "store the weights in the model itself, or in a file beside it"
    folder = None if file is None else file.parent.resolve()
    try:
        place = None if folder is None or not location else (folder / location).resolve()
        inside = place is not None and folder in place.parents
    except (OSError, ValueError, RuntimeError):  # a name that is too long, a NUL in it, a circle of links
        inside = False
    if not inside or place is None:
        raise InputError(f"keeps weights outside its folder, in '{location[:80]}'", file=file, hint=hint)
    if not place.is_file():
        raise InputError(f"its weights are missing: {place.name}", file=file, hint="copy that file beside the model")
    return place


def _serialized(proto: onnx.ModelProto, file: Path | None) -> bytes:
    try:
        return proto.SerializeToString()
    except ValueError:
        raise InputError(
            "is larger than an ONNX model can be (2 GiB)", file=file, hint="export a smaller one"
        ) from None


def _port(value: onnx.ValueInfoProto) -> Port:
    tensor = value.type.tensor_type
    sides = tuple(side.dim_value if side.HasField("dim_value") else None for side in tensor.shape.dim)
    return Port(value.name, sides, onnx.TensorProto.DataType.Name(tensor.elem_type))
