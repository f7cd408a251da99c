"""`landtool train`: a network from labelled pictures."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any, get_args

import click

from landtool.errors import UsageError
from landtool.train.settings import BOUNDS, Recipe, TrainSettings, darknet_recipe
from landtool_cli import options
from landtool_cli.console import Console, pass_console
from landtool_cli.settings import from_file, with_options

_NEEDS_TORCH = "pip install 'landtool[train]', or 'torch>=2.4' for your machine as pytorch.org says"


def whole_number(name: str) -> click.IntRange:
    """Return the range of a whole number of the settings."""
    low, high = BOUNDS[name]
    return click.IntRange(int(low), int(high))


@click.command("train")
@click.option("--data", metavar="DATA", help="data.yaml, a darknet .data, or generate:SEED for generated pictures.")
@options.output("Folder of the training.  [default: runs/train]")
@click.option("--cfg", type=options.PATH, metavar="FILE", help="Network, darknet .cfg.  [default: Table I's]")
@click.option(
    "--size", type=options.size_px, metavar="WxH", help="Pictures the network is made for.  [default: 640x480]"
)
@click.option("--weights", type=options.PATH, metavar="FILE", help="Start from: .weights, a backbone, a checkpoint.")
@click.option("--anchors", type=click.Choice(["cfg", "kmeans"]), help="From the cfg, or the labels.  [default: cfg]")
@click.option("--iterations", type=whole_number("iterations"), metavar="N", help="Steps to take.  [default: 3200]")
@click.option("--batch", type=whole_number("batch"), metavar="N", help="Pictures a step.  [default: 32]")
@click.option("--seed", type=click.IntRange(min=0), metavar="S", help="Another seed, another training.  [default: 0]")
@click.option(
    "--recipe",
    type=click.Choice(get_args(Recipe)),
    default="landtool",
    show_default=True,
    help="darknet: loss, rate and pictures as Table I and darknet have them.",
)
@click.option("--loss", type=click.Choice(["overlap", "darknet"]), help="How boxes are judged.  [default: overlap]")
@click.option(
    "--learning-rate",
    type=options.FiniteRange(*BOUNDS["learning_rate"]),
    metavar="R",
    help="The highest.  [default: 0.0015]",
)
@click.option("--schedule", type=click.Choice(["cosine", "steps"]), help="How it falls.  [default: cosine]")
@click.option(
    "--bf16", type=click.Choice(["auto", "on", "off"]), help="bf16 arithmetic; auto measures.  [default: auto]"
)
@click.option(
    "--validate-every",
    type=whole_number("validate_every"),
    metavar="N",
    help="Iterations between validations.  [default: 250]",
)
@click.option("--threads", type=whole_number("threads"), metavar="N", help="Processor threads.  [default: one a core]")
@options.config
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    data: str | None,
    output: Path | None,
    config: Path | None,
    recipe: Recipe,
    overwrite: bool,
    **flags: Any,
) -> None:
    """Train Tiny-YOLOv3 on a data set, or on pictures the generator draws meanwhile.

    Writes weights/best.landtool for `landtool export`, best.weights for darknet, results.csv, curves.png and
    validation.png. Interrupted, the same command goes on where it stopped, with the same result.
    """
    base = darknet_recipe(TrainSettings()) if recipe == "darknet" else TrainSettings()
    settings = with_options(from_file(base, config), flags)
    if data is None:
        raise UsageError("no data", hint="give --data DIR/data.yaml, or --data generate:1")
    if importlib.util.find_spec("torch") is None:
        raise UsageError("training needs torch, which is not installed", hint=_NEEDS_TORCH)
    from landtool.train.training import Step, train  # loads torch

    folder = output or Path("runs/train")
    console.unfinished = "the same command goes on from the last checkpoint"
    with console.counter(label=folder.name, unit="step") as counter:

        def on_step(step: Step) -> None:
            known = "" if step.map50 is None else f", mAP50 {step.map50:.3f}"
            counter.describe(f"loss {step.loss.total:.3f}{known}")
            counter.reach(step.iteration, step.iterations)

        made = train(data, folder, settings, overwrite=overwrite, tell=console.log, on_step=on_step)
    best = made.best_row
    console.result(f"{made.folder}: {len(made.rows)} validations, {made.seconds / 60.0:.1f} min")
    console.result(f"  best at iteration {best.iteration}: mAP50 {_text(best.map50)}, mAP50-95 {_text(best.map50_95)}")
    if not best.map50:
        console.warning(f"{made.folder}: it finds nothing yet; train longer, or look at validation.png")
    console.result(f"  landtool export {made.best} -o {made.folder / 'model.onnx'}")


def _text(value: float | None) -> str:
    return "undefined" if value is None else f"{value:.4f}"
