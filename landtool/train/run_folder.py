"""The folder of a training: what is written when, and how an interrupted one is found again.

Unlike other outputs it grows while the work goes on, so that curves can be watched; each file in it is whole at any
moment. `run.json` comes last: with it the training is finished.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from landtool.errors import OutputExistsError, UsageError
from landtool.io.atomic import atomic_path
from landtool.io.run_record import RUN_FILE

_REQUEST = "training.json"


@dataclass(frozen=True)
class RunFolder:
    """Where everything of a training lies."""

    path: Path

    @property
    def last(self) -> Path:
        """The state after the last step that was saved."""
        return self.path / "weights" / "last.landtool"

    @property
    def best(self) -> Path:
        """The network that scored best."""
        return self.path / "weights" / "best.landtool"

    @property
    def network(self) -> Path:
        """The network's cfg as it was trained."""
        return self.path / "network.cfg"

    @property
    def results(self) -> Path:
        """The table of results."""
        return self.path / "results.csv"

    def write(self, name: str, content: bytes) -> None:
        """Write a file, replacing it whole. Raises OutputError."""
        with atomic_path(self.path / name, overwrite=True) as temporary:
            temporary.write_bytes(content)


def open_run(path: Path, request: dict[str, Any], *, overwrite: bool) -> RunFolder:
    """Return the folder of a training, made if need be; it may hold an unfinished one of the same request.

    Raises OutputExistsError for a finished one or another's files, UsageError for an unfinished one of other settings;
    with `overwrite` what a training left there is removed first.
    """
    folder = RunFolder(path)
    text = json.dumps(request, indent=2, sort_keys=True, default=str) + "\n"
    known = path / _REQUEST
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        if not known.is_file():
            raise (
                OutputExistsError(path)
                if not overwrite
                else UsageError("holds files landtool did not write", file=path, hint="choose another -o or empty it")
            )
        if overwrite:
            _clear(folder)
        elif (path / RUN_FILE).exists():
            raise OutputExistsError(path)
        elif known.read_text(encoding="utf-8") != text:
            hint = "repeat its command to go on with it, choose another -o, or pass --overwrite"
            raise UsageError("holds an unfinished training with other settings", file=path, hint=hint)
    folder.write(_REQUEST, text.encode())
    return folder


def _clear(folder: RunFolder) -> None:
    """Remove a training's own files, run.json first: the folder must not look finished in between."""
    for name in (RUN_FILE, _REQUEST):
        (folder.path / name).unlink(missing_ok=True)
    with ExitStack() as stack:
        for file in (folder.last, folder.best, folder.best.with_suffix(".weights"), folder.network, folder.results):
            stack.callback(file.unlink, missing_ok=True)


def fingerprint(paths: list[Path]) -> str:
    """Return a digest of names and sizes of many files: enough to notice that a data set was changed."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(f"{path}\0{path.stat().st_size}\n".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()
