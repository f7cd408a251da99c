"""Several inputs in one call: their folders, and the exit code of them all."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from landtool.errors import LandtoolError, OutputExistsError, UsageError
from landtool.io.atomic import refuse_input_as_output

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
