"""run.json: what a run was asked, what it read, with which versions, and how it ended."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from landtool import __version__
from landtool.errors import InputError
from landtool.io.atomic import atomic_path

RUN_FILE = "run.json"
SCHEMA_VERSION = 1
# Packages whose version can change a result, by the short name they have in run.json
_PACKAGES = {
    "numpy": "numpy",
    "opencv": "opencv-contrib-python-headless",
    "av": "av",
    "apriltag": "apriltag-python",
    "mcap": "mcap",
    "onnxruntime": "onnxruntime",
}
_CHUNK = 1 << 20


@dataclass(frozen=True)
class Counts:
    """Frames of a run. declared: by the input's own header, None where it has none; the rest as counted."""

    declared: int | None
    decoded: int
    damaged: int
    lost: int
    skipped: int
    written: int


@dataclass(frozen=True)
class StageTime:
    """Time one stage took. mean_ms: a frame, over the `frames` on which the stage ran."""

    total_s: float = 0.0
    frames: int = 0

    @property
    def mean_ms(self) -> float:
        """Milliseconds a frame; 0 where the stage never ran."""
        return 1e3 * self.total_s / self.frames if self.frames else 0.0

    def add(self, seconds: float) -> StageTime:
        """Return the sum with one more frame."""
        return StageTime(self.total_s + seconds, self.frames + 1)


@dataclass(frozen=True)
class HashedFile:
    """A file or folder that was read, with the SHA-256 of its content."""

    path: str
    sha256: str

    @classmethod
    def of(cls, path: Path) -> HashedFile:
        """Read and hash it. Raises InputError when it cannot be read."""
        return cls(str(path), sha256_of(path))


@dataclass(frozen=True)
class RunRecord:
    """Everything run.json says. config: the resolved options, nested; versions default to what is installed.

    verdict: on a landing, plain values; None where a run judges none.
    """

    command: str
    config: Mapping[str, Any]
    inputs: tuple[HashedFile, ...]
    counts: Counts
    exit_code: int
    model: HashedFile | None = None
    seed: int | None = None
    timings: Mapping[str, StageTime] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    verdict: Mapping[str, Any] | None = None
    versions: Mapping[str, str | None] = field(default_factory=lambda: installed_versions())


def write_run(folder: Path, record: RunRecord, *, overwrite: bool = False) -> Path:
    """Write `record` to run.json in `folder` and return its path; the order of the keys never changes.

    Raises OutputExistsError and OutputError as `atomic_path` does.
    """
    values = {f.name: getattr(record, f.name) for f in fields(record)}
    values["timings"] = {
        stage: {"total_s": time.total_s, "mean_ms": time.mean_ms, "frames": time.frames}
        for stage, time in record.timings.items()
    }
    text = json.dumps({"schema_version": SCHEMA_VERSION, **plain(values)}, indent=2, allow_nan=False)
    path = folder / RUN_FILE
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return path


def provenance(command: str, config: Mapping[str, Any], inputs: Sequence[HashedFile]) -> dict[str, str]:
    """Return what a file that leaves its folder says of its making; settings and inputs are JSON."""
    return {
        "command": command,
        "config": json.dumps(plain(config), allow_nan=False),
        "inputs": json.dumps(plain(list(inputs))),
    }


def installed_versions() -> dict[str, str | None]:
    """Return the versions of Python and of the packages that make the results; None where one is not installed."""
    versions: dict[str, str | None] = {"landtool": __version__, "python": platform.python_version()}
    for name, package in _PACKAGES.items():
        try:
            versions[name] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[name] = None
    return versions


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, or of a folder's: of the names and digests of all files in it, sorted.

    Raises InputError when something cannot be read.
    """
    try:
        if not path.is_dir():
            return _file_digest(path)
        digest = hashlib.sha256()
        for name in sorted(p.relative_to(path).as_posix() for p in path.rglob("*") if p.is_file()):
            # a name cannot hold a NUL, so two folders never give the same bytes
            digest.update(name.encode("utf-8", "surrogateescape") + b"\0" + _file_digest(path / name).encode() + b"\n")
        return digest.hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path, hint="check its permissions") from error


def _file_digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def plain(value: Any) -> Any:
    """Turn a value into what JSON has; numbers that are not finite become null, everything strange its text."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        items = sorted(value, key=str) if isinstance(value, set | frozenset) else value
        return [plain(item) for item in items]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    return str(value)
