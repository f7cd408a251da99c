"""`landtool info`: what inputs are, and what a run still needs for them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from landtool import __version__
from landtool.errors import LandtoolError, UsageError
from landtool.inspect import Facts, Request, inspect
from landtool.inspect.text import as_text, as_values
from landtool.pad import PadSpec
from landtool.types import Frame, LostFrame
from landtool_cli import options
from landtool_cli.batch import LOSS, batch_exit_code
from landtool_cli.console import Console, pass_console


@click.command("info")
@options.inputs
@click.option("--scan", is_flag=True, help="Decode every picture: tells what is damaged or lost.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of text.")
@options.camera
@click.option("--camera-name", metavar="NAME", help="Which camera of a Kalibr camchain.")
@click.option("--size", metavar="WxH", help="Picture size that --hfov is for, when INPUT is a pad.")
@options.pad
@options.topic
@options.fps
@pass_console
def command(
    console: Console,
    /,
    inputs: tuple[Path, ...],
    as_json: bool,
    pad: Path | None,
    size: str | None,
    hfov: float | None,
    **rest: Any,
) -> int:
    """Tell what recordings, calibrations, pads and the other files of a run hold.

    Videos, folders of images, MCAP logs; camera, pad, mount, pose and settings files. The last lines of each say how
    to track it, and what is missing for that. With --camera or --hfov: from how far the pad's tags can be read.
    """
    if rest["camera"] and hfov:
        raise UsageError("--camera and --hfov exclude each other", hint="keep the calibration file")
    target = PadSpec.read(pad) if pad else PadSpec()
    request = Request(pad=target, pad_file=pad, hfov_deg=hfov, size=_pixels(size), **rest)
    failures: list[LandtoolError] = []
    documents: list[dict[str, Any]] = []
    codes: list[int] = []
    for path in inputs:
        console.file = path
        try:
            facts = _inspect(console, path, request)
        except LandtoolError as error:
            if len(inputs) == 1 and not as_json:
                raise
            console.error(str(error))
            failures.append(error)
            documents.append({"path": str(path), "error": _plain(error)})
            continue
        codes.append(LOSS if facts.damaged else 0)
        documents.append(as_values(facts))
        if not as_json:
            _print(console, facts, first=len(codes) == 1)
    if as_json:
        console.result(json.dumps({"landtool": __version__, "inputs": documents}, indent=2, allow_nan=False))
    return batch_exit_code(codes, failures)


def _inspect(console: Console, path: Path, request: Request) -> Facts:
    """Inspect one input, with a progress bar while its pictures are decoded."""
    if not request.scan:
        return inspect(path, request)
    with console.counter(label=path.name) as counter:

        def watch(frames: Iterable[Frame | LostFrame], total: int | None) -> Iterator[Frame | LostFrame]:
            counter.expect(total)
            for frame in frames:
                counter.add()
                yield frame

        return inspect(path, replace(request, watch=watch))


def _pixels(size: str | None) -> tuple[int, int] | None:
    found = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", size or "")
    if size is not None and not found:
        raise UsageError(f"--size '{size}' is no picture size", hint="give it as 640x480")
    return (int(found[1]), int(found[2])) if found else None


def _print(console: Console, facts: Facts, *, first: bool) -> None:
    console.result(as_text(facts) if first else f"\n{as_text(facts)}")


def _plain(error: LandtoolError) -> dict[str, Any]:
    return {"reason": error.reason, "hint": error.hint, "file": error.file, "exit_code": error.exit_code}
