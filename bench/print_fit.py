"""The whole print's pull on a detector's box around a small pad: boxes shifted at random, before and after."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from bench.ring import BORDER, OFF, OFF_PX, PAD, SIZE, _iou
from bench.show import table
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.target.print_fit import fit_print
from landtool.target.ring import fit_ring

DOMAIN = Domain(height_m=(6.0, 30.0), absent=0.0)
GENERATED = 250
SEED = 71  # of pictures on which nothing was found
LEAST_WORSE = 0.02  # of IoU
CLASSES_PX = ((10.0, 14.0), (14.0, 20.0), (20.0, 30.0), (30.0, 45.0))
WAYS = {"print": fit_print, "ring": fit_ring}


@dataclass(frozen=True)
class Pulled:
    """One box: longer side of the true one, its IoU with it before and after (None: declined), time."""

    way: str
    side_px: float
    clear: bool
    before: float
    after: float | None
    ms: float


def main() -> None:
    """Print how boxes of small pads in generated pictures fare."""
    pulled = _pulled()
    for way in WAYS:
        rows = []
        for low, high in CLASSES_PX:
            for name, clear in (("clear", True), ("fog or hidden in part", False)):
                group = [p for p in pulled if p.way == way and low <= p.side_px < high and p.clear is clear]
                if group:
                    rows.append(_row(f"{low:.0f}-{high:.0f} px, {name}", group))
        head = ["whole pads", "n", "improved", "declined", f"worse by {LEAST_WORSE}", "IoU before: median", "5 %"]
        table(f"The {way}'s pull, small pads", [*head, "after: median", "5 %", "ms"], rows)


def _pulled() -> list[Pulled]:
    rng = np.random.default_rng(SEED)
    found = []
    for index in range(GENERATED):
        sample = make_sample(DOMAIN, PAD, SIZE, SEED, index)
        truth = sample.truth.box_px
        if truth is None or (np.abs(truth - BORDER) < 0.01).any():
            continue
        side = np.tile(truth[2:] - truth[:2], 2)
        if not CLASSES_PX[0][0] <= side.max() < CLASSES_PX[-1][1]:
            continue
        clear = sample.truth.beta_per_m == 0.0 and sample.truth.hidden < 0.02
        box = truth + rng.uniform(-OFF, OFF, 4) * side + rng.uniform(-OFF_PX, OFF_PX, 4)
        image = sample.image
        for way, fit_one in WAYS.items():
            fit_one(image, box, PAD)
            start = time.thread_time()
            fit = fit_one(image, box, PAD)
            ms = 1e3 * (time.thread_time() - start)
            after = _iou(fit.box_px(*SIZE), truth) if fit else None
            found.append(Pulled(way, float(side.max()), clear, _iou(box, truth), after, ms))
    return found


def _row(name: str, group: list[Pulled]) -> list[str]:
    before = np.array([p.before for p in group])
    after = np.array([np.nan if p.after is None else p.after for p in group])
    shares = ((after > before).mean(), np.isnan(after).mean(), (after < before - LEAST_WORSE).mean())
    kept = after[~np.isnan(after)]
    values = [np.median(before), np.percentile(before, 5)]
    values += [np.median(kept), np.percentile(kept, 5)] if len(kept) else [np.nan, np.nan]
    ms = np.median([p.ms for p in group])
    return [name, str(len(group)), *(f"{100 * s:.1f} %" for s in shares), *(f"{v:.3f}" for v in values), f"{ms:.2f}"]


if __name__ == "__main__":
    main()
