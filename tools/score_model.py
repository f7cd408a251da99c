"""Score networks, and show their worst pictures.

`python tools/score_model.py MODEL.onnx... [--data DIR/data.yaml --split val] [--worst N --out DIR]`: prints how good
each is on a split of a YOLO dataset or, without one, on the path-traced pictures and on our own test pictures. With
--worst it writes up to three sheets a set into DIR/MODEL: targets missed, the largest first; false alarms above 0.3,
the surest first; boxes found, the poorest first. Truth is green, what was found is red; on the right of each picture
is the place itself.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # bench is no installed package

from bench.detect import SCORED_CONF, Finder, Scored, on_print, print_scores, score_set
from bench.detect_sets import PictureSet, own_fog_set, own_test_set, path_traced_sets, yolo_set
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import Detector
from landtool.errors import LandtoolError, UsageError
from landtool.evaluate.matching import NOBODY, PictureBoxes, iou, picture_boxes
from landtool.evaluate.set_matching import match_set
from landtool.geometry import Array
from landtool.strokes import DARK, GREEN, VERMILLION, Color, Pen
from landtool.synth.preview.sheet import contact_sheet, fitted
from landtool.types import Image

WHOLE, PLACE = (480, 360), 360  # sizes of the two halves of a cell
COLUMNS = 2
CONF = 0.25  # a target is missed when no box of this score is on it
ALARM_CONF = 0.3
SHOWN_CONF = 0.05  # boxes drawn


@dataclass(frozen=True, eq=False)
class Case:
    """Something wrong in picture `index`, about the box (4,) `place_px`. order: the smallest is the worst."""

    index: int
    place_px: Array
    text: str
    order: float


def main() -> int:
    """Print the tables and write the sheets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, nargs="+")
    parser.add_argument("--data", type=Path, help="data.yaml of a YOLO dataset")
    parser.add_argument("--split", default="val")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--worst", type=int, default=0, help="pictures on a sheet")
    parser.add_argument("--out", type=Path, help="folder of the sheets")
    options = parser.parse_args()
    if options.worst and not options.out:
        parser.error("--worst needs --out DIR")
    try:
        pictures = sets_of(options.data, options.split)
        for model in options.model:
            scores = [score_set(finder(model, options.threads), each) for each in pictures]
            print_scores(model.name, scores)
            if options.worst:
                write_sheets(scores, options.out / model.stem, options.worst)
    except LandtoolError as error:
        parser.exit(error.exit_code, f"score_model: {error}\n")
    return 0


def sets_of(data: Path | None, split: str) -> list[PictureSet]:
    """Return the sets to score on."""
    if data is not None:
        return [yolo_set(data, split)]
    return [*path_traced_sets(), own_test_set(), own_fog_set()]


def finder(model: Path, threads: int | None) -> Finder:
    """Return what `landtool detect` does with a network, down to the least scores."""
    return on_print(Detector(DetectorConfig(model=model, conf=SCORED_CONF, threads=threads)))


def write_sheets(scores: Sequence[Scored], folder: Path, most: int) -> None:
    """Write the sheets of each set and print their names and what is on them."""
    folder.mkdir(parents=True, exist_ok=True)
    for scored in scores:
        boxes = picture_boxes(scored.pictures.truth, scored.found, scored.pictures.names)
        kinds = {"missed": missed(boxes), "alarms": alarms(boxes), "poor": poor(boxes)}
        for kind, cases in kinds.items():
            name = scored.pictures.name.replace(" ", "-").replace(",", "")
            path = folder / f"{name}-{kind}.png"
            path.unlink(missing_ok=True)  # of an earlier model, which may have been worse
            worst = sorted(cases, key=lambda case: case.order)[:most]
            if worst:
                _write(path, [_cell(scored, boxes[case.index], case) for case in worst])
                print(f"\n{path}: {len(worst)} of {len(cases)}")
                for case in worst:
                    print(f"  {scored.pictures.truth[case.index].path}: {case.text}")


def missed(pictures: Sequence[PictureBoxes]) -> list[Case]:
    """Return the targets no box of CONF and more is on, the largest first."""
    cases = []
    for index, boxes in enumerate(pictures):
        pairs = match_set([boxes], (0.5,))
        overlap = iou(boxes.found, boxes.truth, boxes.crowd)
        for k in np.flatnonzero(~boxes.crowd):
            score = float(np.append(boxes.score, 0.0)[pairs.detection[0, k]])  # 0 for nobody, the last
            if score < CONF:
                side = float((boxes.truth[k, 2:] - boxes.truth[k, :2]).max())
                near = float(overlap[boxes.score >= SHOWN_CONF, k].max(initial=0.0))
                text = f"missed, {side:.0f} px, score {score:.3f}, nearest box IoU {near:.2f}"
                cases.append(Case(index, boxes.truth[k], text, -side))
    return cases


def alarms(pictures: Sequence[PictureBoxes]) -> list[Case]:
    """Return the boxes of ALARM_CONF and more on no target, the surest first."""
    cases = []
    for index, boxes in enumerate(pictures):
        overlap = iou(boxes.found, boxes.truth, boxes.crowd)
        for k in np.flatnonzero((boxes.score >= ALARM_CONF) & (match_set([boxes], (0.5,)).target[0] == NOBODY)):
            where = f"IoU {overlap[k].max():.2f}" if len(boxes.truth) else "no target there"
            text = f"false alarm {boxes.score[k]:.2f}, {where}"
            cases.append(Case(index, boxes.found[k], text, -float(boxes.score[k])))
    return cases


def poor(pictures: Sequence[PictureBoxes]) -> list[Case]:
    """Return the targets found, those of the poorest boxes first."""
    cases = []
    for index, boxes in enumerate(pictures):
        pairs = match_set([boxes], (0.5,))
        overlap = iou(boxes.found, boxes.truth, boxes.crowd)
        for k in np.flatnonzero((boxes.score >= CONF) & (pairs.target[0] != NOBODY) & ~pairs.ignored[0]):
            target = pairs.target[0, k]
            off = ", ".join(f"{v:+.1f}" for v in boxes.found[k] - boxes.truth[target])
            text = f"IoU {overlap[k, target]:.3f}, score {boxes.score[k]:.2f}, off by {off} px"
            cases.append(Case(index, boxes.truth[target], text, float(overlap[k, target])))
    return cases


def _write(path: Path, cells: Sequence[Image]) -> None:
    rows = -(-len(cells) // COLUMNS)
    sheet = contact_sheet(cells, COLUMNS, rows, WHOLE[0] + PLACE, WHOLE[1])
    if not cv2.imwrite(str(path), sheet):
        raise UsageError("cannot be written", file=path)


def _cell(scored: Scored, boxes: PictureBoxes, case: Case) -> Image:
    """Return the whole picture and the place of the case beside each other, boxes drawn on both."""
    image = scored.pictures.picture(case.index)
    drawn, scale = fitted(image, *WHOLE)
    _draw(drawn, boxes, np.full(2, -0.5), scale, scores=False)
    whole = np.zeros((WHOLE[1], WHOLE[0], 3), np.uint8)
    whole[: drawn.shape[0], : drawn.shape[1]] = drawn
    name = scored.pictures.truth[case.index].path.name
    pen = _pen(whole)
    pen.label(whole, f"{name}: {case.text}", 0.0, 0.0, DARK)
    return np.concatenate([whole, _place(image, boxes, case)], axis=1)


def _place(image: Image, boxes: PictureBoxes, case: Case) -> Image:
    """Return the square about a case, three times as wide as its box, scaled to PLACE."""
    centre = (case.place_px[:2] + case.place_px[2:]) / 2.0
    side = float(np.clip(3.0 * (case.place_px[2:] - case.place_px[:2]).max(), 48.0, max(image.shape[:2])))
    corner, scale = centre - side / 2.0, PLACE / side
    shift = -corner * scale - 0.5
    matrix = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
    crop = np.asarray(cv2.warpAffine(image, matrix, (PLACE, PLACE), flags=cv2.INTER_LINEAR), np.uint8)
    _draw(crop, boxes, corner, scale, scores=True)
    return crop


def _draw(drawn: Image, boxes: PictureBoxes, corner: Array, scale: float, *, scores: bool) -> None:
    """Draw truth and detections. corner: (2,) where the picture drawn begins, a place between pixels, so n - 0.5."""
    pen = _pen(drawn)
    for box in boxes.truth:
        _box(drawn, pen, (box.reshape(2, 2) - corner) * scale - 0.5, GREEN)
    for k in np.flatnonzero(boxes.score >= SHOWN_CONF):
        corners = (boxes.found[k].reshape(2, 2) - corner) * scale - 0.5
        _box(drawn, pen, corners, VERMILLION)
        if scores and pen.sees(corners[0]):
            pen.label(drawn, f"{boxes.score[k]:.2f}", float(corners[0, 0]), float(corners[0, 1]), VERMILLION)


def _box(drawn: Image, pen: Pen, corners: Array, color: Color) -> None:
    (x0, y0), (x1, y1) = corners
    pen.line(drawn, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), color, closed=True)


def _pen(drawn: Image) -> Pen:
    return Pen(drawn.shape[1], drawn.shape[0], 1, 11, cv2.FontFace("sans"))


if __name__ == "__main__":
    raise SystemExit(main())
