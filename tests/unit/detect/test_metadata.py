from __future__ import annotations

import pytest

from landtool.detect.metadata import ModelMetadata, parse_metadata
from landtool.errors import InputError


def test_nothing_said_is_nothing_known() -> None:
    assert parse_metadata({}) == ModelMetadata()


def test_what_ultralytics_writes_is_read() -> None:
    metadata = parse_metadata(
        {
            "description": "Ultralytics YOLO11n model",
            "stride": "32",
            "task": "detect",
            "batch": "1",
            "imgsz": "[480, 640]",
            "names": "{0: 'person', 1: 'pad'}",
            "channels": "3",
            "end2end": "False",
            "args": "{'dynamic': False, 'nms': True}",
        }
    )
    assert metadata.names == ("person", "pad")
    assert metadata.imgsz == (640, 480)
    assert metadata.stride == 32
    assert metadata.end2end


def test_what_landtool_writes_is_read() -> None:
    metadata = parse_metadata(
        {
            "landtool.preprocess": "stretch",
            "landtool.layout": "yolov8",
            "landtool.cfg_sha256": "ab",
            "landtool.anchors": "[[(81, 82), (135, 169)], [(10, 14)]]",
            "names": "['pad']",
        }
    )
    assert metadata.preprocess == "stretch"
    assert metadata.layout == "yolov8"
    assert metadata.anchors == (((81.0, 82.0), (135.0, 169.0)), ((10.0, 14.0),))
    assert metadata.names == ("pad",)


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("names", "__import__('os').system('true')"), ("names", "{0: 'a', 2: 'b'}"), ("names", "{0: 1}"),
        ("names", "[]"), ("names", "{'a': 0}"), ("names", "[" * 5000), ("names", "{0: 'pad'"),
        ("imgsz", "[640]"), ("imgsz", "[0, 640]"), ("imgsz", "640.5"), ("imgsz", "['a', 'b']"), ("imgsz", "[True, 8]"),
        ("stride", "0"), ("stride", "32.5"), ("stride", "nan"), ("end2end", "perhaps"), ("args", "[1]"),
        ("landtool.preprocess", "crop"), ("landtool.anchors", "[[(1, 2, 3)]]"), ("landtool.anchors", "[[(0, 1)]]"),
        ("landtool.anchors", "[1, 2]"), ("landtool.test_output", "[]"),
    ],
)  # fmt: skip
def test_a_value_that_cannot_be_is_refused(key: str, text: str) -> None:
    with pytest.raises(InputError, match=f"metadata '{key}' cannot be used") as caught:
        parse_metadata({key: text})
    assert len(str(caught.value)) < 200


def test_another_task_is_refused() -> None:
    with pytest.raises(InputError, match="'segment'"):
        parse_metadata({"task": "segment"})
