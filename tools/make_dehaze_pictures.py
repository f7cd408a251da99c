"""Draw docs/pictures/dehaze-*: scenes dehazed beside their clear twins, and what the detector finds through fog.

`python tools/make_docs.py --pictures` draws them with all others; `python tools/make_dehaze_pictures.py` alone.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image as PilImage

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # bench is no installed package

from bench.dehaze_detector import MODES, InFog, in_fog
from bench.dehaze_pairs import dehazed_alone
from bench.detect_sets import HEIGHT_M, PAD, SIZE
from landtool.dehaze.config import DehazeConfig
from landtool.strokes import DARK, WHITE, Pen
from landtool.synth.domain import Domain
from landtool.synth.fog_pair import make_fog_pair
from landtool.synth.preview.sheet import contact_sheet, fitted
from landtool.types import Image

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
SEED = 31
SCENES = ((9, 50.0), (3, 30.0), (7, 22.0))  # their numbers, and how far one sees in the fog, metres
# a camera that holds still and sees the whole pad, in daylight
SHOWN = Domain(
    height_m=(5.0, 10.0), tilt_deg=(0.0, 35.0), distortion=0.3, absent=0.0, cut=0.0, least_visible=0.9,
    small_print=0.0, light=(0.6, 1.0), fog=1.0, fog_banks=0.0, defocus=0.0, motion_blur=0.0, rolling_shutter=0.0,
)  # fmt: skip
CELL_PX = (240, 180)
HEAD_PX = 22
QUALITY = 80
COLORS = 32  # of the chart's palette
STYLES = {"off": ("#222222", "-", "s"), "auto": ("#0072b2", "-", "o"), "on": ("#d55e00", "--", "^")}


def main() -> None:
    """Write both pictures."""
    cv2.setNumThreads(1)
    sheet = PilImage.fromarray(scenes()[:, :, ::-1])
    # a palette is too small for photographs
    sheet.save(PICTURES / "dehaze-scenes.jpg", quality=QUALITY, optimize=True)
    chart = recall_chart(in_fog()).quantize(COLORS, dither=PilImage.Dither.NONE)
    chart.save(PICTURES / "dehaze-recall.png", optimize=True)


def scenes() -> Image:
    """Return scenes, one a row: through fog, dehazed by both recipes, and in clear air."""
    cells: list[Image] = []
    for index, visibility_m in SCENES:
        domain = replace(SHOWN, visibility_m=(visibility_m, visibility_m))
        pair = make_fog_pair(domain, PAD, SIZE, SEED, index)
        assert pair is not None
        made = [dehazed_alone(pair.foggy, config)[0] for config in (DehazeConfig(), DehazeConfig(recipe="paper"))]
        row = [fitted(image, *CELL_PX)[0] for image in (pair.foggy, *made, pair.clear)]
        pen = Pen.of_image(*CELL_PX)
        pen.label(row[0], f"visibility {pair.fog.visibility_m:.0f} m, haze {pair.haze:.2f}", 0, 0, DARK)
        cells += row
    names = ("fog", "--recipe veil", "--recipe paper", "the same in clear air")
    sheet = contact_sheet(cells, len(names), len(SCENES), *CELL_PX)
    head = np.full((HEAD_PX, sheet.shape[1], 3), sheet[0, CELL_PX[0]], np.uint8)  # the colour of the gaps
    pen = Pen.of_image(*SIZE)
    for column, name in enumerate(names):
        pen.text(head, name, round(column * sheet.shape[1] / len(names)) + 6, HEAD_PX - 6, WHITE)
    return np.concatenate([head, sheet])


def recall_chart(measured: Sequence[InFog]) -> PilImage.Image:
    """Return a chart of recall and average precision against the extinction of fog."""
    figure = Figure(figsize=(8.4, 3.4), dpi=100)
    FigureCanvasAgg(figure)  # or saving would ask for the window system
    places = {"left": 0.07, "right": 0.985, "top": 0.91, "bottom": 0.15, "wspace": 0.16}
    beta = [fog.beta_per_m for fog in measured]
    titles = {"recall": "recall at conf 0.25", "map50": "mAP50"}
    for axes, (name, title) in zip(figure.subplots(1, 2, gridspec_kw=places), titles.items(), strict=True):
        for mode in MODES:
            color, line, mark = STYLES[mode]
            values = [getattr(fog.scores[mode], name) for fog in measured]
            axes.plot(beta, values, line, color=color, marker=mark, markersize=4, label=f"--dehaze {mode}")
        axes.set_ylim(0.0, 1.03)
        axes.set_title(f"{title}, from {HEIGHT_M:g} m", fontsize=10)
        axes.set_xlabel("extinction of the fog, 1/m", fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, loc="lower left")
    data = BytesIO()
    figure.savefig(data, format="png")
    return PilImage.open(data).convert("RGB")


if __name__ == "__main__":
    main()
