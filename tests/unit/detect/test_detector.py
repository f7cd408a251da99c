from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import TensorProto, helper

from landtool.detect.config import BOUNDS
from landtool.detect.detector import Detector, DetectorConfig
from landtool.detect.search import Region
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.types import Detection, Image
from tests.unit.detect.networks import NAMES, model_of, red_cells, saved

SIZE = {"imgsz": "[128, 160]"}


@pytest.fixture
def free(tmp_path: Path) -> Path:
    return saved(tmp_path / "free.onnx", red_cells(), {**NAMES, **SIZE})


@pytest.fixture
def fixed(tmp_path: Path) -> Path:
    return saved(tmp_path / "fixed.onnx", red_cells((160, 128)), NAMES)


def detector(path: Path, **config: Any) -> Detector:
    return Detector(DetectorConfig(model=path, **config))


def red_square(x: int, y: int, side: int = 32, width: int = 160, height: int = 128) -> Image:
    picture = np.zeros((height, width, 3), np.uint8)
    picture[y : y + side, x : x + side, 2] = 255
    return picture


def edges(seen: Detection) -> list[float]:
    return [seen.x_min_px, seen.y_min_px, seen.x_max_px, seen.y_max_px]


@pytest.mark.parametrize("dtype", [TensorProto.FLOAT, TensorProto.FLOAT16, TensorProto.UINT8])
def test_the_red_cell_is_found(dtype: int, tmp_path: Path) -> None:
    path = saved(tmp_path / "m.onnx", red_cells(dtype=dtype), {**NAMES, **SIZE})
    (seen,) = detector(path).detect(red_square(64, 32))
    assert seen.label == "pad"
    assert seen.score == pytest.approx(1.0, abs=1e-3)
    assert edges(seen) == [63.5, 31.5, 95.5, 63.5]


def test_twice_the_size_gives_twice_the_box(free: Path) -> None:
    (seen,) = detector(free).detect(red_square(128, 64, 64, 320, 256))
    assert edges(seen) == [127.5, 63.5, 191.5, 127.5]


def test_best_first(free: Path) -> None:
    picture = red_square(0, 0)
    picture[64:96, 96:128, 2] = 200
    picture[96:128, 32:64, 2] = 230
    assert [round(seen.score * 255) for seen in detector(free).detect(picture)] == [255, 230, 200]


def test_a_region_at_the_pictures_own_scale(free: Path) -> None:
    """In a picture too large for the input a region is seen unscaled, and its boxes come in the whole picture."""
    picture = red_square(500, 300, 32, 1000, 700)
    look = detector(free)
    (seen,) = look.detect_region(picture, Region(468, 268, 564, 364))
    assert edges(seen) == [499.5, 299.5, 531.5, 331.5]
    assert look.detect_region(picture, Region(0, 0, 200, 200)) == ()


def test_a_region_grows_to_whole_strides_within_the_picture(free: Path) -> None:
    look = detector(free)
    # 40 x 40 at the corner grows to 64 x 64, and cannot leave the picture
    (seen,) = look.detect_region(red_square(128, 96), Region(120, 88, 160, 128))
    assert edges(seen) == [127.5, 95.5, 159.5, 127.5]


def test_a_region_beyond_the_picture_is_clipped_and_an_empty_one_shows_nothing(free: Path) -> None:
    look = detector(free)
    (seen,) = look.detect_region(red_square(0, 0), Region(-50, -50, 40, 40))
    assert edges(seen) == [-0.5, -0.5, 31.5, 31.5]
    assert look.detect_region(red_square(0, 0), Region(200, 0, 300, 40)) == ()


def test_a_large_region_is_scaled_to_the_input(free: Path) -> None:
    (seen,) = detector(free).detect_region(red_square(128, 64, 64, 640, 512), Region(0, 0, 320, 256))
    assert edges(seen) == [127.5, 63.5, 191.5, 127.5]


def test_a_network_of_fixed_size_sees_a_region_scaled(fixed: Path) -> None:
    """80 x 64 pixels become 160 x 128: a square of 16 fills a cell of 32."""
    (seen,) = detector(fixed).detect_region(red_square(48, 32, 16), Region(32, 16, 112, 80))
    assert edges(seen) == [47.5, 31.5, 63.5, 47.5]


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 500), (500, 1), (3, 2)])
def test_tiny_pictures_are_no_trouble(free: Path, fixed: Path, width: int, height: int) -> None:
    picture = np.full((height, width, 3), (0, 0, 255), np.uint8)
    for path in (free, fixed):
        for seen in (*detector(path).detect(picture), *detector(path).detect_region(picture, Region(0, 0, 1, 1))):
            assert -0.5 <= seen.x_min_px < seen.x_max_px <= width - 0.5
            assert -0.5 <= seen.y_min_px < seen.y_max_px <= height - 0.5


@pytest.mark.parametrize("picture", [np.zeros((0, 5, 3), np.uint8), np.zeros((5, 5), np.uint8), np.zeros((5, 5, 3))])
def test_what_is_no_picture_is_refused(free: Path, picture: Any) -> None:
    with pytest.raises(InputError, match="no BGR picture"):
        detector(free).detect(picture)


def test_imgsz_of_a_free_network(free: Path) -> None:
    look = detector(free, imgsz=(320, 256))
    assert look.imgsz == (320, 256)
    (seen,) = look.detect(red_square(32, 32, 16))
    assert edges(seen) == [31.5, 31.5, 47.5, 47.5]
    with pytest.raises(UsageError, match="100x100 is no multiple of its stride 32; give 128 x 128"):
        detector(free, imgsz=(100, 100))


def test_imgsz_of_a_fixed_network(fixed: Path) -> None:
    assert detector(fixed, imgsz=(160, 128)).imgsz == (160, 128)
    with pytest.raises(UsageError, match=r"always 160x128 pixels; leave --imgsz out"):
        detector(fixed, imgsz=(320, 256))


def test_a_free_network_without_a_size_needs_one(tmp_path: Path) -> None:
    path = saved(tmp_path / "m.onnx", red_cells(), NAMES)
    with pytest.raises(UsageError, match="--imgsz"):
        detector(path)
    assert detector(path, imgsz=(160, 128)).imgsz == (160, 128)


def test_classes_without_names_are_numbers(tmp_path: Path) -> None:
    look = detector(saved(tmp_path / "m.onnx", red_cells((160, 128))))
    assert look.names is None
    assert look.detect(red_square(32, 32))[0].label == "0"


@pytest.mark.parametrize("name", BOUNDS)
def test_settings_have_bounds(name: str) -> None:
    low, high = BOUNDS[name]
    for value in (low - 1, high + 1):
        with pytest.raises(UsageError, match=name):
            DetectorConfig(**{name: (value, value) if name == "imgsz" else value})  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="conf"):
        DetectorConfig(conf=float("nan"))


def test_the_missing_shipped_model_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("landtool.detect.detector.SHIPPED_MODEL", "not-there.onnx")
    with pytest.raises(UsageError, match=r"not-there\.onnx: the network of the package is missing; give one with"):
        Detector()


def refused(path: Path, **config: Any) -> LandtoolError:
    with pytest.raises(LandtoolError) as caught:
        detector(path, **config)
    assert caught.value.file == str(path)
    assert "\n" not in str(caught.value)
    return caught.value


def test_an_unknown_layout_is_refused(free: Path) -> None:
    assert "unknown layout 'ssd'" in refused(free, layout="ssd").reason


def test_inputs_that_are_no_picture_are_refused(tmp_path: Path) -> None:
    node = helper.make_node("Identity", ["images"], ["output0"])
    for shape, dtype in (
        ([1, 1, 64, 64], 1),
        ([1, 64, 64, 3], 1),
        ([8, 3, 64, 64], 1),
        ([1, 3], 1),
        ([1, 3, 64, 64], 7),
    ):
        model = model_of([node], ["output0"], {}, size=None)
        model.graph.input[0].CopyFrom(helper.make_tensor_value_info("images", dtype, shape))
        assert "picture" in refused(saved(tmp_path / "m.onnx", model)).reason


def test_a_graph_onnx_runtime_refuses(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    unknown = model_of([helper.make_node("NoSuchNode", ["images"], ["output0"])], ["output0"], {}, size=(64, 64))
    reason = refused(saved(tmp_path / "m.onnx", unknown)).reason
    assert "ONNX Runtime refuses it" in reason
    assert "NoSuchNode" in reason
    assert "onnxruntime" not in reason
    assert capfd.readouterr() == ("", "")


def test_a_network_that_fails_at_this_size(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    nodes = [helper.make_node("Reshape", ["images", "shape"], ["output0"])]
    model = model_of(nodes, ["output0"], {"shape": np.array([1, 5, 1000])}, size=None)
    reason = refused(saved(tmp_path / "m.onnx", model, SIZE)).reason
    assert "cannot run at 160x128" in reason
    assert capfd.readouterr() == ("", "")


def test_a_network_that_breaks_later_is_refused_then(tmp_path: Path) -> None:
    """1 / mean is infinite for a black picture only."""
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Div", ["zero", "mean"], ["output0"]),
    ]
    model = model_of(nodes, ["output0"], {"zero": np.zeros((1, 5, 100), np.float32)}, size=(64, 64))
    look = detector(saved(tmp_path / "m.onnx", model))
    with pytest.raises(InputError, match=r"m\.onnx: the network's output is not finite"):
        look.detect(np.zeros((64, 64, 3), np.uint8))
