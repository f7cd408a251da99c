from __future__ import annotations

import numpy as np
import pytest

from landtool.detect.layouts import LAYOUTS, choose_layout, named_layout, read_boxes
from landtool.detect.metadata import ModelMetadata
from landtool.detect.session import Outputs
from landtool.errors import InputError, UsageError


def gave(
    *shapes: tuple[int, ...], name: str = "output0", anchors: int = 0, size: tuple[int, int] = (640, 640)
) -> Outputs:
    """Zeros of these shapes; `anchors` a head."""
    arrays = tuple(np.zeros(shape, np.float32) for shape in shapes)
    heads = tuple(((10.0, 10.0),) * anchors for _ in shapes) if anchors else None
    return Outputs(tuple(f"{name}{i or ''}" for i in range(len(shapes))), arrays, *size, heads)


def chosen(outputs: Outputs, wanted: str | None = None, **metadata: object) -> str:
    return choose_layout(outputs, ModelMetadata(**metadata), wanted).name  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("outputs", "layout"),
    [
        (gave((1, 84, 8400)), "yolov8"),
        (gave((1, 5, 6300), size=(640, 480)), "yolov8"),
        (gave((1, 6, 8400)), "yolov8"),
        (gave((1, 300, 6)), "end2end"),
        (gave((1, 100, 6)), "end2end"),
        (gave((1, 25200, 6)), "yolov5"),
        (gave((1, 25200, 85)), "yolov5"),
        (gave((1, 2535, 85), size=(416, 416)), "yolov5"),
        (gave((1, 8400, 85), name="output"), "yolox"),
        (gave((1, 8400, 80), (1, 8400, 1, 4)), "darknet"),
        (gave((1, 2535, 1, 4), (1, 2535, 80), size=(416, 416)), "darknet"),
    ],
)
def test_shapes_tell_the_layout(outputs: Outputs, layout: str) -> None:
    assert chosen(outputs) == layout


@pytest.mark.parametrize(
    "outputs",
    [gave((1, 8400, 85)), gave((1, 255, 20, 20), (1, 255, 40, 40)), gave((1, 3, 20, 20, 85), (1, 3, 40, 40, 85))],
)
def test_a_doubt_asks_for_the_layout(outputs: Outputs) -> None:
    with pytest.raises(UsageError, match=r"could be .* or .*--layout"):
        chosen(outputs)


def test_an_unknown_output_names_the_known_layouts() -> None:
    for outputs in (gave((1, 1000)), gave((1, 32, 160, 160), (1, 84, 8400)), gave((1, 20, 20))):
        with pytest.raises(InputError, match=r"no known layout fits its output .*--layout"):
            chosen(outputs)


def test_the_user_wins_over_metadata_and_shapes() -> None:
    assert chosen(gave((1, 8400, 85)), wanted="yolov5") == "yolov5"
    assert chosen(gave((1, 300, 6)), wanted="yolov5", layout="end2end") == "yolov5"
    assert chosen(gave((1, 300, 6)), layout="yolov5") == "yolov5"


def test_unknown_names_of_layouts_are_refused() -> None:
    with pytest.raises(UsageError, match="unknown layout 'v9'; known: yolov8"):
        named_layout("v9")
    with pytest.raises(InputError, match="unknown layout 'v9'"):
        chosen(gave((1, 84, 8400)), layout="v9")


def test_a_layout_that_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="is not of the layout darknet"):
        chosen(gave((1, 84, 8400)), wanted="darknet")


def test_names_must_match_the_classes() -> None:
    assert chosen(gave((1, 84, 8400)), names=("a",) * 80) == "yolov8"
    with pytest.raises(InputError, match="names 3 classes, but its output has 80"):
        chosen(gave((1, 84, 8400)), names=("a", "b", "c"))
    with pytest.raises(InputError, match="names 1 class, but its output has 2"):
        chosen(gave((1, 6, 8400)), names=("pad",))
    with pytest.raises(InputError, match="names 1 class, but its output has 80"):
        chosen(gave((1, 84, 8400)), wanted="yolov8", names=("pad",))


def test_raw_heads_need_their_anchors() -> None:
    outputs = gave((1, 18, 20, 20), (1, 18, 40, 40))
    with pytest.raises(InputError, match=r"no anchors; .*landtool\.anchors"):
        read_boxes(LAYOUTS["heads-v3"], outputs)
    short = Outputs(outputs.names, outputs.arrays, 640, 640, (((1.0, 1.0),) * 3,))
    with pytest.raises(InputError, match="anchors for 1 outputs, not 2"):
        read_boxes(LAYOUTS["heads-v3"], short)


def test_heads_may_have_other_than_three_anchors() -> None:
    boxes, scores = read_boxes(LAYOUTS["heads-v5"], gave((1, 30, 20, 20), (1, 30, 40, 40), anchors=5))
    assert boxes.shape == (5 * (400 + 1600), 4)
    assert scores.shape == (10_000, 1)


def test_numbers_that_are_no_scores_are_refused() -> None:
    outputs = gave((1, 84, 8400))
    outputs.arrays[0][0, 10, 5] = 37.0
    with pytest.raises(InputError, match=r"between 0 and 37, not 0 and 1; .*--layout"):
        read_boxes(LAYOUTS["yolov8"], outputs)


def test_picks_of_boxes_that_are_not_there_are_refused() -> None:
    arrays = (np.zeros((1, 7, 4), np.float32), np.zeros((1, 2, 7), np.float32), np.array([[0, 0, 7]], np.int32))
    with pytest.raises(InputError, match="picks boxes it does not give"):
        read_boxes(LAYOUTS["zoo-tiny-yolov3"], Outputs(("a", "b", "c"), arrays, 64, 64))


def test_a_huge_exponent_is_no_overflow() -> None:
    outputs = gave((1, 84, 7), name="output", size=(64, 64))
    outputs = Outputs(("output",), (np.full((1, 84, 6), 500.0, np.float32),), 64, 64)
    outputs.arrays[0][..., 4:] = 0.5
    with np.errstate(all="raise"):
        boxes, _ = read_boxes(LAYOUTS["yolox"], outputs)
    assert np.isfinite(boxes).all()
