"""Pictures of a training: its curves, and what the network finds in the validation pictures."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import cv2
import numpy as np

from landtool.evaluate.matching import iou
from landtool.geometry import Array
from landtool.io.labels import LabelledImage
from landtool.strokes import GREEN, VERMILLION, Pen
from landtool.synth.preview.sheet import contact_sheet, fitted
from landtool.train.results import ResultRow
from landtool.types import Detection, Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BLUE, _RED, _GREEN, _BLACK = "#0072b2", "#d55e00", "#009e73", "#222222"
_DPI = 100
_COLUMNS, _ROWS, _TILE_PX = 6, 4, (320, 240)
SHEET_PICTURES = _COLUMNS * _ROWS
_LEAST_SCORE = 0.1  # of a box that is drawn; weaker ones would cover the picture
_APART_PX = 2.0  # boxes are drawn this far outside, so that they cover nothing of a small target
_FOUND_IOU = 0.5


def draw_curves(rows: Sequence[ResultRow]) -> bytes:
    """Return a PNG of losses, scores and learning rate against iterations, minutes above."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 9))
    FigureCanvasAgg(figure)  # or saving would ask for the window system
    places = {"left": 0.06, "right": 0.98, "top": 0.91, "bottom": 0.06, "hspace": 0.42, "wspace": 0.16}
    losses, scores, shares, rate = figure.subplots(2, 2, gridspec_kw=places).flat
    _loss_curves(losses, rows)
    _score_curves(scores, rows, {"mAP50": "map50", "mAP50-95": "map50_95"}, "average precision on validation")
    _score_curves(shares, rows, {"precision": "precision", "recall": "recall"}, "precision and recall on validation")
    rate.plot([row.iteration for row in rows], [row.learning_rate for row in rows], color=_BLUE, marker=".")
    rate.set_ylim(bottom=0.0)
    rate.set_title("learning rate", fontsize=10)
    for axes in (losses, scores, shares, rate):
        axes.set_xlabel("iterations", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
        _minutes_above(axes, rows)
    data = BytesIO()
    # no name of the software, whose version would change the bytes
    figure.savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def validation_sheet(
    images: Sequence[Image], truth: Sequence[LabelledImage], found: Sequence[Sequence[Detection]]
) -> Image:
    """Return a contact sheet of 24 pictures, the worst first: true boxes green, found ones red with their scores.

    images: (H, W, 3) BGR uint8 each. The worst have targets missed, and false boxes with high scores.
    """
    errors = [_error(t, f) for t, f in zip(truth, found, strict=True)]
    worst = sorted(range(len(images)), key=lambda index: -errors[index])[:SHEET_PICTURES]
    width, height = _TILE_PX
    return contact_sheet((_tile(images[i], truth[i], found[i]) for i in worst), _COLUMNS, _ROWS, width, height)


def _loss_curves(axes: Axes, rows: Sequence[ResultRow]) -> None:
    iterations = [row.iteration for row in rows]
    parts = {
        "box": [row.loss_box for row in rows],
        "objectness": [row.loss_objectness for row in rows],
        "classes": [row.loss_classes for row in rows],
    }
    total = [sum(values) for values in zip(*parts.values(), strict=True)]
    for (name, values), color in zip({"all": total, **parts}.items(), (_BLACK, _BLUE, _RED, _GREEN), strict=True):
        axes.plot(iterations, values, label=name, color=color, marker=".")
    axes.set_ylim(bottom=0.0)
    axes.set_title("loss", fontsize=10)
    axes.legend(fontsize=8)


def _score_curves(axes: Axes, rows: Sequence[ResultRow], names: dict[str, str], title: str) -> None:
    iterations = [row.iteration for row in rows]
    for (label, name), color in zip(names.items(), (_BLUE, _RED), strict=True):
        values: list[float | None] = [getattr(row, name) for row in rows]
        last = next((value for value in reversed(values) if value is not None), None)
        text = label if last is None else f"{label}, last {last:.3f}"
        axes.plot(iterations, [np.nan if v is None else v for v in values], label=text, color=color, marker=".")
    axes.set_ylim(0.0, 1.02)
    axes.set_title(title, fontsize=10)
    axes.legend(fontsize=8, loc="lower right")


def _minutes_above(axes: Axes, rows: Sequence[ResultRow]) -> None:
    """Add an axis of minutes; between rows, and from the start on, steps are taken to be equally long."""
    minutes = np.array([0.0, *(row.seconds / 60.0 for row in rows)])
    iterations = np.array([0.0, *(float(row.iteration) for row in rows)])
    axes.set_xlim(0.0, 1.02 * max(1.0, iterations[-1]))
    above = axes.twiny()
    above.set_xlim(axes.get_xlim())
    step = _round_step(float(minutes[-1]))
    marks = np.arange(0.0, minutes[-1] + 1e-9, step)
    above.set_xticks(np.interp(marks, minutes, iterations).tolist(), [f"{mark:g}" for mark in marks])
    above.tick_params(labelsize=8)
    above.set_xlabel("minutes", fontsize=8)


def _round_step(total: float) -> float:
    """Return 1, 2 or 5 times a power of ten that divides a length into eight parts or fewer.

    >>> _round_step(117.0), _round_step(0.5)
    (20.0, 0.1)
    """
    power = 10.0 ** np.floor(np.log10(max(total, 1e-3) / 8.0))
    return float(next(round(f * power, 9) for f in (1.0, 2.0, 5.0, 10.0) if total <= 8.0 * f * power))


def _error(truth: LabelledImage, found: Sequence[Detection]) -> float:
    """Return how much of a picture is wrong.

    2 for a target missed, for one found what its score and its IoU lack of 1, for a false box its score.
    """
    shown = sorted(found, key=lambda d: -d.score)
    targets = _edges([(b.x_min_px, b.y_min_px, b.x_max_px, b.y_max_px) for b in truth.boxes])
    boxes = _edges([(d.x_min_px, d.y_min_px, d.x_max_px, d.y_max_px) for d in shown])
    crowd = np.array([box.crowd for box in truth.boxes], np.bool_)
    error, free = 0.0, ~crowd  # a crowd need not be found
    overlap = iou(boxes, targets, crowd)
    for row, detection in zip(overlap, shown, strict=True):
        best = int(np.argmax(np.where(free, row, -1.0))) if free.any() else -1
        if best >= 0 and row[best] >= _FOUND_IOU:
            error += (1.0 - detection.score) + (1.0 - float(row[best]))
            free[best] = False
        else:
            error += detection.score
    return error + 2.0 * float(free.sum())


def _edges(boxes: Sequence[tuple[float, float, float, float]]) -> Array:
    return np.array(boxes, np.float64).reshape(-1, 4)


def _tile(image: Image, truth: LabelledImage, found: Sequence[Detection]) -> Image:
    tile, scale = fitted(image, *_TILE_PX)
    pen = Pen(tile.shape[1], tile.shape[0], 1, 11, cv2.FontFace("sans"))
    for box in truth.boxes:
        _outline(tile, pen, (box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px), scale, GREEN)
    for seen in sorted(found, key=lambda d: d.score):  # the best on top
        if seen.score >= _LEAST_SCORE:
            x, y = _outline(tile, pen, (seen.x_min_px, seen.y_min_px, seen.x_max_px, seen.y_max_px), scale, VERMILLION)
            pen.label(tile, f"{seen.score:.2f}", x, y, VERMILLION)
    return tile


def _outline(
    tile: Image, pen: Pen, box: tuple[float, float, float, float], scale: float, color: tuple[int, int, int]
) -> tuple[float, float]:
    """Draw a box around its content; return its upper left corner in the tile."""
    # scaled about the picture's corner at (-0.5, -0.5)
    edges = (np.array(box) + 0.5) * scale - 0.5 + np.array([-_APART_PX, -_APART_PX, _APART_PX, _APART_PX])
    far = np.array([tile.shape[1], tile.shape[0]] * 2) - 1.0
    x0, y0, x1, y1 = np.clip(edges, 0.0, far)
    pen.line(tile, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), color, closed=True)
    return float(x0), float(y0)
