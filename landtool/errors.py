"""The errors landtool raises on purpose, with the exit code each one maps to."""

from __future__ import annotations

from os import PathLike


class LandtoolError(Exception):
    """Root of all errors a user can cause or cure.

    `str(error)` reads `<file>: <reason>; <what to do>`, the parts that are known.
    """

    exit_code = 1

    def __init__(self, reason: str, *, file: str | PathLike[str] | None = None, hint: str = "") -> None:
        self.reason = reason
        self.file = None if file is None else str(file)
        self.hint = hint
        text = reason if self.file is None else f"{self.file}: {reason}"
        super().__init__(f"{text}; {hint}" if hint else text)


class InputError(LandtoolError):
    """An input's content cannot be used: broken, empty, or of another kind than it says."""


class OutputError(LandtoolError):
    """An output could not be written."""


class UsageError(LandtoolError):
    """The request itself must change: a wrong path, option, key, or an output in the way."""

    exit_code = 2


class OutputExistsError(UsageError):
    """An output is there already and overwriting was not asked for."""

    def __init__(self, file: str | PathLike[str]) -> None:
        super().__init__("exists already", file=file, hint="choose another -o or pass --overwrite")
