"""What is open for as long as a context: it unwinds at its end, and when opening fails half-way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import ExitStack
from types import TracebackType
from typing import Self


class Managed(ABC):
    """A context: what `_open` enters into the stack ends with it. `_stack` takes what is opened later."""

    def __init__(self) -> None:
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._open(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._stack.__exit__(kind, error, tb)

    @abstractmethod
    def _open(self, stack: ExitStack) -> None:
        """Open what is written to, and leave its closing to `stack`, so that a bad place fails before the work."""
