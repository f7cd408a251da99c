from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landtool.detect.preprocess import InputSpec, Preprocessor, place
from landtool.types import Image

LETTERBOX, STRETCH = InputSpec(), InputSpec(preprocess="stretch")
CORNER = InputSpec(at="corner", order="bgr", full_range=True)
FLOAT = np.dtype(np.float32)


def picture(width: int, height: int) -> Image:
    return np.random.default_rng(3).integers(0, 256, (height, width, 3), np.uint8)


def test_a_picture_that_fits_is_scaled_to_one_and_turned_to_rgb() -> None:
    image = picture(64, 32)
    tensor, _ = Preprocessor(LETTERBOX, FLOAT).prepare(image, (64, 32))
    expected = image[:, :, ::-1].transpose(2, 0, 1)[None] / 255.0
    assert tensor.dtype == np.float32
    assert tensor.shape == (1, 3, 32, 64)
    assert tensor.flags.c_contiguous
    np.testing.assert_allclose(tensor, expected, atol=1e-7)


def test_yolox_gets_bgr_from_0_to_255_at_the_corner() -> None:
    image = picture(40, 32)
    tensor, placement = Preprocessor(CORNER, FLOAT).prepare(image, (64, 32))
    np.testing.assert_array_equal(tensor[0, :, :, :40], image.transpose(2, 0, 1))
    assert (tensor[0, :, :, 40:] == 114).all()
    assert (placement.left, placement.right) == (0, 40)


@pytest.mark.parametrize(("dtype", "unit"), [(np.uint8, 1.0), (np.float16, 255.0), (np.float32, 255.0)])
def test_the_model_says_the_type(dtype: type[np.generic], unit: float) -> None:
    image = picture(64, 16)
    tensor, _ = Preprocessor(LETTERBOX, np.dtype(dtype)).prepare(image, (64, 32))
    assert tensor.dtype == dtype
    np.testing.assert_allclose(tensor[0, 0, 8:24].astype(float), image[..., 2] / unit, atol=1e-3)
    np.testing.assert_allclose(tensor[0, :, :8].astype(float), 114 / unit, atol=1e-3)


def test_padding_is_filled_again_when_the_shape_of_the_pictures_changes() -> None:
    preprocessor = Preprocessor(LETTERBOX, FLOAT)
    preprocessor.prepare(picture(64, 32), (64, 32))
    tensor, _ = preprocessor.prepare(picture(16, 32), (64, 32))
    np.testing.assert_allclose(tensor[0, :, :, :24], 114 / 255, atol=1e-6)
    np.testing.assert_allclose(tensor[0, :, :, 40:], 114 / 255, atol=1e-6)


def test_inputs_of_other_sizes_share_their_memory_and_nothing_else() -> None:
    preprocessor = Preprocessor(LETTERBOX, FLOAT)
    cases = [(picture(64, 16), (64, 32)), (picture(32, 32), (32, 32)), (picture(16, 64), (64, 64))]
    for image, size in (*cases, *reversed(cases), *cases):
        tensor, _ = preprocessor.prepare(image, size)
        np.testing.assert_array_equal(tensor, Preprocessor(LETTERBOX, FLOAT).prepare(image, size)[0])


def test_an_odd_rest_is_smaller_above() -> None:
    placement = place(LETTERBOX, (64, 64), 64, 33)
    assert (placement.top, placement.bottom) == (15, 48)


def test_mirrored_views_are_taken() -> None:
    image = picture(64, 32)
    tensor, _ = Preprocessor(LETTERBOX, FLOAT).prepare(image[::-1, ::-1], (64, 32))
    np.testing.assert_allclose(tensor[0, 0], image[::-1, ::-1, 2] / 255.0, atol=1e-7)


@pytest.mark.parametrize("spec", [LETTERBOX, STRETCH, CORNER])
@pytest.mark.parametrize(("width", "height"), [(640, 480), (1280, 960), (99, 203), (317, 50)])
def test_an_edge_in_the_picture_comes_back_to_where_it_was(spec: InputSpec, width: int, height: int) -> None:
    """The edge of a half-white picture, found in the input by its mean, maps back to the same pixel edge."""
    image = np.zeros((height, width, 3), np.uint8)
    column, row = width // 3, height // 4
    image[row:, column:] = 255
    tensor, placement = Preprocessor(spec, FLOAT).prepare(image, (160, 128))
    white = tensor[0, 0] / tensor.max()
    inside = white[placement.top : placement.bottom, placement.left : placement.right]
    x = placement.right - inside[-1].sum()
    y = placement.bottom - inside[:, -1].sum()
    box = placement.to_picture(np.array([[x, y, placement.right, placement.bottom]], dtype=np.float64))[0]
    # a bilinear ramp that is sampled leaves some hundredths of a pixel; half a pixel lost in the scale leaves tenths
    # an edge between the pixels column - 1 and column lies at column - 0.5 in OpenCV's pixels
    assert box[0] == pytest.approx(column - 0.5, abs=0.02 * width / 160 + 0.05)
    assert box[1] == pytest.approx(row - 0.5, abs=0.02 * height / 128 + 0.05)
    assert box[2:].tolist() == pytest.approx([width - 0.5, height - 0.5])


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 3000), st.integers(1, 3000), st.sampled_from([LETTERBOX, STRETCH, CORNER]))
def test_the_whole_input_maps_to_the_whole_picture(width: int, height: int, spec: InputSpec) -> None:
    placement = place(spec, (640, 480), width, height)
    assert 0 <= placement.left < placement.right <= 640
    assert 0 <= placement.top < placement.bottom <= 480
    box = placement.to_picture(np.array([[-10.0, -10.0, 650.0, 490.0]]))[0]
    assert box.tolist() == [-0.5, -0.5, width - 0.5, height - 0.5]
