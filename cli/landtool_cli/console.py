"""The only place that prints: results to stdout; progress, logs and errors to stderr."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import click


@dataclass
class Counter:
    """A progress bar, or nothing where none is shown."""

    bar: Any

    def expect(self, total: int | None) -> None:
        """Say how many there will be; None when it is not known."""
        if self.bar is not None:
            self.bar.total = total
            self.bar.refresh()

    def add(self) -> None:
        """Count one more."""
        if self.bar is not None:
            self.bar.update()

    def reach(self, done: int, total: int) -> None:
        """Say how many are done, of how many; those done before the first call take no part in the speed."""
        if self.bar is not None:
            if self.bar.total is None:
                self.bar.reset(total)
                self.bar.initial = self.bar.n = done - 1
            self.bar.update(done - self.bar.n)

    def describe(self, text: str) -> None:
        """Show a short text behind the bar."""
        if self.bar is not None:
            self.bar.set_postfix_str(text, refresh=False)


@dataclass
class Console:
    """What a command says, and how loudly. A command gets it with `@pass_console`.

    verbose and quiet are -v and -q; debug asks for the traceback of an error. `file` is the input being worked on:
    a command sets it so that an error which names no file (out of memory, a bug) still tells where it happened.
    unfinished: what became of the outputs of a run that is stopped.
    """

    verbose: bool = False
    quiet: bool = False
    debug: bool = False
    file: Path | None = None
    unfinished: str = "outputs not finished were removed"
    _bar: Any = None  # the progress bar shown now: a line printed below it would tear it

    def result(self, text: str) -> None:
        """Print a result to stdout; nothing silences it."""
        try:
            click.echo(text)
        except BrokenPipeError:
            raise
        except OSError as error:  # a full disk behind `>`: the system's error names no file
            raise OSError(error.errno, error.strerror, "standard output") from error

    def log(self, text: str) -> None:
        """Tell what is going on, on a terminal or with --verbose."""
        if not self.quiet and (self.verbose or _is_terminal(sys.stderr)):
            self._to_stderr(text)

    def detail(self, text: str) -> None:
        """Tell what only --verbose wants to know."""
        if self.verbose and not self.quiet:
            self._to_stderr(text)

    def warning(self, text: str) -> None:
        """Tell what changes how the results are to be read. Only --quiet silences it."""
        if not self.quiet:
            self._to_stderr(f"landtool: {_colored('warning:', 'yellow')} {_one_line(text)}")

    def error(self, text: str) -> None:
        """Print the one line of an error; nothing silences it."""
        self._to_stderr(f"landtool: {_colored('error:', 'red')} {_one_line(text)}")

    def traceback(self, text: str) -> None:
        """Print a traceback, as --debug asks for."""
        self._to_stderr(text.rstrip())

    @contextmanager
    def counter(self, *, label: str, unit: str = "frame") -> Iterator[Counter]:
        """Show a bar on stderr that is moved by hand; none without a terminal or with --quiet."""
        if self.quiet or not _is_terminal(sys.stderr):
            yield Counter(None)
            return
        from tqdm import tqdm  # not needed by most calls, so not paid for by them

        with tqdm(desc=label, unit=unit, file=sys.stderr, leave=False, dynamic_ncols=True) as bar:
            self._bar = bar
            try:
                yield Counter(bar)
            finally:
                self._bar = None

    def _to_stderr(self, text: str) -> None:
        if self._bar is not None:
            self._bar.clear()
        click.echo(text, err=True)
        if self._bar is not None:
            self._bar.refresh()


pass_console = click.make_pass_decorator(Console, ensure=True)


def _is_terminal(stream: TextIO | None) -> bool:
    try:
        return stream is not None and stream.isatty()
    except ValueError:  # closed
        return False


def _colored(text: str, color: str) -> str:
    """Colour a word on a terminal, unless NO_COLOR (no-color.org) or a dumb terminal forbids it."""
    if not _is_terminal(sys.stderr) or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return text
    return click.style(text, fg=color)


def _one_line(text: str) -> str:
    return " ".join(text.split())
