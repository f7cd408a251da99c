"""Everything a training can be told, except its data and its output folder. No torch here: commands read it."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal

from landtool.errors import UsageError
from landtool.synth.domain import Domain

Recipe = Literal["landtool", "darknet"]
# What a number must lie in; the command line's options have the same
BOUNDS: dict[str, tuple[float, float]] = {
    "iterations": (1, 10_000_000),
    "batch": (1, 4096),
    "learning_rate": (1e-7, 10.0),
    "warm_up": (0, 1_000_000),
    "weight_decay": (0.0, 1.0),
    "average": (0.0, 0.99999),
    "mosaic": (0.0, 1.0),
    "whole": (0.0, 1.0),
    "degrade": (0.0, 1.0),
    "flip": (0.0, 1.0),
    "hue": (0.0, 0.5),
    "saturation": (1.0, 10.0),
    "exposure": (1.0, 10.0),
    "zoom": (1.0, 10.0),
    "validate_every": (1, 10_000_000),
    "save_minutes": (0.0, 1e6),
    "threads": (1, 256),
    "validate_on": (1, 100_000),
    "first_pictures": (1, 1_000_000),
    "fresh_pictures": (0.0, 1000.0),
    "keep_pictures": (1, 10_000_000),
}


@dataclass(frozen=True)
class TrainSettings:
    """How a network is trained. The defaults are the recipe of the shipped model."""

    # network: a darknet cfg; default: pad-tiny-yolov3, Table I
    cfg: Path | None = None
    # size of the pictures the network is made for, width and height in pixels; none: the cfg's
    size: tuple[int, int] | None = (640, 480)
    # look at a picture at half its size, too, for targets larger than what a cell sees; costs a quarter more
    pyramid: bool = True
    # start from these: darknet weights (a backbone will do) or a checkpoint
    weights: Path | None = None
    # anchors of the cfg, or found in the labels by k-means
    anchors: Literal["cfg", "kmeans"] = "cfg"
    # steps to train for
    iterations: int = 3200
    # pictures a step
    batch: int = 32
    # another seed: other pictures, other weights to start from
    seed: int = 0
    # overlap: CIoU, several anchors learn a target; darknet: as darknet has it
    loss: Literal["overlap", "darknet"] = "overlap"
    # adamw, or sgd with momentum 0.9
    optimizer: Literal["adamw", "sgd"] = "adamw"
    # highest rate
    learning_rate: float = 0.0015
    # how it falls: cosine to a hundredth, or by the steps of the cfg
    schedule: Literal["cosine", "steps"] = "cosine"
    # iterations over which the rate rises
    warm_up: int = 100
    # share of the kernels taken off, times the rate, a step
    weight_decay: float = 0.02
    # how much of the running mean of the weights is kept a step; 0: no mean
    average: float = 0.998
    # sides of the square pictures trained on, parts at about full scale; one is drawn every ten steps
    sides: tuple[int, ...] = (256, 288, 320, 352)
    # share of the steps on whole pictures of the network's own size
    whole: float = 0.12
    # a part is shown larger or smaller by up to this factor
    zoom: float = 1.8
    # share of the pictures put together from four
    mosaic: float = 0.15
    # share of the pictures made worse: fog, blur, noise, JPEG
    degrade: float = 0.4
    # share of the pictures mirrored, each way
    flip: float = 0.5
    # most by which hue is turned, as a share of the circle; Table I's 0.1 makes the red ring as yellow as that of signs
    hue: float = 0.03
    # most by which saturation is multiplied or divided
    saturation: float = 1.5
    # most by which exposure is multiplied or divided
    exposure: float = 1.5
    # bf16 arithmetic: auto measures whether it is faster
    bf16: Literal["auto", "on", "off"] = "auto"
    # iterations between validations
    validate_every: int = 250
    # pictures of the validation set each takes
    validate_on: int = 200
    # minutes between checkpoints
    save_minutes: float = 3.0
    # processor threads; none: one a core
    threads: int | None = None
    # what the pictures of --data generate vary in
    domain: Domain = field(default_factory=Domain)
    # photographs to lay under the pad of those
    backgrounds: tuple[str, ...] = ()
    # how many of those there are at the first step
    first_pictures: int = 500
    # how many come with each step
    fresh_pictures: float = 4.0
    # how many are kept in memory at the most
    keep_pictures: int = 12000

    def __post_init__(self) -> None:
        for setting in fields(self):
            value = getattr(self, setting.name)
            low, high = BOUNDS.get(setting.name, (None, None))
            if low is not None and high is not None and value is not None and not low <= value <= high:
                raise UsageError(f"{setting.name} = {value:g} is impossible", hint=f"give {low:g} to {high:g}")
        if not self.sides and self.whole < 1.0:
            raise UsageError("sides is empty", hint="give sizes, or whole = 1")


def darknet_recipe(settings: TrainSettings) -> TrainSettings:
    """Return the settings with Table I's recipe put in: darknet's loss, SGD with momentum, its steps, no extras.

    Whole pictures at the cfg's own size. What it does not name (iterations, batch, seed, bf16, ...) stays.
    """
    return replace(
        settings,
        size=None,
        pyramid=False,
        anchors="cfg",
        loss="darknet",
        optimizer="sgd",
        schedule="steps",
        learning_rate=0.001,
        warm_up=1000,
        weight_decay=0.0005,
        average=0.0,
        whole=1.0,
        zoom=1.3,
        mosaic=0.0,
        degrade=0.0,
        hue=0.1,
        saturation=1.5,
        exposure=1.5,
    )
