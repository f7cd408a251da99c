from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from landtool.io.prefetch import prefetch

WAIT_S = 10.0  # far beyond what any step takes; only a failing test waits this long


def _threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name == "landtool-prefetch"]


@pytest.mark.parametrize("depth", [1, 2, 100])
def test_order_is_kept(depth: int) -> None:
    assert list(prefetch(iter(range(50)), depth)) == list(range(50))
    assert _threads() == []


def test_nothing_in_nothing_out() -> None:
    assert list(prefetch(iter(()), 1)) == []


def test_an_exception_comes_at_its_place() -> None:
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise KeyError("third")

    ahead = prefetch(items(), 4)
    assert [next(ahead), next(ahead)] == [1, 2]
    with pytest.raises(KeyError, match="third"):
        next(ahead)
    assert _threads() == []


def test_it_runs_ahead_but_no_further_than_depth() -> None:
    made: list[int] = []
    third = threading.Event()

    def items() -> Iterator[int]:
        for index in range(100):
            made.append(index)
            if index == 3:
                third.set()
            yield index

    ahead = prefetch(items(), 2)
    assert next(ahead) == 0
    # with item 0 taken, 1 and 2 fill the queue and 3 waits in hand
    assert third.wait(WAIT_S)
    assert made == [0, 1, 2, 3]
    ahead.close()  # type: ignore[attr-defined]


def test_closing_early_stops_the_thread_and_closes_the_inner_iterator() -> None:
    closed = threading.Event()

    def items() -> Iterator[int]:
        try:
            yield from range(1_000_000)
        finally:
            closed.set()

    ahead = prefetch(items(), 3)
    assert next(ahead) == 0
    ahead.close()  # type: ignore[attr-defined]
    assert closed.is_set()
    assert _threads() == []


def test_an_error_in_the_consumer_stops_it_too() -> None:
    closed = threading.Event()

    def items() -> Iterator[int]:
        try:
            yield from range(1_000_000)
        finally:
            closed.set()

    def consume() -> Iterator[int]:
        for item in prefetch(items(), 3):
            yield item
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(consume())
    assert closed.wait(WAIT_S)


def test_an_error_while_closing_is_not_swallowed() -> None:
    def items() -> Iterator[int]:
        try:
            yield 1
        finally:
            raise OSError("cannot close")

    with pytest.raises(OSError, match="cannot close"):
        list(prefetch(items(), 1))


def test_no_thread_before_the_first_item_and_no_depth_below_one() -> None:
    prefetch(iter(range(3)), 1)
    assert _threads() == []
    with pytest.raises(ValueError, match="depth is 0"):
        list(prefetch(iter(()), 0))
