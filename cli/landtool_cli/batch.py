"""Several recordings in one call: their folders, what is said of each, and the exit code of them all."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from landtool.errors import LandtoolError, OutputExistsError, UsageError
from landtool.io.atomic import refuse_input_as_output
from landtool_cli.console import Console
from landtool_cli.explain import explain

if TYPE_CHECKING:
    from landtool.io.source import SourceInfo
    from landtool.run.recording import OnFrame, RunOutcome

LOSS = 3  # finished, with loss or with some inputs failed


def output_folders(
    inputs: Sequence[Path], output: Path, *, overwrite: bool, also_read: Sequence[Path] = ()
) -> list[Path]:
    """Return the folder of each input: `output/<the input's stem>`.

    also_read: other files the command reads, which no output may replace either.
    Raises UsageError when two inputs would share a folder or one holds a file that is read, OutputExistsError for one
    that is there, before any work.
    """
    if output.exists() and not output.is_dir():
        raise UsageError("is no folder", file=output, hint="choose another -o")
    # made absolute for the names of `.` and `..`; a link keeps its own name
    folders = [output / (Path(os.path.abspath(path)).stem or "root") for path in inputs]  # noqa: PTH100
    for index, folder in enumerate(folders):
        refuse_input_as_output([*inputs, *also_read], folder)
        if folder in folders[:index]:
            first = inputs[folders.index(folder)]
            raise UsageError(f"would write to the same folder as {first}", file=inputs[index], hint="run them apart")
        if not overwrite and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise OutputExistsError(folder)
    return folders


def batch_exit_code(codes: Sequence[int], failures: Sequence[LandtoolError]) -> int:
    """Return 0 when all went well, 3 with loss or some failures, the errors' own code when all inputs failed."""
    if failures and not codes:
        return max(error.exit_code for error in failures)
    return LOSS if failures else max(codes, default=0)


class Run(Protocol):
    """Runs one recording into its folder, telling how far it is."""

    def __call__(
        self, path: Path, folder: Path, *, on_start: Callable[[SourceInfo], None], on_frame: OnFrame
    ) -> RunOutcome:
        """Return what became of it."""
        ...


def run_all(console: Console, inputs: Sequence[Path], folders: Sequence[Path], run: Run) -> int:
    """Run every recording, say what came out, and return the exit code; one that fails does not cost the others."""
    failures: list[LandtoolError] = []
    codes: list[int] = []
    for path, folder in zip(inputs, folders, strict=True):
        console.file = path
        try:
            outcome = _run_one(console, path, folder, run)
        except Exception as error:  # whatever it is, it must not cost the other inputs
            if len(inputs) == 1:
                raise
            text, _ = explain(error, console)
            console.error(text)
            failures.append(error if isinstance(error, LandtoolError) else LandtoolError(text))
            continue
        codes.append(outcome.exit_code)
        _tell(console, path, outcome)
    return batch_exit_code(codes, failures)


def _run_one(console: Console, path: Path, folder: Path, run: Run) -> RunOutcome:
    with console.counter(label=path.name) as counter:
        return run(
            path,
            folder,
            on_start=lambda info: counter.expect(info.frames_declared),
            on_frame=lambda _frame, _result: counter.add(),
        )


def _tell(console: Console, path: Path, outcome: RunOutcome) -> None:
    counts = outcome.counts
    console.result(f"{path}: {outcome.folder}")
    for line in outcome.summary.lines():
        console.result(f"  {line}")
    console.result(f"  {outcome.summary.frames / outcome.wall_s:.0f} frames/s over {outcome.wall_s:.1f} s")
    if counts.damaged or counts.lost:
        console.warning(f"{path}: damaged {counts.damaged}, lost {counts.lost}, of {outcome.summary.frames} frames")
    for note in outcome.notes:
        console.warning(f"{path}: {note}")
