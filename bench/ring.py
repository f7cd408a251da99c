"""The red ring's pull on a detector's box: boxes shifted at random, before and after `fit_ring`."""

from __future__ import annotations

import csv
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from bench.show import table
from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.target.ring import fit_ring
from landtool.types import Image

SIZE = (640, 480)
GENERATED = 200
SEED = 4  # not that of the pictures on which the thresholds were found
BOXES = 3  # for each picture
# how far each edge of the stand-in for a network's box is off: share of the side, and pixels
OFF, OFF_PX = 0.12, 1.5
LEAST_WORSE = 0.02  # of IoU
REPEATS = 3  # of which the quickest counts: the machine may have other work
RENDERED = Path(__file__).resolve().parents[2] / "shared" / "data" / "rendered"
PAD = PadSpec()
BORDER = np.array([-0.5, -0.5, SIZE[0] - 0.5, SIZE[1] - 0.5])


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture with the pad, its true box (4,), and whether the air is clear and nothing stands before the pad."""

    image: Image
    box_px: Array
    clear: bool = True


@dataclass(frozen=True)
class Pulled:
    """One box: longer side of the true one, its IoU with it before and after (None: declined), time."""

    side_px: float
    cut: bool
    clear: bool
    before: float
    after: float | None
    ms: float


def main() -> None:
    """Print how boxes of generated and path-traced pictures fare."""
    _print("generated pictures", _pulled(_generated()))
    for kind in ("stills", "fog"):
        if (RENDERED / kind).exists():
            _print(f"path-traced {kind}", _pulled(_rendered(kind)))


def _generated() -> Iterator[Shown]:
    for index in range(GENERATED):
        sample = make_sample(Domain(), PAD, SIZE, SEED, index)
        if sample.truth.box_px is not None:
            clear = sample.truth.beta_per_m == 0.0 and sample.truth.hidden < 0.02
            yield Shown(sample.image, sample.truth.box_px, clear)


def _rendered(kind: str) -> Iterator[Shown]:
    with (RENDERED / kind / "labels.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            image = cv2.imread(str(RENDERED / row["file"]))
            if row["present"] == "1" and image is not None:
                # those labels have pixel centres at +0.5
                box = np.array([float(row[name]) for name in ("x_min", "y_min", "x_max", "y_max")]) - 0.5
                yield Shown(np.asarray(image, dtype=np.uint8), box)


def _pulled(pictures: Iterator[Shown]) -> list[Pulled]:
    rng = np.random.default_rng(SEED)
    found = []
    for shown in pictures:
        truth = shown.box_px
        side = np.tile(truth[2:] - truth[:2], 2)
        cut = np.abs(truth - BORDER) < 0.01
        for _ in range(BOXES):
            box = truth + rng.uniform(-OFF, OFF, 4) * side + rng.uniform(-OFF_PX, OFF_PX, 4)
            # a network sees where the picture ends
            box = np.where(cut, BORDER + rng.uniform(-OFF_PX, OFF_PX, 4), box)
            box = np.clip(box, -0.5, np.tile(BORDER[2:], 2))
            fit, ms = fit_ring(shown.image, box, PAD), _quickest_ms(shown.image, box)
            after = _iou(fit.box_px(*SIZE), truth) if fit else None
            found.append(Pulled(float(side.max()), bool(cut.any()), shown.clear, _iou(box, truth), after, ms))
    return found


def _quickest_ms(image: Image, box: Array) -> float:
    spent = []
    for _ in range(REPEATS):
        start = time.thread_time()
        fit_ring(image, box, PAD)
        spent.append(time.thread_time() - start)
    return 1e3 * min(spent)


def _iou(a: Array, b: Array) -> float:
    common = float(np.prod(np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0.0)))
    return common / (float(np.prod(a[2:] - a[:2])) + float(np.prod(b[2:] - b[:2])) - common)


def _print(title: str, pulled: list[Pulled]) -> None:
    whole = [p for p in pulled if p.clear and not p.cut]
    groups = {
        "all": pulled,
        "cut by the border": [p for p in pulled if p.cut],
        "fog or hidden in part": [p for p in pulled if not p.clear],
        "clear, whole": whole,
        "  < 20 px": [p for p in whole if p.side_px < 20.0],
        "  20-40 px": [p for p in whole if 20.0 <= p.side_px < 40.0],
        "  40-100 px": [p for p in whole if 40.0 <= p.side_px < 100.0],
        "  > 100 px": [p for p in whole if p.side_px >= 100.0],
    }
    head = ["boxes", "n", "improved", "declined", f"worse by {LEAST_WORSE}", "IoU before: median", "5 %"]
    head += ["after: median", "5 %", "mean", "ms"]
    table(f"The ring's pull, {title}", head, [_row(name, group) for name, group in groups.items() if group])


def _row(name: str, group: list[Pulled]) -> list[str]:
    pairs = np.array([(p.before, p.after) for p in group if p.after is not None]).reshape(-1, 2)
    before, after = pairs.T
    n = len(group)
    shares = ((after > before).sum() / n, 1.0 - len(after) / n, (after < before - LEAST_WORSE).sum() / n)
    row = [name, str(n), *(f"{100 * share:.1f} %" for share in shares)]
    if not len(after):
        return [*row, *["-"] * 5, f"{np.median([p.ms for p in group]):.2f}"]
    values = (np.median(before), np.percentile(before, 5), np.median(after), np.percentile(after, 5), after.mean())
    return [*row, *(f"{value:.3f}" for value in values), f"{np.median([p.ms for p in group]):.2f}"]
