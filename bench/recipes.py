"""Recipes of training beside each other: what each reaches with the same pictures and the same number of steps.

`python -m bench.recipes [ITERATIONS] [FOLDER]`: about 20 minutes on two cores, so it is no part of `make bench`. All
see 320x240 pictures, a quarter of the shipped network's, so that each takes minutes; what is compared is how fast they
learn.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import cv2

from bench.show import table
from landtool.pad import PadSpec
from landtool.synth.dataset import DatasetRequest, write_dataset
from landtool.synth.domain import Domain
from landtool.train.settings import TrainSettings, darknet_recipe
from landtool.train.training import train

PICTURES, SIZE = 3000, (320, 240)
OURS = TrainSettings(size=(320, 256), sides=(160, 192, 224), pyramid=False, validate_on=150)
RECIPES = {
    "landtool": OURS,
    "landtool, darknet's loss": replace(OURS, loss="darknet"),
    "landtool, anchors by k-means": replace(OURS, anchors="kmeans"),
    "landtool, whole pictures only": replace(OURS, whole=1.0),
    "Table I (darknet's recipe)": replace(darknet_recipe(OURS), size=(320, 256)),
}


def main(arguments: list[str]) -> None:
    """Train all and print the table."""
    cv2.setNumThreads(1)
    iterations = int(arguments[0]) if arguments else 400
    folder = Path(arguments[1] if len(arguments) > 1 else "runs/recipes")
    data = folder / "data"
    if not data.exists():
        request = DatasetRequest(PICTURES, 31, SIZE, (0.95, 0.05), Domain(), PadSpec())
        write_dataset(request, data, jobs=2, preview=False)
    rows = []
    for name, settings in RECIPES.items():
        settings = replace(settings, iterations=iterations, validate_every=iterations // 4)
        run = folder / name.replace(" ", "-").replace(",", "").replace("'", "")
        made = train(str(data / "data.yaml"), run, settings, overwrite=True)
        scores = [f"{row.map50 or 0.0:.3f}" for row in made.rows]
        last = made.rows[-1]
        rows.append([name, *scores, f"{last.map50_95 or 0.0:.3f}", f"{made.seconds / 60.0:.1f}"])
        print(name, *scores, flush=True)
    parts = [f"mAP50 at {(i + 1) * (iterations // 4)}" for i in range(4)]
    table(f"{iterations} steps of 32 pictures", ["recipe", *parts, "mAP50-95", "minutes"], rows)


if __name__ == "__main__":
    main(sys.argv[1:])
