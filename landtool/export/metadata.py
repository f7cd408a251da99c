"""What an exported model says about itself: entries other YOLO tools read, as Python literals, and landtool's own."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from datetime import date

import onnx
from onnx import helper

from landtool import __version__
from landtool.darknet.network import Network
from landtool.detect.model_file import parse_model
from landtool.detect.session import Session
from landtool.detect.vector import test_vector

LAYOUT = "yolov8"  # landtool.detect's name of [1, 4 + classes, N]


def model_entries(network: Network, names: Sequence[str], created: date, *, dynamic: bool = True) -> dict[str, str]:
    """Return all entries but the test vector. names: of the classes, by their ids."""
    anchors = [[list(pair) for pair in head.anchors] for _, head in network.heads]
    return {
        "description": f"Tiny-YOLOv3 for {', '.join(names[:5])}{' ...' if len(names) > 5 else ''}",
        "author": "landtool",
        "date": created.isoformat(),
        "version": __version__,
        "license": "Apache-2.0",
        "docs": "docs/formats.md",
        "stride": repr(network.stride),
        "task": "detect",
        "batch": "1",
        "imgsz": repr([network.height, network.width]),
        "names": repr(dict(enumerate(names))),
        "channels": "3",
        "end2end": "False",
        "args": repr({"dynamic": dynamic, "nms": False}),
        "landtool.layout": LAYOUT,
        "landtool.preprocess": "letterbox" if network.letterbox else "stretch",
        "landtool.anchors": repr(anchors),
        "landtool.cfg_sha256": hashlib.sha256(network.text.encode()).hexdigest(),
    }


def described(model: onnx.ModelProto, entries: dict[str, str]) -> onnx.ModelProto:
    """Return the model with these entries, and with the test vector that is replayed whenever it is loaded.

    Raises InputError for a network that gives much the same whatever it is fed with.
    """
    told = _with(model, entries)
    vector = test_vector(Session(parse_model(told.SerializeToString())))
    return _with(model, {**entries, **vector})


def _with(model: onnx.ModelProto, entries: dict[str, str]) -> onnx.ModelProto:
    copy = onnx.ModelProto()
    copy.CopyFrom(model)
    helper.set_model_props(copy, entries)
    return copy
