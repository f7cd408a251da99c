"""What the user is told of an error, and the exit code it means."""

from __future__ import annotations

import errno

import click

from landtool.errors import LandtoolError
from landtool_cli.console import Console

# What the user can do about an operating system's refusal
_OS_HINTS = {
    errno.ENOSPC: "free some space or choose another output",
    errno.EDQUOT: "free some of your quota or choose another output",
    errno.EACCES: "check the permissions",
    errno.EPERM: "check the permissions",
    errno.EROFS: "choose a place that can be written",
    errno.ENOENT: "check the path",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
}


def explain(error: BaseException, console: Console) -> tuple[str, int]:
    """Return the line and the exit code of any error: the one place where they are decided."""
    if isinstance(error, LandtoolError):
        return str(error), error.exit_code
    if isinstance(error, click.ClickException):
        return _click_text(error), error.exit_code
    place = f"{console.file}: " if console.file else ""
    if isinstance(error, MemoryError):
        return f"{place}out of memory; close other programs or use a smaller input", 1
    if isinstance(error, OSError) and (error.filename or error.errno in _OS_HINTS):
        name = f"{error.filename}: " if error.filename else place
        hint = _OS_HINTS.get(error.errno or 0, "check the file and its place")
        return f"{name}{error.strerror or error}; {hint}", 1
    detail = f"{type(error).__name__}: {error}".rstrip(": ")
    advice = "please report it with this traceback" if console.debug else "run again with --debug to see where"
    return f"{place}internal error: {detail}; {advice}", 1


def _click_text(error: click.ClickException) -> str:
    """Return click's message as `reason; what to do`."""
    if isinstance(error, click.NoSuchOption):
        reason = f"no such option '{error.option_name}'"
        if error.possibilities:
            return f"{reason}; did you mean {' or '.join(error.possibilities)}?"
    else:
        message = " ".join(error.format_message().split()).rstrip(".")
        reason = message[:1].lower() + message[1:]
    context = error.ctx if isinstance(error, click.UsageError) else None
    return f"{reason}; see '{context.command_path if context else 'landtool'} --help'"
