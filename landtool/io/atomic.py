"""Outputs that appear whole or not at all.

Everything is written under a temporary name beside its target, `.landtool-` and eight hexadecimal digits, flushed to
the disk and then renamed. A run that was killed outright may leave such a name behind; it is safe to delete. So is
`.landtool-resume-`, in which long work waits to be finished by a run that asks for the same.
"""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from landtool.errors import OutputError, OutputExistsError, UsageError

try:
    import fcntl
except ImportError:  # Windows, where two runs of the same are not told apart
    fcntl = None  # type: ignore[assignment]

TEMPORARY_PREFIX = ".landtool-"
RESUME_PREFIX = f"{TEMPORARY_PREFIX}resume-"

# Tells whether all names in a folder are landtool's own
NamesCheck = Callable[[set[str]], bool]
# What a folder is that holds the file; an evaluation has runs in it, so it comes first
_MARKS = {
    "metrics.json": "an evaluation (metrics.json)",
    "run.json": "a run of landtool (run.json)",
    "manifest.json": "a generated dataset (manifest.json)",
}
# What the user can do about a write that failed
_HINTS = {
    errno.ENOSPC: "free some space or choose another -o",
    errno.EDQUOT: "free some of your quota or choose another -o",
    errno.EFBIG: "the file system or a limit forbids files of this size; choose another -o",
    errno.EROFS: "choose another -o on a writable file system",
    errno.EACCES: "change the folder's permissions or choose another -o",
    errno.EPERM: "change the folder's permissions or choose another -o",
    errno.ENOTDIR: "a part of the path is a file; choose another -o",
    errno.EEXIST: "a part of the path is a file; choose another -o",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ELOOP: "a part of the path is a link to itself; choose another -o",
}
# Only a write fails with these, so they need no file name to tell whose error it is
_ONLY_WRITES = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}


@contextmanager
def atomic_path(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary path of the same suffix; when the block ends well it is renamed to `path`.

    The temporary file exists and is empty when the block starts, so a place that cannot be written fails before the
    work. Missing parents are created. Any exception, KeyboardInterrupt too, removes what was written.

    Raises OutputExistsError when `path` exists and `overwrite` is false, UsageError when it is a folder or a device,
    OutputError when the disk is full, read-only or forbidden.
    """
    _refuse_target(path, overwrite)
    temporary = _temporary(path)
    with _output_errors(path, temporary), _reserved(temporary, _create_file):
        yield temporary
        _sync(temporary)
        _refuse_target(path, overwrite)  # another run may have finished meanwhile
        temporary.replace(path)
        _sync(path.parent)


@contextmanager
def atomic_folder(path: Path, *, overwrite: bool = False, mark: str | NamesCheck = "run.json") -> Iterator[Path]:
    """Yield a temporary folder; when the block ends well it is renamed to `path`, whole.

    An empty folder counts as free. With `overwrite` an existing folder is replaced when it is landtool's own: it holds
    the file `mark`, or `mark` says so of the names in it. Any exception removes what was written and leaves an old
    folder as it was.

    Raises OutputExistsError when `path` is taken and `overwrite` is false, UsageError when it is a file, the current
    folder or holds what another command or somebody else wrote, OutputError when it cannot be written.
    """
    target = _real(path)  # a link to a folder stays a link
    _refuse_folder(path, target, overwrite, mark)
    temporary = _temporary(target)
    with _output_errors(path, temporary), _reserved(temporary, Path.mkdir):
        yield temporary
        _sync_tree(temporary)
        _refuse_folder(path, target, overwrite, mark)
        _swap_folder(temporary, target)
        _sync(target.parent)


@dataclass(frozen=True)
class Unfinished:
    """Work that outlives an interruption. whole: becomes the output. notes: what is done so far; thrown away then."""

    whole: Path
    notes: Path


@contextmanager
def resumable_folder(path: Path, request: str, *, overwrite: bool = False, mark: str) -> Iterator[Unfinished]:
    """Yield folders that stay when the block fails; when it ends well, `whole` is renamed to `path`.

    request: all that the content depends on. The next call for the same path and request finds what this one left,
    any other call does not. Nothing stays when nothing was written. Refuses and raises as `atomic_folder` does, and
    UsageError when another run is busy with the same.
    """
    target = _real(path)
    _refuse_folder(path, target, overwrite, mark)
    digest = hashlib.sha256(f"{target.name}\n{request}".encode("utf-8", "surrogateescape")).hexdigest()
    work = target.parent / f"{RESUME_PREFIX}{digest[:12]}"
    unfinished = Unfinished(work / "whole", work / "notes")
    advice = "; the same call goes on where this one stopped"
    with _output_errors(path, work, advice=advice), _locked(work, path), _kept_if_used(unfinished):
        yield unfinished
        _sync_tree(unfinished.whole)
        _refuse_folder(path, target, overwrite, mark)
        _swap_folder(unfinished.whole, target)
        _sync(target.parent)


def refuse_input_as_output(inputs: Iterable[Path], output: Path) -> None:
    """Raise UsageError when `output` is one of the inputs, holds one or lies in one; links are followed."""
    place = _real(output)
    for item in inputs:
        source = _real(item)
        same = source == place or (output.exists() and item.exists() and item.samefile(output))
        if same:
            raise UsageError("is the input itself, which is never changed", file=output, hint="choose another -o")
        if place in source.parents:
            raise UsageError(f"holds the input {item}", file=output, hint="choose another -o")
        if source in place.parents:
            raise UsageError(f"lies in the input {item}", file=output, hint="choose an -o outside of it")


@contextmanager
def _output_errors(path: Path, temporary: Path, *, advice: str = "") -> Iterator[None]:
    """Turn the OSErrors of writing `path` into OutputError; others, as of a reader, pass. advice: ends the hint."""
    try:
        yield
    except OutputError as error:
        if error.file is None or not Path(error.file).is_relative_to(temporary):
            raise
        # this file, or one of this folder: name it as it would have been called
        named_file = path / Path(error.file).relative_to(temporary)
        raise OutputError(error.reason, file=named_file, hint=error.hint) from error
    except OSError as error:
        folder = os.path.realpath(path.parent)
        named = isinstance(error.filename, str | os.PathLike) and _is_ours(str(error.filename), folder)
        if not named and error.errno not in _ONLY_WRITES:
            raise
        reason = f"cannot be written: {error.strerror or error}"
        hint = _HINTS.get(error.errno or 0, "choose another -o") + (advice if temporary.exists() else "")
        raise OutputError(reason, file=path, hint=hint) from error


def _real(path: Path) -> Path:
    """Follow links; unlike Path.resolve without failing on one that leads to itself."""
    return Path(os.path.realpath(path))


def _is_ours(name: str, folder: str) -> bool:
    """Whether `name` is a temporary name, something in one, or a part of the path to `folder`."""
    place = os.path.realpath(name)
    return TEMPORARY_PREFIX in place or place == folder or folder.startswith(place + os.sep)


def _temporary(path: Path) -> Path:
    return path.parent / f"{TEMPORARY_PREFIX}{secrets.token_hex(4)}{path.suffix}"


@contextmanager
def _reserved(temporary: Path, create: Callable[[Path], None]) -> Iterator[None]:
    """Create a temporary file or folder and its missing parents; remove on failure whatever is left of them."""
    new_parents = [parent for parent in temporary.parents if not parent.exists()]
    try:
        temporary.parent.mkdir(parents=True, exist_ok=True)
        create(temporary)
        yield
    except BaseException:
        _remove(temporary)
        for parent in new_parents:
            with suppress(OSError):  # not empty: somebody else uses it by now
                parent.rmdir()
        raise


@contextmanager
def _locked(work: Path, path: Path) -> Iterator[None]:
    """Make the folder and hold a lock on it, which a killed process loses; remove it at the end if it is empty."""
    new = [folder for folder in (work, *work.parents) if not folder.exists()]
    work.mkdir(parents=True, exist_ok=True)
    handle = None if fcntl is None else os.open(work, os.O_RDONLY)
    try:
        if handle is not None and not _lock(handle):
            raise UsageError("another run is writing the same", file=path, hint="wait for it or stop it")
        yield
    finally:
        with suppress(OSError):  # not empty: kept for the next run
            for folder in new or [work]:
                folder.rmdir()
        if handle is not None:
            os.close(handle)


def _lock(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def _kept_if_used(unfinished: Unfinished) -> Iterator[None]:
    """Make the folders; remove them at the end, but not when the block fails with files in them."""
    folders = unfinished.whole, unfinished.notes
    try:
        for folder in folders:
            folder.mkdir(exist_ok=True)
        yield
    except BaseException:
        if any(path.is_file() for folder in folders for path in folder.rglob("*")):
            raise
        for folder in folders:
            _remove(folder)
        raise
    for folder in folders:
        _remove(folder)


def _create_file(path: Path) -> None:
    path.touch(exist_ok=False)


def _refuse_target(path: Path, overwrite: bool) -> None:
    if path.is_dir():
        raise UsageError("is a folder, a file is to be written", file=path, hint="choose another -o")
    if path.exists() and not path.is_file():
        raise UsageError("is no regular file", file=path, hint="choose another -o")
    if os.path.lexists(path) and not overwrite:
        raise OutputExistsError(path)


def _refuse_folder(path: Path, target: Path, overwrite: bool, mark: str | NamesCheck) -> None:
    if not os.path.lexists(target):
        return
    if not target.is_dir():
        raise UsageError("is a file, a folder is to be written", file=path, hint="choose another -o")
    here = Path.cwd()
    if target == here or target in here.parents:
        where = "is" if target == here else "holds"
        reason = f"{where} the current folder, which cannot be replaced"
        raise UsageError(reason, file=path, hint="name a new folder with -o")
    try:
        names = {entry.name for entry in target.iterdir()}
    except OSError as error:
        raise OutputError(f"cannot be read: {error.strerror}", file=path, hint="choose another -o") from error
    if names and not overwrite:
        raise OutputExistsError(path)
    if names and not (mark in names if isinstance(mark, str) else mark(names)):
        raise UsageError(_foreign(target), file=path, hint="choose another -o or empty it")


def _foreign(folder: Path) -> str:
    """Return what a folder holds that is not to be replaced: what another command wrote, or other files."""
    found = next((kind for mark, kind in _MARKS.items() if (folder / mark).is_file()), None)
    return f"holds {found}, which this command does not replace" if found else "holds files landtool did not write"


def _swap_folder(temporary: Path, target: Path) -> None:
    """Rename `temporary` to `target`; an old folder is moved aside first and back if that fails."""
    aside = target.parent / f"{TEMPORARY_PREFIX}{secrets.token_hex(4)}"
    had_old = target.exists()
    if had_old:
        target.rename(aside)
    try:
        temporary.rename(target)
    except BaseException:
        if had_old:
            aside.rename(target)
        raise
    if had_old:
        shutil.rmtree(aside, ignore_errors=True)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _sync_tree(folder: Path) -> None:
    for root, _, files in os.walk(folder):
        for name in files:
            _sync(Path(root, name))
        _sync(Path(root))


def _sync(path: Path) -> None:
    """Flush a file or folder to the disk."""
    if path.is_dir() and os.name != "posix":
        return  # only POSIX opens folders
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems cannot
            raise
    finally:
        os.close(handle)
