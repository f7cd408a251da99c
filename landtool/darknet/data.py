"""Read and write darknet's .data, which names the files of a data set, and .names, the classes' names line by line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from landtool.darknet.section import line_error, only_section
from landtool.errors import InputError, UsageError
from landtool.io.atomic import atomic_path
from landtool.io.labels import YoloDataset
from landtool.io.local import local_file

_MOST_BYTES = 1 << 20
_MOST_LIST_BYTES = 1 << 28  # a list of a million pictures
_HINT = "give a darknet .data file"
_HARMLESS = frozenset(("eval", "results", "top"))  # keys that only darknet's own scoring reads


@dataclass(frozen=True)
class DataFile:
    """What a .data file says. train, valid: lists of pictures. backup: where darknet writes weights; may be empty.

    Paths are as the file has them. text: the file itself.
    """

    classes: int
    train: str
    valid: str
    names: str
    backup: str
    text: str


@dataclass(frozen=True)
class NamesFile:
    """The classes' names, by class id. text: the file itself."""

    names: tuple[str, ...]
    text: str


def data_text(classes: int, *, train: str, valid: str, names: str, backup: str) -> str:
    """Return the text of a new .data file."""
    return f"classes = {classes}\ntrain = {train}\nvalid = {valid}\nnames = {names}\nbackup = {backup}\n"


def names_text(names: Sequence[str]) -> str:
    """Return the text of a new .names file."""
    return "".join(f"{name}\n" for name in names)


def parse_data(text: str) -> DataFile:
    """Return what the text of a .data file says. Raises InputError naming the line of what is wrong."""
    section = only_section(text, "data")
    data = DataFile(
        section.whole("classes", None, 1, 10000),
        section.text("train"),
        section.text("valid"),
        section.text("names"),
        section.text("backup", ""),
        text,
    )
    for key in ("train", "valid", "names"):
        if not section.text(key):
            raise line_error(section.line_of(key), f"{key} names no file")
    section.refuse_rest(_HARMLESS)
    return data


def parse_names(text: str) -> NamesFile:
    """Return the names of a .names file's text; empty lines at its end count for none."""
    names = [line.strip() for line in text.removeprefix("\ufeff").rstrip().splitlines()]
    for number, name in enumerate(names, start=1):
        if not name:
            raise line_error(number, "is empty where a class's name belongs")
    if not names:
        raise InputError("holds no name")
    return NamesFile(tuple(names), text)


def read_data(path: Path) -> DataFile:
    """Read a .data file. Raises UsageError when it cannot be opened, InputError naming the line of what is wrong."""
    try:
        return parse_data(_text(path, _MOST_BYTES))
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint or _HINT) from error


def read_names(path: Path, classes: int) -> NamesFile:
    """Read a .names file. Raises UsageError when it cannot be opened, InputError when it has not a name a class."""
    try:
        names = parse_names(_text(path, _MOST_BYTES))
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint or "give a file with a name a line") from error
    if len(names.names) != classes:
        reason = f"holds {_counted(len(names.names), 'name')} for {_counted(classes, 'class', 'classes')}"
        raise InputError(reason, file=path, hint="give one line a class")
    return names


def write_data(path: Path, data: DataFile, *, overwrite: bool = False) -> None:
    """Write a .data file, byte for byte as it was read. Raises OutputError, OutputExistsError."""
    _write(path, data.text, overwrite)


def write_names(path: Path, names: NamesFile, *, overwrite: bool = False) -> None:
    """Write a .names file, byte for byte as it was read. Raises OutputError, OutputExistsError."""
    _write(path, names.text, overwrite)


def read_darknet_dataset(path: Path) -> YoloDataset:
    """Read the data set a .data file names, its `valid` as the split "val"; labels are read by `YoloDataset.read`.

    A relative path, in a list of pictures too, is one from the .data file's folder, or, where there is none of that
    name, from the current folder, as darknet has it.
    Raises UsageError when the .data file cannot be opened, InputError for everything else that is wrong.
    """
    data = read_data(path)
    try:
        names = read_names(_place(path, data.names), data.classes).names
        splits = {"train": _pictures(path, data.train), "val": _pictures(path, data.valid)}
    except UsageError as error:  # the .data file names it, not the command line
        raise InputError(f"{error.file}: {error.reason}", file=path, hint=error.hint) from error
    return YoloDataset(path, names, splits)


def _pictures(data: Path, listed: str) -> tuple[Path, ...]:
    file = _place(data, listed)
    lines = [line.strip() for line in _text(file, _MOST_LIST_BYTES).removeprefix("\ufeff").splitlines()]
    pictures = tuple(_place(data, line) for line in lines if line)
    if not pictures:
        raise InputError("names no picture", file=file, hint="it is a list of pictures, one a line")
    return pictures


def _place(data: Path, name: str) -> Path:
    near = data.parent / name
    return Path(name) if not near.exists() and Path(name).exists() else near


def _text(path: Path, most_bytes: int) -> str:
    """Return a file's text, its byte order mark too."""
    try:
        with local_file(path).open("rb") as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path) from error
    if len(data) > most_bytes:
        raise InputError("is far too long", file=path)
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise InputError("is no text", file=path) from error


def _write(path: Path, text: str, overwrite: bool) -> None:
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(text.encode())


def _counted(count: int, one: str, more: str = "") -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"
