"""A training of a few seconds: pictures with one red square each, and a network that just about sees it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from landtool.io.labels import LabelledBox, yolo_rows
from landtool.train.settings import TrainSettings
from tests.unit.darknet.networks import layer

SIDE = 64
CFG = "".join(
    [
        f"[net]\nwidth={SIDE}\nheight={SIDE}\nchannels=3\nletter_box=1\n\n",
        *(layer(batch_normalize=1, filters=n, size=3, stride=2, pad=1, activation="leaky") for n in (8, 16, 16)),
        layer(filters=12, size=1, activation="linear"),
        "[yolo]\nmask=0,1\nanchors=14,14, 30,24\nclasses=1\nnum=2\nignore_thresh=.7\n",
    ]
)


def settings(folder: Path, **changes: object) -> TrainSettings:
    """Return settings for the pictures of `dataset`."""
    cfg = folder / "small.cfg"
    cfg.write_text(CFG, encoding="utf-8")
    values: dict[str, object] = {
        "cfg": cfg,
        "size": None,
        "iterations": 6,
        "batch": 4,
        "sides": (SIDE,),
        "whole": 0.5,
        "warm_up": 2,
        "validate_every": 3,
        "validate_on": 3,
        "bf16": "off",
        "threads": 1,
    }
    return TrainSettings(**{**values, **changes})  # type: ignore[arg-type]


def dataset(folder: Path, count: int = 8) -> Path:
    """Write a YOLO data set; returns its data.yaml."""
    rng = np.random.default_rng(1)
    for split in ("train", "val"):
        for kind in ("images", "labels"):
            (folder / kind / split).mkdir(parents=True)
        for i in range(count):
            image = rng.integers(60, 120, (SIDE, SIDE, 3)).astype(np.uint8)
            x, y, side = (int(v) for v in rng.integers((4, 4, 12), (28, 28, 30)))
            image[y : y + side, x : x + side] = (20, 20, 220)
            cv2.imwrite(str(folder / "images" / split / f"{i}.png"), image)
            box = LabelledBox(0, x - 0.5, y - 0.5, x + side - 0.5, y + side - 0.5)
            text = yolo_rows([box], SIDE, SIDE)
            (folder / "labels" / split / f"{i}.txt").write_text(text, encoding="utf-8")
    data = folder / "data.yaml"
    data.write_text("train: images/train\nval: images/val\nnames: [pad]\n", encoding="utf-8")
    return data
