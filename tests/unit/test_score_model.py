"""tools/score_model.py names the worst pictures and draws boxes where they are."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest

from bench.detect import score_set
from bench.detect_sets import PictureSet
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.strokes import GREEN, VERMILLION
from landtool.types import Detection, Image
from tests.shared import ROOT

SMALL, LARGE = (100.0, 100.0, 120.0, 120.0), (300.0, 200.0, 400.0, 290.0)


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("score_model", ROOT / "tools" / "score_model.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["score_model"] = module
    spec.loader.exec_module(module)
    return module


def pictures() -> PictureSet:
    truth = [
        LabelledImage(Path("small.png"), 640, 480, (LabelledBox(0, *SMALL),)),
        LabelledImage(Path("large.png"), 640, 480, (LabelledBox(0, *LARGE),)),
        LabelledImage(Path("empty.png"), 640, 480, ()),
        LabelledImage(Path("found.png"), 640, 480, (LabelledBox(0, *SMALL), LabelledBox(0, *LARGE))),
    ]
    return PictureSet("four, made", truth, lambda i: np.full((480, 640, 3), i, np.uint8))


FOUND: list[tuple[Detection, ...]] = [
    (Detection("pad", 0.24, *SMALL),),
    (Detection("pad", 0.35, 0.0, 0.0, 20.0, 20.0),),
    (Detection("pad", 0.9, *LARGE), Detection("pad", 0.29, *SMALL)),
    (Detection("pad", 0.9, *SMALL), Detection("pad", 0.8, 300.0, 200.0, 400.0, 280.0)),
]


def find(image: Image) -> Sequence[Detection]:
    return FOUND[int(image[0, 0, 0])]


def test_the_worst_pictures_are_named_and_drawn(
    tool: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scored = score_set(find, pictures())
    tool.write_sheets([scored], tmp_path, 5)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "four-made-alarms.png",
        "four-made-missed.png",
        "four-made-poor.png",
    ]
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert lines == [
        "large.png: missed, 100 px, score 0.000, nearest box IoU 0.00",
        "small.png: missed, 20 px, score 0.240, nearest box IoU 1.00",
        "empty.png: false alarm 0.90, no target there",
        "large.png: false alarm 0.35, IoU 0.00",
        "found.png: IoU 0.889, score 0.80, off by +0.0, +0.0, +0.0, -10.0 px",
        "found.png: IoU 1.000, score 0.90, off by +0.0, +0.0, +0.0, +0.0 px",
    ]


def test_a_sheet_shows_no_more_than_asked_for(tool: ModuleType, tmp_path: Path) -> None:
    tool.write_sheets([score_set(find, pictures())], tmp_path, 1)
    sheet = cv2.imread(str(tmp_path / "four-made-missed.png"))
    assert sheet is not None
    assert sheet.shape[0] == tool.WHOLE[1]


def test_boxes_are_drawn_where_they_are(tool: ModuleType, tmp_path: Path) -> None:
    tool.write_sheets([score_set(find, pictures())], tmp_path, 1)
    sheet = cv2.imread(str(tmp_path / "four-made-poor.png"))
    assert sheet is not None
    # on the left the picture at 3/4; on the right its part of 3 x 100 px about the target's centre (350, 245), at 6/5
    left, right = sheet[:360, :480], sheet[:360, 480:840]
    assert np.abs(left[155:205, 225].astype(int) - VERMILLION).sum(axis=1).max() < 100
    # truth ends at y = 290, what was found at 280: (290 - 95) 6/5 and (280 - 95) 6/5
    rows = right[:, 180].astype(int)
    assert np.abs(rows[232:236] - GREEN).sum(axis=1).min() < 110
    assert np.abs(rows[220:224] - VERMILLION).sum(axis=1).min() < 110


def test_a_sheet_of_an_earlier_network_goes(tool: ModuleType, tmp_path: Path) -> None:
    tool.write_sheets([score_set(find, pictures())], tmp_path, 5)
    truth = pictures()
    perfect = {i: [Detection("pad", 1.0, *_edges(box)) for box in truth.truth[i].boxes] for i in range(4)}
    tool.write_sheets([score_set(lambda image: perfect[int(image[0, 0, 0])], truth)], tmp_path, 5)
    assert [path.name for path in tmp_path.iterdir()] == ["four-made-poor.png"]


def test_sheets_need_a_folder(tool: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["score_model.py", "model.onnx", "--worst", "3"])
    with pytest.raises(SystemExit) as stop:
        tool.main()
    assert stop.value.code == 2


def test_a_model_that_is_not_there_is_one_line(
    tool: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["score_model.py", str(tmp_path / "no.onnx")])
    monkeypatch.setattr(tool, "sets_of", lambda *_: [pictures()])
    with pytest.raises(SystemExit) as stop:
        tool.main()
    assert stop.value.code == 2
    assert capsys.readouterr().err.startswith("score_model: ")


def _edges(box: LabelledBox) -> tuple[float, float, float, float]:
    return box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px
