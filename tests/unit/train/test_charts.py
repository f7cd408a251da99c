from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from landtool.io.labels import LabelledBox, LabelledImage
from landtool.strokes import GREEN, VERMILLION
from landtool.train.charts import SHEET_PICTURES, _round_step, draw_curves, validation_sheet
from landtool.train.results import ResultRow
from landtool.types import Detection, Image

ROWS = [
    ResultRow(100, 60.0, 2.0, 1.0, 0.1, 0.001, None, None, None, None),
    ResultRow(200, 150.0, 1.0, 0.5, 0.0, 0.002, 0.5, 0.75, 0.5, 0.25),
]
BOX = (40.0, 30.0, 79.0, 69.0)


def labelled(*boxes: tuple[float, float, float, float]) -> LabelledImage:
    return LabelledImage(Path("a.jpg"), 320, 240, tuple(LabelledBox(0, *box) for box in boxes))


def seen(score: float, box: tuple[float, float, float, float] = BOX) -> Detection:
    return Detection("pad", score, *box)


def grey(level: int) -> Image:
    return np.full((240, 320, 3), level, np.uint8)


def decoded(png: bytes) -> Image:
    assert png.startswith(b"\x89PNG")
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def test_curves_are_a_picture_that_changes_with_the_rows() -> None:
    none, two = (decoded(draw_curves(rows)) for rows in ([], ROWS))
    assert none.shape == two.shape == (900, 1200, 3)
    assert (none != two).any()


def test_minutes_have_round_marks() -> None:
    assert [_round_step(total) for total in (0.5, 7.0, 60.0, 117.0)] == [0.1, 1.0, 10.0, 20.0]


def test_a_sheet_begins_with_the_worst() -> None:
    far = (200.0, 100.0, 250.0, 150.0)
    cases = [  # by grey level, from good to bad
        (labelled(), []),
        (labelled(BOX), [seen(0.9)]),
        (labelled(), [seen(0.3, far)]),
        (labelled(BOX), [seen(0.5, (50.0, 30.0, 89.0, 69.0))]),
        (labelled(BOX), []),
        (labelled(BOX), [seen(0.9, far)]),
    ]
    truth, found = [case[0] for case in cases], [case[1] for case in cases]
    sheet = validation_sheet([grey(40 * i) for i in range(len(cases))], truth, found)
    assert sheet.shape == (4 * 242 - 2, 6 * 322 - 2, 3)
    # a place in the middle below, where nothing is drawn
    assert [int(sheet[230, 322 * column + 160, 0]) for column in range(6)] == [200, 160, 120, 80, 40, 0]


def test_a_sheet_has_room_for_so_many() -> None:
    count = SHEET_PICTURES + 3
    sheet = validation_sheet([grey(99)] * count, [labelled()] * count, [()] * count)
    assert (sheet[240 - 1 :: 242, 319::322, 0] == 99).all()


def test_boxes_are_drawn_around_what_they_hold() -> None:
    big = np.full((480, 640, 3), 128, np.uint8)  # shown at half its size
    sheet = validation_sheet([big], [labelled((80.5, 60.5, 160.5, 140.5))], [[seen(0.8, (300.5, 200.5, 400.5, 300.5))]])
    tile = sheet[:240, :320]
    for color, low, high in ((GREEN, (38, 28), (82, 72)), (VERMILLION, (148, 98), (202, 152))):
        # the label of the score lies above its box
        rows, columns = np.nonzero((np.abs(tile.astype(int) - color).max(axis=2) < 25)[low[1] - 2 :])
        assert abs(columns.min() - low[0]) <= 1
        assert abs(columns.max() - high[0]) <= 1
        assert abs(rows.max() + low[1] - 2 - high[1]) <= 1
    inside = tile[31:69, 41:79]
    assert (inside == 128).all()


def test_weak_boxes_are_not_drawn() -> None:
    sheet = validation_sheet([grey(128)], [labelled()], [[seen(0.05)]])
    assert (sheet[:240, :320] == 128).all()
