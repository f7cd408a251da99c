"""`landtool eval`: every stage against truth, and the gate that keeps it from getting worse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from landtool.config import EVAL_SAVES, EVAL_STAGES, EvalConfig, TrackConfig
from landtool.detect.config import BOUNDS as DETECTOR_BOUNDS
from landtool.errors import UsageError
from landtool.evaluate.dataset import SPLITS
from landtool.evaluate.gate import gate_lines
from landtool.evaluate.words import metric_lines
from landtool.run.eval_request import EvalRequest
from landtool.run.evaluation import SHIPPED, EvalOutcome, evaluate
from landtool_cli import options
from landtool_cli.console import Console, pass_console
from landtool_cli.settings import from_file, table_of_file, with_options

SCORE = options.FiniteRange(*DETECTOR_BOUNDS["conf"])


@click.command("eval")
@click.option(
    "--dataset",
    type=options.PATH,
    metavar="DIR",
    help="What to evaluate with: a folder of `landtool generate`, a YOLO or COCO dataset, recordings with their truth "
    "beside them, or a folder of several of these.",
)
@options.output("Folder for the results.  [default: runs/eval]")
@click.option(
    "--model",
    "models",
    type=options.PATH,
    metavar="FILE",
    multiple=True,
    help="An ONNX network, `shipped` is the one in the package; several stand side by side.  [default: shipped]",
)
@click.option("--split", type=click.Choice(SPLITS), help="Which labelled pictures.  [default: auto, test before val]")
@click.option("--stages", metavar="LIST", help=f"What to score, of {', '.join(EVAL_STAGES)}.  [default: all]")
@click.option("--ego/--no-ego", default=None, help="Use the drone's own poses of the clips that have them.")
@click.option("--every", type=click.IntRange(1), metavar="N", help="Show the network every N-th frame.  [default: 1]")
@click.option("--conf", "detector__conf", type=SCORE, metavar="S", help="Least score of a box.  [default: 0.25]")
@click.option("--alarm-conf", type=SCORE, metavar="S", help="Least score of a false alarm.  [default: 0.5]")
@options.camera
@click.option("--scale-intrinsics/--no-scale-intrinsics", default=None, help="Accept a calibration of another size.")
@options.pad
@options.dehaze
@click.option("--baseline", type=options.PATH, metavar="FILE", help="Kept numbers: exit 1 when one has become worse.")
@click.option("--tolerance", type=options.PATH, metavar="FILE", help="How much worse each may become, TOML.")
@click.option("--update-baseline", is_flag=True, help="Write the numbers to --baseline instead of comparing them.")
@click.option("--junit", type=options.PATH, metavar="FILE", help="Also write the outcome as JUnit XML.")
@click.option("--save", metavar="LIST", help=f"Outputs, of {', '.join(EVAL_SAVES)}.  [default: csv]")
@options.config
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    output: Path | None,
    models: tuple[Path, ...],
    update_baseline: bool,
    junit: Path | None,
    config: Path | None,
    overwrite: bool,
    **flags: Any,
) -> int:
    """Score every stage against truth: boxes, poses, track, prediction, dehazing, speed.

    Writes metrics.json, metrics.csv and the errors frame by frame; with --baseline exits with 1 and a table of what
    got worse.
    """
    request = _request(config, flags, models, output, update_baseline, junit, overwrite)
    with console.counter(label=str(request.evaluation.dataset)) as counter:
        outcome = evaluate(request, on_expect=counter.expect, on_picture=counter.add)
    _tell(console, request, outcome)
    return outcome.record.exit_code


def _request(
    config: Path | None,
    flags: dict[str, Any],
    models: tuple[Path, ...],
    output: Path | None,
    update_baseline: bool,
    junit: Path | None,
    overwrite: bool,
) -> EvalRequest:
    """Return what is asked for: the evaluation's own options, all others are those of `landtool track`."""
    settings = from_file(TrackConfig(), config)  # before [eval]: it knows the names of all tables
    own = {name: flags.pop(name) for name in list(flags) if name in EvalConfig.__dataclass_fields__}
    flags["hfov_deg"] = flags.pop("hfov")
    evaluation = with_options(table_of_file(EvalConfig(), config, "eval"), own)
    if evaluation.dataset is None:
        raise UsageError("no dataset to evaluate with", hint="give it with --dataset DIR")
    return EvalRequest(
        evaluation,
        with_options(settings, flags),
        output or Path("runs/eval"),
        tuple(None if path == Path(SHIPPED) and not path.exists() else path for path in models),
        update_baseline=update_baseline,
        junit=junit,
        overwrite=overwrite,
    )


def _tell(console: Console, request: EvalRequest, outcome: EvalOutcome) -> None:
    console.result(f"{request.evaluation.dataset}: {outcome.folder}")
    for line in metric_lines(outcome.record.metrics):
        console.result(f"  {line}")
    if outcome.gate is not None:
        for line in gate_lines(outcome.gate):
            console.result(line)
    if outcome.kept:
        console.result(f"baseline: {request.evaluation.baseline}")
    for note in outcome.record.notes:
        console.warning(note)
