"""Tables as text, and medians of times within one run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print rows under a head, columns aligned."""
    cells = [[str(cell) for cell in row] for row in (head, *rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    print(f"\n{title}")
    for row in cells:
        print("  " + "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)), flush=True)


def median_ms(call: Callable[[], object], repeats: int = 40) -> float:
    """Return the median processor time of a call on this thread, ms; its first call is not counted."""
    call()
    spent = []
    for _ in range(repeats):
        start = time.thread_time()
        call()
        spent.append(time.thread_time() - start)
    return 1e3 * float(np.median(spent))
