"""One body for every layout of networks: the same boxes, whatever way a network writes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from landtool.detect.detector import Detector, DetectorConfig
from landtool.detect.layouts import LAYOUTS
from landtool.errors import InputError
from landtool.types import Image
from tests.unit.detect.networks import fixed_answer, saved

WIDTH, HEIGHT = 96, 64
CLASSES = 2
# Edges in input pixels, class, score, best first; no centre lies on the border of a cell.
SEEN = (((8.0, 8.0, 26.0, 42.0), 0, 0.9), ((60.0, 22.0, 91.0, 45.0), 1, 0.6))
# The same as the first of SEEN, a little aside and less sure: it must go.
DOUBLE = ((10.0, 9.0, 28.0, 42.0), 0, 0.5)
Answers = dict[str, NDArray[Any]]
Row = tuple[tuple[float, float, float, float], int, float]


@dataclass(frozen=True)
class Case:
    """A network that sees SEEN: what it gives, and the part of it that falls to nothing when there is no red."""

    answers: Callable[[], tuple[Answers, Answers]]
    network: dict[str, Any] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    layout: str | None = None


def _centre(box: tuple[float, float, float, float]) -> list[float]:
    return [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, box[2] - box[0], box[3] - box[1]]


def _cells(*strides: int) -> int:
    return sum((WIDTH // s) * (HEIGHT // s) for s in strides)


def _yolov8() -> tuple[Answers, Answers]:
    array = np.zeros((1, 4 + CLASSES, _cells(8, 16, 32)), np.float32)
    for index, (box, kind, score) in enumerate((*SEEN, DOUBLE)):
        array[0, :4, 7 * index] = _centre(box)
        array[0, 4 + kind, 7 * index] = score
    scores = array.copy()
    scores[:, :4] = 0
    return {"output0": array}, {"output0": scores}


def _end2end() -> tuple[Answers, Answers]:
    array = np.zeros((1, 300, 6), np.float32)
    for index, (box, kind, score) in enumerate(SEEN):
        array[0, index] = [*box, score, kind]
    scores = np.zeros_like(array)
    scores[..., 4] = array[..., 4]
    return {"output0": array}, {"output0": scores}


def _yolov5() -> tuple[Answers, Answers]:
    array = np.zeros((1, 3 * _cells(8, 16, 32), 5 + CLASSES), np.float32)
    for index, (box, kind, score) in enumerate((*SEEN, DOUBLE)):
        array[0, 11 * index, :5] = [*_centre(box), 0.95]
        array[0, 11 * index, 5 + kind] = score / 0.95
    scores = np.zeros_like(array)
    scores[..., 4] = array[..., 4]
    return {"output0": array}, {"output0": scores}


def _yolox() -> tuple[Answers, Answers]:
    levels = {s: np.zeros((HEIGHT // s, WIDTH // s, 5 + CLASSES), np.float32) for s in (8, 16, 32)}
    for (box, kind, score), stride in zip((*SEEN, DOUBLE), (8, 16, 16), strict=True):
        x, y, w, h = (side / stride for side in _centre(box))
        cell = levels[stride][int(y), int(x)]
        cell[:5] = [x - int(x), y - int(y), np.log(w), np.log(h), 0.95]
        cell[5 + kind] = score / 0.95
    array = np.concatenate([level.reshape(-1, 5 + CLASSES) for level in levels.values()])[None]
    scores = np.zeros_like(array)
    scores[..., 4] = array[..., 4]
    return {"output": array}, {"output": scores}


def _darknet() -> tuple[Answers, Answers]:
    count = 3 * _cells(16, 32)
    confs, boxes = np.zeros((1, count, CLASSES), np.float32), np.zeros((1, count, 1, 4), np.float32)
    for index, (box, kind, score) in enumerate((*SEEN, DOUBLE)):
        boxes[0, 5 * index, 0] = np.array(box) / [WIDTH, HEIGHT, WIDTH, HEIGHT]
        confs[0, 5 * index, kind] = score
    return {"confs": confs, "boxes": boxes}, {"confs": confs}


ANCHORS = {32: [(40.0, 50.0), (60.0, 60.0), (90.0, 60.0)], 16: [(16.0, 30.0), (20.0, 20.0), (30.0, 30.0)]}


def _logit(p: float) -> float:
    return float(np.log(p / (1 - p)))


def _heads(version: str, five: bool) -> tuple[Answers, Answers]:
    answers, scores = {}, {}
    heads = {s: np.full((3, HEIGHT // s, WIDTH // s, 5 + CLASSES), -20.0, np.float32) for s in ANCHORS}
    for (box, kind, score), anchor in zip((*SEEN, DOUBLE), (0, 2, 1), strict=True):
        x, y, w, h = _centre(box)
        row, column = int(y / 16), int(x / 16)
        inside, ratio = (x / 16 - column, y / 16 - row), (w / ANCHORS[16][anchor][0], h / ANCHORS[16][anchor][1])
        cell = heads[16][anchor, row, column]
        if version == "v3":
            cell[:4] = [*map(_logit, inside), *np.log(ratio)]
        else:
            cell[:4] = [*(_logit((t + 0.5) / 2) for t in inside), *(_logit(np.sqrt(r) / 2) for r in ratio)]
        cell[4], cell[5 + kind] = _logit(0.95), _logit(score / 0.95)
    for stride, head in heads.items():
        by = np.zeros_like(head)
        by[..., 4] = 40.0
        shape = [1, 3, *head.shape[1:]] if five else [1, 3 * (5 + CLASSES), *head.shape[1:3]]
        for place, array in ((answers, head), (scores, by)):
            place[f"head{stride}"] = (array if five else array.transpose(0, 3, 1, 2)).reshape(shape)
    return answers, scores


def _zoo() -> tuple[Answers, Answers]:
    count = 3 * _cells(16, 32)
    boxes, scores = np.zeros((1, count, 4), np.float32), np.zeros((1, CLASSES, count), np.float32)
    picks = []
    for index, (box, kind, score) in enumerate((*SEEN, DOUBLE)):
        boxes[0, 9 * index] = [box[1], box[0], box[3], box[2]]
        scores[0, kind, 9 * index] = score
        picks.append([0, kind, 9 * index])
    answers = {"yolonms": boxes, "yolonms:1": scores, "yolonms:2": np.array([picks[:2]], np.int32)}
    return answers, {"yolonms:1": scores}


ANCHOR_METADATA = {"landtool.anchors": repr(list(ANCHORS.values()))}
CASES = {
    "yolov8": Case(_yolov8),
    "end2end": Case(_end2end, metadata={"end2end": "True"}),
    "end2end-by-shape": Case(_end2end),
    "nms-inside": Case(_end2end, metadata={"args": "{'dynamic': False, 'nms': True}"}),
    "yolov5": Case(_yolov5),
    "yolox": Case(_yolox, network={"red": 2, "full": 255.0}),
    "darknet": Case(_darknet),
    "heads-v3": Case(lambda: _heads("v3", five=False), metadata=ANCHOR_METADATA, layout="heads-v3"),
    "heads-v3-in-metadata": Case(
        lambda: _heads("v3", five=True), metadata={**ANCHOR_METADATA, "landtool.layout": "heads-v3"}
    ),
    "heads-v5": Case(lambda: _heads("v5", five=True), metadata=ANCHOR_METADATA, layout="heads-v5"),
    "zoo-tiny-yolov3": Case(_zoo, network={"with_shape": True}),
}
NAMES = {"names": "{0: 'pad', 1: 'sign'}"}


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


def _detector(case: Case, folder: Path, **config: Any) -> Detector:
    answers, scores = case.answers()
    network = fixed_answer(answers, scores, size=(WIDTH, HEIGHT), **case.network)
    model = saved(folder / "model.onnx", network, {**NAMES, **case.metadata})
    return Detector(DetectorConfig(model=model, layout=case.layout, **config))


def _red(width: int = WIDTH, height: int = HEIGHT) -> Image:
    picture = np.zeros((height, width, 3), np.uint8)
    picture[..., 2] = 255
    return picture


def test_every_layout_has_a_case() -> None:
    assert {name for name in LAYOUTS if any(case.startswith(name) for case in CASES)} == set(LAYOUTS)


def test_the_same_boxes_from_every_layout(case: Case, tmp_path: Path) -> None:
    found = _detector(case, tmp_path).detect(_red())
    assert [seen.label for seen in found] == ["pad", "sign"]
    for seen, (box, _, score) in zip(found, SEEN, strict=True):
        assert seen.score == pytest.approx(score, abs=1e-5)
        edges = [seen.x_min_px, seen.y_min_px, seen.x_max_px, seen.y_max_px]
        assert edges == pytest.approx([edge - 0.5 for edge in box], abs=1e-4)


def test_red_is_fed_as_red_and_in_its_range(case: Case, tmp_path: Path) -> None:
    blue = np.ascontiguousarray(_red()[..., ::-1])
    assert _detector(case, tmp_path).detect(blue) == ()


def test_conf_is_the_least_score(case: Case, tmp_path: Path) -> None:
    assert [seen.label for seen in _detector(case, tmp_path, conf=0.7).detect(_red())] == ["pad"]
    assert _detector(case, tmp_path, conf=0.95).detect(_red()) == ()


def test_max_boxes_keeps_the_best(case: Case, tmp_path: Path) -> None:
    assert [seen.label for seen in _detector(case, tmp_path, max_boxes=1).detect(_red())] == ["pad"]


def test_boxes_come_back_to_a_larger_picture(case: Case, tmp_path: Path) -> None:
    found = _detector(case, tmp_path).detect(_red(3 * WIDTH, 3 * HEIGHT))
    expected = [3 * edge - 0.5 for edge in SEEN[0][0]]
    seen = found[0]
    assert [seen.x_min_px, seen.y_min_px, seen.x_max_px, seen.y_max_px] == pytest.approx(expected, abs=1e-3)


def test_names_that_do_not_match_are_refused(case: Case, tmp_path: Path) -> None:
    more = {"names": "{0: 'pad'}"}
    with pytest.raises(InputError, match=r"names 1"):
        _detector(Case(case.answers, case.network, {**case.metadata, **more}, case.layout), tmp_path).detect(_red())


def test_not_a_number_is_refused(case: Case, tmp_path: Path) -> None:
    def broken() -> tuple[Answers, Answers]:
        answers, scores = case.answers()
        return {n: a if a.dtype == np.int32 else np.full_like(a, np.nan) for n, a in answers.items()}, scores

    with pytest.raises(InputError, match="not finite"):
        _detector(Case(broken, case.network, case.metadata, case.layout), tmp_path).detect(_red())


def test_pictures_of_any_shape_are_looked_at(case: Case, tmp_path: Path) -> None:
    detector = _detector(case, tmp_path)
    for width, height in ((1, 1), (1, 700), (700, 1), (WIDTH - 1, HEIGHT + 1)):
        for seen in detector.detect(_red(width, height)):
            assert -0.5 <= seen.x_min_px < seen.x_max_px <= width - 0.5
            assert -0.5 <= seen.y_min_px < seen.y_max_px <= height - 0.5
