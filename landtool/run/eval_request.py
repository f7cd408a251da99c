"""What is asked of an evaluation, and what is wrong with it before the work begins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from landtool.config import EvalConfig, TrackConfig
from landtool.errors import LandtoolError, UsageError
from landtool.evaluate import junit
from landtool.evaluate.baseline import refuse_other_file
from landtool.evaluate.tolerance import read_tolerance
from landtool.io.atomic import atomic_path
from landtool.io.local import local_file


@dataclass(frozen=True)
class EvalRequest:
    """What is to be evaluated. junit: where to write that, too.

    models: ONNX files, None for the network in the package; without any the settings' own.
    """

    evaluation: EvalConfig
    config: TrackConfig
    folder: Path
    models: tuple[Path | None, ...] = ()
    update_baseline: bool = False
    junit: Path | None = None
    overwrite: bool = False


def files_of(request: EvalRequest) -> list[Path]:
    """Return the other files that are asked for by name and read, none of which an output may replace."""
    evaluation, config = request.evaluation, request.config
    named = config.camera, config.pad, config.mount, evaluation.baseline, evaluation.tolerance, *request.models
    return [path for path in named if path is not None]


def refuse_impossible(request: EvalRequest) -> None:
    """Raise UsageError, InputError or OutputError for what would fail only when the work is done.

    Those are options that exclude each other, files that are not there, a tolerance file that is wrong, and places
    that cannot be written.
    """
    evaluation, config = request.evaluation, request.config
    if evaluation.baseline is None and evaluation.tolerance is not None:
        raise UsageError("a tolerance, but no numbers to compare with", hint="give them with --baseline FILE")
    if evaluation.baseline is None and request.update_baseline:
        raise UsageError("no baseline to update", hint="say where it is with --baseline FILE")
    if evaluation.baseline is not None and len(request.models) > 1:
        raise UsageError("a baseline is about one network", hint="give --model once, or leave out --baseline")
    for path in (config.camera, config.pad, config.mount):
        if path is not None:
            local_file(path)
    read_tolerance(evaluation.tolerance)
    if request.update_baseline and evaluation.baseline is not None:
        refuse_other_file(evaluation.baseline)
        _refuse_place(evaluation.baseline, "--baseline")
    if request.junit is not None:
        if evaluation.baseline is not None and request.junit.absolute() == evaluation.baseline.absolute():
            raise UsageError("is the baseline, too", file=request.junit, hint="choose another --junit")
        junit.refuse_other_file(request.junit)
        _refuse_place(request.junit, "--junit")


class _Tried(Exception):  # noqa: N818 (no error, but the way out)
    """A place can be written."""


def _refuse_place(path: Path, option: str) -> None:
    """Raise UsageError or OutputError for a place that no file can be written to, which stays as it is."""
    try:
        with atomic_path(path, overwrite=True):
            raise _Tried  # what has been made so far, folders too, is removed
    except _Tried:
        return
    except LandtoolError as error:
        raise type(error)(error.reason, file=error.file, hint=error.hint.replace("-o", option)) from error
