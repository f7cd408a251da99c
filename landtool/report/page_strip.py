"""The strip over the page of plots: stage, method, track and picture of every frame, as bars."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.report.page_data import DAMAGED, LOST, METHODS, STAGES, STATES, PageData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Rows from the top: name, column, and for every value its name, colour and hatch
_ROWS = (
    ("stage", "stage", ((STAGES["far"], "far", "#cfe8f7", ""), (STAGES["near"], "near", "#56b4e9", ""))),
    (
        *("measured by", "method"),
        (
            (METHODS["box"], "box", "#cc79a7", "///"),
            (METHODS["target"], "target", "#e69f00", ""),
            (METHODS["tag"], "tag", "#0072b2", ""),
        ),
    ),
    (
        *("track", "state"),
        (
            (STATES["confirmed"], "confirmed", "#009e73", ""),
            (STATES["coasting"], "coasting", "#f0e442", "\\\\\\"),
            (STATES["tentative"], "tentative", "#dddddd", ""),
        ),
    ),
    (
        "picture",
        "trouble",
        ((0.0, "good", "#eeeeee", ""), (DAMAGED, "damaged", "#d55e00", ""), (LOST, "lost", "#222222", "")),
    ),
)
_HEIGHT = 0.8


def draw_strip(axes: Axes, data: PageData) -> None:
    """Draw the four rows; a frame's bar goes up to the next frame."""
    starts, widths = _bars(data.frames.column("at"))
    for row, (_, column, kinds) in enumerate(_ROWS):
        values = data.frames.column(column)
        for value, _, color, hatch in kinds:
            runs = _runs((values == value) & np.isfinite(starts), starts, widths)
            places = (-row - 0.5 * _HEIGHT, _HEIGHT)
            axes.broken_barh(runs, places, facecolor=color, hatch=hatch, edgecolor="#444444", linewidth=0.0)
    axes.set_yticks([-row for row in range(len(_ROWS))], [name for name, *_ in _ROWS], fontsize=10)
    axes.set_ylim(0.6 - len(_ROWS), 0.6)
    axes.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    _explain(axes, data)


def _explain(axes: Axes, data: PageData) -> None:
    """Name, above the strip, the colours that occur in it."""
    from matplotlib.patches import Patch

    patches = [
        Patch(facecolor=color, hatch=hatch, edgecolor="#444444", linewidth=0.3, label=name)
        for _, column, kinds in _ROWS
        for value, name, color, hatch in kinds
        if (data.frames.column(column) == value).any() and name != "good"
    ]
    axes.legend(
        handles=patches,
        loc="lower right",
        bbox_to_anchor=(1.0, 0.98),
        ncols=len(patches),
        frameon=False,
        fontsize=10,
        borderpad=0.0,
        columnspacing=1.2,
        handlelength=1.6,
    )


def _bars(at: Array) -> tuple[Array, Array]:
    """Return where the frames' bars (N,) begin and how wide they are; what follows no later has the usual width."""
    step = np.diff(at)
    forward = step[np.isfinite(step) & (step > 0.0)]
    usual = float(np.median(forward)) if len(forward) else 1.0
    # a frame stands for its own time: a bar as long as a gap in the recording would hide the gap
    widths = np.append(np.where(np.isfinite(step) & (step > 0.0), np.minimum(step, 2.0 * usual), usual), usual)
    return at, widths


def _runs(chosen: NDArray[np.bool_], starts: Array, widths: Array) -> list[tuple[float, float]]:
    """Join the bars of neighbouring frames that are chosen (N,) bool and touch: (start, width) each."""
    runs: list[tuple[float, float]] = []
    for start, width in zip(starts[chosen].tolist(), widths[chosen].tolist(), strict=True):
        end = sum(runs[-1]) if runs else -np.inf
        if runs and abs(start - end) < 0.01 * width:
            runs[-1] = runs[-1][0], start + width - runs[-1][0]
        else:
            runs.append((start, width))
    return runs
