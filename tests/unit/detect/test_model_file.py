from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from landtool.detect.model_file import parse_model, read_model
from landtool.errors import InputError, UsageError
from tests.unit.detect.networks import NAMES, model_of, random_convolution, red_cells, saved


def refused(path: Path) -> InputError:
    """The error a file is refused with: one line that names the file and says what to do."""
    with pytest.raises(InputError) as caught:
        read_model(path)
    assert caught.value.file == str(path)
    assert caught.value.hint
    assert "\n" not in str(caught.value)
    return caught.value


def beside(model: onnx.ModelProto, location: str, *, length: int | None = None) -> onnx.ModelProto:
    """Move the first initializer's data to a file, by name only."""
    tensor = model.graph.initializer[0]
    tensor.data_location = TensorProto.EXTERNAL
    count = len(tensor.raw_data) if length is None else length
    for key, value in (("location", location), ("offset", "0"), ("length", str(count))):
        tensor.external_data.add(key=key, value=value)
    tensor.ClearField("raw_data")
    return model


def test_a_whole_model_is_read(tmp_path: Path) -> None:
    model = read_model(saved(tmp_path / "m.onnx", red_cells(), NAMES))
    assert [str(port) for port in model.inputs] == ["images [1, 3, ?, ?]"]
    assert [port.name for port in model.outputs] == ["output0"]
    assert model.metadata.names == ("pad",)
    assert model.metadata.stride == 32
    assert not model.rounded


def test_int8_and_float16_are_told(tmp_path: Path) -> None:
    assert read_model(saved(tmp_path / "m.onnx", random_convolution(int8=True))).rounded
    node = helper.make_node("Identity", ["images"], ["output0"])
    half = model_of([node], ["output0"], {"half": np.float16(1.0)}, size=None)
    assert parse_model(half.SerializeToString()).rounded


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"<!DOCTYPE html><html><body>404</body></html>", "web page"),
        (b"\n  <html>\n<head></head></html>", "web page"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "Git LFS"),
        (b"PK\x03\x04 archive/data.pkl", "PyTorch"),
        (b"\x80\x02ctorch\n", "PyTorch"),
        (b"just words, no model", "no ONNX model"),
        (bytes(5000), "no ONNX model"),
        (b"\x08\x08", "no network in it"),
    ],
)
def test_other_files_are_named_for_what_they_are(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "m.onnx"
    path.write_bytes(content)
    assert said in refused(path).reason


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_a_cut_model_is_refused(share: float, tmp_path: Path) -> None:
    path = saved(tmp_path / "m.onnx", random_convolution(), NAMES)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    assert "ONNX" in refused(path).reason or "cannot be used" in refused(path).reason


def test_a_folder_or_nothing_is_a_wrong_path(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.onnx"):
        with pytest.raises(UsageError):
            read_model(path)


@pytest.mark.parametrize("location", ["../secret.bin", "/etc/hostname", "", "link.bin", "\0", "a/../../secret.bin"])
def test_weights_outside_the_folder_are_never_read(location: str, tmp_path: Path) -> None:
    (tmp_path / "secret.bin").write_bytes(bytes(100_000))
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    path = saved(folder / "m.onnx", beside(random_convolution(), location))
    assert "outside its folder" in refused(path).reason


def test_weights_in_a_subgraph_are_found_too(tmp_path: Path) -> None:
    branch = beside(random_convolution(), "../secret.bin").graph
    node = helper.make_node("If", ["images"], ["output0"], then_branch=branch, else_branch=branch)
    path = saved(tmp_path / "m.onnx", model_of([node], ["output0"], {}, size=None))
    assert "outside its folder" in refused(path).reason


def test_weights_beside_the_model_are_put_in(tmp_path: Path) -> None:
    model = random_convolution()
    whole = parse_model(model.SerializeToString())
    (tmp_path / "m.onnx.data").write_bytes(model.graph.initializer[0].raw_data)
    path = saved(tmp_path / "m.onnx", beside(model, "m.onnx.data"))
    assert onnx.load_from_string(read_model(path).data) == onnx.load_from_string(whole.data)


def test_weights_beside_the_model_must_be_whole(tmp_path: Path) -> None:
    model = random_convolution()
    data = model.graph.initializer[0].raw_data
    path = saved(tmp_path / "m.onnx", beside(model, "m.data"))
    assert "missing: m.data" in refused(path).reason
    (tmp_path / "m.data").write_bytes(data[:-4])
    assert "m.data are incomplete" in refused(path).reason


def test_a_model_in_memory_keeps_nothing_elsewhere() -> None:
    with pytest.raises(InputError, match="outside its folder"):
        parse_model(beside(random_convolution(), "m.data").SerializeToString())
