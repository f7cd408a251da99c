"""Run an iterator ahead of its consumer in one background thread."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from queue import Empty, Queue
from threading import Event, Thread
from typing import TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class _End:
    """The last thing in the queue: the iterator's end, or the exception it ended on."""

    error: BaseException | None = None


def prefetch(items: Iterator[T], depth: int) -> Generator[T, None, None]:
    """Yield the items in order while up to `depth` more are made ready in a background thread.

    An exception of the inner iterator is raised here at its place. When the consumer stops early (closes this
    generator, or raises), the thread ends and the inner iterator is closed before control returns.
    The thread starts with the first item asked for. Close it (`contextlib.closing`) where the consumer may fail: left
    to the garbage collector, the thread goes on reading, and may be the one that collects it.
    """
    if depth < 1:
        raise ValueError(f"depth is {depth}, must be at least 1")
    queue: Queue[T | _End] = Queue(maxsize=depth)
    stop = Event()
    thread = Thread(target=_fill, args=(items, queue, stop), name="landtool-prefetch", daemon=True)
    thread.start()
    try:
        while not isinstance(item := queue.get(), _End):
            yield item
        if item.error is not None:
            raise item.error
    finally:
        stop.set()
        _drain(queue)  # a put that waits for room goes through, and the thread then sees the stop
        thread.join()


def _fill(items: Iterator[T], queue: Queue[T | _End], stop: Event) -> None:
    error: BaseException | None = None
    try:
        for item in items:
            queue.put(item)
            if stop.is_set():
                break
    except BaseException as raised:  # handed over to the consumer's thread
        error = raised
    finally:
        close = getattr(items, "close", None)
        try:
            if close is not None:
                close()
        except BaseException as raised:
            error = error or raised
        if not stop.is_set():
            queue.put(_End(error))


def _drain(queue: Queue[T | _End]) -> None:
    while True:
        try:
            queue.get_nowait()
        except Empty:
            return
