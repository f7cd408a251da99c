"""`landtool export`: a trained network as ONNX, held against the original, or as darknet's own files."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import click

from landtool.errors import UsageError
from landtool.export.parity import Forward
from landtool.export.source import Trained, read_trained
from landtool.export.write import Exported, ExportRequest, write_darknet, write_onnx
from landtool_cli import options
from landtool_cli.console import Console, pass_console

SUFFIXES = (".onnx", ".weights")


@click.command("export")
@click.argument("model", metavar="MODEL", type=options.PATH)
@options.output("What to write, by its ending: .onnx, or .weights with a .cfg and .names beside it.", required=True)
@click.option("--cfg", type=options.PATH, metavar="FILE", help="Of a .weights.  [default: the .cfg beside it]")
@click.option("--names", type=options.PATH, metavar="FILE", help="A class a line.  [default: what MODEL says]")
@click.option("--size", type=options.size_px, metavar="WxH", help="Size of the input, pixels.  [default: the cfg's]")
@click.option("--int8", is_flag=True, help="Compute in eight bits: over twice as fast, a quarter of the size.")
@click.option(
    "--calibration",
    type=options.PATH,
    metavar="DIR|data.yaml",
    help="Pictures like those it will see, by which --int8 chooses its scales.",
)
@click.option("--val", type=options.PATH, metavar="data.yaml", help="Labelled pictures that tell what rounding costs.")
@click.option(
    "--storage",
    type=click.Choice(["float32", "float16", "int8"]),
    default="float32",
    show_default=True,
    help="How the kernels are kept in the file of a network that computes in float32.",
)
@options.overwrite
@pass_console
def command(
    console: Console,
    /,
    model: Path,
    output: Path,
    cfg: Path | None,
    names: Path | None,
    overwrite: bool,
    **flags: Any,
) -> None:
    """Write a trained network as ONNX or as darknet's own files.

    MODEL is a checkpoint of `landtool train`, or darknet .weights with their .cfg and .names. An ONNX is compared with
    the original over 20 pictures first; nothing is written unless they agree.
    """
    suffix = output.suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError("unknown kind of output", file=output, hint=f"use one of {', '.join(SUFFIXES)}")
    console.file = model
    trained, request = read_trained(model, cfg, names), ExportRequest(**flags)
    if suffix == ".weights":
        done = write_darknet(output, trained, request, overwrite=overwrite)
    else:
        others = _in_torch(trained)
        done = write_onnx(output, trained, request, overwrite=overwrite, others=others, report=console.log)
    _tell(console, done)


def _in_torch(trained: Trained) -> dict[str, Forward]:
    """Return the network in torch, where that is installed."""
    if importlib.util.find_spec("torch") is None:
        return {}
    from landtool.train.reference import torch_heads  # loads torch

    return {"torch": torch_heads(trained.network, trained.weights)}


def _tell(console: Console, done: Exported) -> None:
    console.result(f"{done.files[-1]}: {done.size_bytes / 1e6:.1f} MB")
    for file in done.files[:-1]:
        console.result(f"  {file}")
    if done.parities:
        console.result("  reference  pictures  raw      score    boxes  box")
    for parity in done.parities:
        console.result(
            f"  {parity.reference:<9}  {parity.pictures:>8}  {parity.raw:<7.1e}  {parity.score:<7.1e}  "
            f"{parity.boxes:>5}  {parity.box_px:.4f} px"
        )
    if done.accuracy is not None:
        accuracy = done.accuracy
        console.result(f"  {accuracy.pictures} validation pictures  mAP50   mAP50-95")
        console.result(f"  float32  {accuracy.exact_map50:.4f}  {accuracy.exact_map50_95:.4f}")
        console.result(f"  rounded  {accuracy.rounded_map50:.4f}  {accuracy.rounded_map50_95:.4f}")
